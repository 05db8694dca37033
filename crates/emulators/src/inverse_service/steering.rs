//! What a test and an emulated arm hand each other, wait-free: a test that is interrupted while it holds a lock would hold up the
//! service, and what it then sees late is not late by the driver.

use std::time::Instant;

use glam::DVec3;
use triple_buffer::{Input, Output, triple_buffer};

use super::motion::Held;

/// What the motors were told, and when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorForce {
    /// On the hand, N.
    pub force: DVec3,
    /// When it came onto the motors.
    pub at: Instant,
}

/// A force on the motors and when it ends by itself.
#[derive(Clone, Copy, Debug)]
pub struct Commanded {
    /// What is on the motors.
    pub motors: MotorForce,
    /// `None` for no force.
    pub until: Option<Instant>,
}

/// The arm's end.
pub struct ArmEnd {
    held: Output<Option<(Held, f64)>>,
    commanded: Input<Commanded>,
}

/// The test's end.
pub struct TestEnd {
    held: Input<Option<(Held, f64)>>,
    commanded: Output<Commanded>,
}

/// Both ends, of an arm without force.
pub fn ends(began: Instant) -> (TestEnd, ArmEnd) {
    let none = Commanded { motors: MotorForce { force: DVec3::ZERO, at: began }, until: None };
    let ((held, is_held), (commands, commanded)) = (triple_buffer(&None), triple_buffer(&none));
    (TestEnd { held, commanded }, ArmEnd { held: is_held, commanded: commands })
}

impl TestEnd {
    /// Holds the tip from a time on, s.
    pub fn hold(&mut self, held: Held, since: f64) {
        self.held.write(Some((held, since)));
    }

    /// What is on the motors now.
    pub fn motors(&mut self) -> MotorForce {
        let Commanded { motors, until } = *self.commanded.read();
        match until.filter(|until| *until <= Instant::now()) {
            Some(at) => MotorForce { force: DVec3::ZERO, at },
            None => motors,
        }
    }
}

impl ArmEnd {
    /// Where a test holds the tip since a time, s, if it has said so since the last call.
    pub fn newly_held(&mut self) -> Option<(Held, f64)> {
        if self.held.update() { *self.held.output_buffer_mut() } else { None }
    }

    /// Tells what is on the motors.
    pub fn tell(&mut self, commanded: Commanded) {
        self.commanded.write(commanded);
    }
}
