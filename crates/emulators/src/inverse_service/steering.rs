//! Wait-free hand-off between a test and an emulated arm: a test that is interrupted while it holds a lock would hold up the
//! service, and what it then sees late is not late by the driver.

use std::time::Instant;

use glam::DVec3;
use triple_buffer::{Input, Output, triple_buffer};

use crate::tip::Tip;

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
pub struct ActiveCommand {
    /// What is on the motors.
    pub motors: MotorForce,
    /// `None` for no force.
    pub until: Option<Instant>,
}

/// The arm's end.
pub struct ArmEnd {
    put: Output<Option<(Tip, f64)>>,
    commanded: Input<ActiveCommand>,
}

/// The test's end.
pub struct TestEnd {
    put: Input<Option<(Tip, f64)>>,
    commanded: Output<ActiveCommand>,
}

/// Both ends, of an arm without force.
pub fn ends(began: Instant) -> (TestEnd, ArmEnd) {
    let none = ActiveCommand { motors: MotorForce { force: DVec3::ZERO, at: began }, until: None };
    let ((put, is_put), (commands, commanded)) = (triple_buffer(&None), triple_buffer(&none));
    (TestEnd { put, commanded }, ArmEnd { put: is_put, commanded: commands })
}

impl TestEnd {
    /// Puts the tip somewhere from a time on, s.
    pub fn put(&mut self, tip: Tip, since: f64) {
        self.put.write(Some((tip, since)));
    }

    /// What is on the motors now.
    pub fn motors(&mut self) -> MotorForce {
        let ActiveCommand { motors, until } = *self.commanded.read();
        match until.filter(|until| *until <= Instant::now()) {
            Some(at) => MotorForce { force: DVec3::ZERO, at },
            None => motors,
        }
    }
}

impl ArmEnd {
    /// Where a test has put the tip since the last call, and when, s.
    pub fn take_new_tip(&mut self) -> Option<(Tip, f64)> {
        if self.put.update() { *self.put.output_buffer_mut() } else { None }
    }

    /// Publishes what is on the motors.
    pub fn publish(&mut self, commanded: ActiveCommand) {
        self.commanded.write(commanded);
    }
}
