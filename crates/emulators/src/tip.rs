//! The tip of an emulated device: moved by its mechanics in a simulated hand, until a test puts it somewhere.

use glam::{DQuat, DVec3};
use palpate_devices::emulated::{Mechanics, Tip as FreeTip};

use crate::hand::hand_from_environment;

/// A place of the tip and its motion.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Tip {
    /// From the middle of the workspace, m.
    pub position: DVec3,
    /// m/s.
    pub velocity: DVec3,
    /// Of the stylus, from how it lies at rest.
    pub orientation: DQuat,
    /// rad/s.
    pub angular_velocity: DVec3,
}

impl Default for Tip {
    fn default() -> Self {
        Self::at(DVec3::ZERO)
    }
}

impl Tip {
    /// At rest.
    pub fn at(position: DVec3) -> Self {
        Self { position, velocity: DVec3::ZERO, orientation: DQuat::IDENTITY, angular_velocity: DVec3::ZERO }
    }

    /// Where it is after a time, s, if its velocities stay the same.
    pub fn after(self, seconds: f64) -> Self {
        let turned = DQuat::from_scaled_axis(self.angular_velocity * seconds);
        Self {
            position: self.position + self.velocity * seconds,
            orientation: (turned * self.orientation).normalize(),
            ..self
        }
    }
}

/// A tip whose time passes by [`SteeredTip::advance`].
pub struct SteeredTip {
    motion: Motion,
    /// Since it was made, s.
    time: f64,
}

enum Motion {
    /// By the mechanics, the hand and the motors.
    Free(Box<FreeTip>),
    /// Evenly from where a test has put it, and when, s.
    Put(Tip, f64),
}

impl SteeredTip {
    /// Moved by its mechanics, and by its hand if it has one.
    pub fn free(free: FreeTip) -> Self {
        Self { motion: Motion::Free(Box::new(free)), time: 0.0 }
    }

    /// Held by the hand that the environment names.
    pub fn in_hand(mechanics: Mechanics) -> Self {
        let hand = hand_from_environment();
        Self::free(FreeTip::new(mechanics, hand.target.at(0.0), Some(hand)))
    }

    /// In the middle of its workspace, where a test has put it.
    pub fn held() -> Self {
        Self { motion: Motion::Put(Tip::default(), 0.0), time: 0.0 }
    }

    /// Time since it was made, s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Puts it somewhere at a time, s. From then on it moves evenly, whatever the force of the motors.
    pub fn put(&mut self, tip: Tip, since: f64) {
        self.motion = Motion::Put(tip, since);
    }

    /// Sets the force of the motors, N.
    pub fn write(&mut self, force: DVec3) {
        if let Motion::Free(free) = &mut self.motion {
            free.write(force);
        }
    }

    /// Moves on by a time, s.
    pub fn advance(&mut self, seconds: f64) {
        self.time += seconds;
        if let Motion::Free(free) = &mut self.motion {
            free.advance(seconds);
        }
    }

    /// What its device measures now; to be called once a tick.
    pub fn measure(&mut self) -> Tip {
        match &mut self.motion {
            Motion::Put(tip, since) => tip.after(self.time - *since),
            Motion::Free(free) => {
                let measured = free.measure();
                Tip { velocity: measured.velocity, ..Tip::at(measured.position) }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use palpate_devices::emulated::{Hand, HandTarget};

    use super::*;

    const MECHANICS: Mechanics =
        Mechanics { mass: 0.1, damping: 0.5, dry_friction: 0.0, encoder_step: 0.0, delay: 0.0 };

    #[test]
    fn a_tip_in_a_hand_is_where_the_hand_wants_it() {
        let hand = Hand::firm(HandTarget::At(0.02 * DVec3::Z));
        let mut tip = SteeredTip::free(FreeTip::new(MECHANICS, hand.target.at(0.0), Some(hand)));
        tip.advance(1.0);
        assert!((tip.measure().position.z - 0.02).abs() < 1e-6);
    }

    #[test]
    fn a_tip_that_is_put_stays_or_goes_on_evenly() {
        let mut tip = SteeredTip::free(FreeTip::new(MECHANICS, DVec3::ZERO, None));
        tip.put(Tip { velocity: DVec3::X, angular_velocity: DVec3::Z, ..Tip::at(DVec3::Y) }, 0.0);
        tip.write(1e3 * DVec3::Z);
        tip.advance(0.5);
        let measured = tip.measure();
        assert!((measured.position - DVec3::new(0.5, 1.0, 0.0)).length() < 1e-12);
        assert!(measured.orientation.angle_between(DQuat::from_rotation_z(0.5)) < 1e-6);
    }
}
