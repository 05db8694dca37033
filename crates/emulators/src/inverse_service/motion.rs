//! How the tip of an emulated arm moves: by its mechanics in a simulated hand, or held by a test.

use glam::{DQuat, DVec3};
use palpate_devices::emulated;

/// Where a test holds a tip: stronger than the motors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// From the middle of the workspace, m.
    pub position: DVec3,
    /// Velocity at which it goes on from there, m/s.
    pub velocity: DVec3,
    /// Of the grip.
    pub orientation: DQuat,
    /// Of the grip, rad/s in the frame of the arm.
    pub angular_velocity: DVec3,
}

impl Held {
    /// At rest.
    pub fn at(position: DVec3) -> Self {
        Self { position, velocity: DVec3::ZERO, orientation: DQuat::IDENTITY, angular_velocity: DVec3::ZERO }
    }
}

/// What the arm measures, from the middle of the workspace.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// m.
    pub position: DVec3,
    /// m/s.
    pub velocity: DVec3,
    /// Of the grip.
    pub orientation: DQuat,
}

/// A tip in motion.
pub enum Motion {
    /// Held by a test since a time, s.
    Held(Held, f64),
    /// Moved by its hand and motors.
    Free(Box<emulated::Tip>),
}

impl Motion {
    /// Goes on with a force of the motors, N, from one time to another, s.
    pub fn advance(&mut self, force: DVec3, from: f64, to: f64) {
        if let Motion::Free(tip) = self {
            if tip.force() != force {
                tip.write(force);
            }
            tip.advance((to - from).max(0.0));
        }
    }

    /// What the arm measures at a time, s.
    pub fn measure(&mut self, time: f64) -> Measured {
        match self {
            Motion::Held(held, since) => {
                let elapsed = time - *since;
                let turned = DQuat::from_scaled_axis(held.angular_velocity * elapsed);
                Measured {
                    position: held.position + held.velocity * elapsed,
                    velocity: held.velocity,
                    orientation: turned * held.orientation,
                }
            }
            Motion::Free(tip) => {
                let emulated::Measurement { position, velocity } = tip.measure();
                Measured { position, velocity, orientation: DQuat::IDENTITY }
            }
        }
    }
}
