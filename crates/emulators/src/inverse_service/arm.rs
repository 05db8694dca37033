//! One emulated arm: its tip, its motors and what the service holds of it.

use std::time::{Duration, Instant};

use glam::DVec3;

use super::motion::{Measured, Motion};
use super::steering::{ArmEnd, Commanded, MotorForce};

/// Most changes of the motors' force that are remembered.
const MOST_CHANGES: usize = 1 << 16;

/// The middle of the workspace from the mounting face of the base, m: where the vendor's samples put their sphere.
pub const MIDDLE: DVec3 = DVec3::new(0.0, -0.1, 0.18);

/// What the status says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Condition {
    /// Whether the arm has been calibrated since it was switched on.
    pub calibrated: bool,
    /// Whether its motors have power.
    pub power_supply: bool,
    /// Whether it has started.
    pub ready: bool,
    /// Whether its cable is in.
    pub plugged: bool,
}

impl Default for Condition {
    fn default() -> Self {
        Self { calibrated: true, power_supply: true, ready: true, plugged: true }
    }
}

/// An arm.
pub struct Arm {
    /// Four hexadecimal digits.
    pub id: String,
    /// `inverse3`, `inverse3x` or `minverse`.
    pub kind: &'static str,
    /// What its status says.
    pub condition: Condition,
    /// How its tip moves.
    pub motion: Motion,
    /// Latest state that something asked for.
    pub measured: Measured,
    /// On the motors.
    pub motors: MotorForce,
    /// All that has been on the motors, oldest first.
    pub changes: Vec<MotorForce>,
    /// How many commands were larger than the motors' largest force.
    pub clamped: u64,
    /// Session whose command is in force, and until when.
    command: Option<(u64, f64)>,
    /// Motion is known up to this time, s.
    time: f64,
    began: Instant,
    /// To the test that steers it.
    end: ArmEnd,
}

impl Arm {
    /// At rest.
    pub fn new((id, kind): (&str, &'static str), mut motion: Motion, (began, end): (Instant, ArmEnd)) -> Self {
        let motors = MotorForce { force: DVec3::ZERO, at: began };
        Self {
            id: id.into(),
            kind,
            condition: Condition::default(),
            measured: motion.measure(0.0),
            motion,
            motors,
            changes: Vec::new(),
            clamped: 0,
            command: None,
            time: 0.0,
            began,
            end,
        }
    }

    /// Moves on to a time, s; a command that has not been repeated ends on the way.
    pub fn advance(&mut self, to: f64) {
        if let Some((held, since)) = self.end.newly_held() {
            self.motion = Motion::Held(held, since);
        }
        if let Some((_, until)) = self.command.filter(|(_, until)| *until <= to) {
            self.move_to(until);
            self.release();
        }
        self.move_to(to);
    }

    fn move_to(&mut self, to: f64) {
        if to > self.time {
            self.motion.advance(self.motors.force, self.time, to);
            self.time = to;
        }
    }

    /// Measures now: something addresses the arm.
    pub fn refresh(&mut self) {
        self.measured = self.motion.measure(self.time);
    }

    /// A session's command of a force, N, which ends after the timeout. Motors clamp each axis at the largest force.
    pub fn command(&mut self, session: u64, force: DVec3, (largest, timeout): (f64, Duration)) {
        let Condition { calibrated, power_supply, ready, plugged } = self.condition;
        self.command = Some((session, self.time + timeout.as_secs_f64()));
        let clamped = force.clamp(DVec3::splat(-largest), DVec3::splat(largest));
        self.clamped += u64::from(clamped != force);
        let has_motors = calibrated && power_supply && ready && plugged;
        self.set_motors(if has_motors { clamped } else { DVec3::ZERO });
    }

    /// The session whose command is in force.
    pub fn commanded_by(&self) -> Option<u64> {
        self.command.map(|(session, _)| session)
    }

    /// No command is in force any more: the arm is idle.
    pub fn release(&mut self) {
        self.command = None;
        self.set_motors(DVec3::ZERO);
    }

    fn set_motors(&mut self, force: DVec3) {
        let moment = |time: f64| self.began + Duration::from_secs_f64(time);
        let at = moment(self.time);
        let until = self.command.map(|(_, until)| moment(until));
        self.end.tell(Commanded { motors: MotorForce { force, at }, until });
        if force != self.motors.force && self.changes.len() < MOST_CHANGES {
            self.changes.push(MotorForce { force, at });
        }
        self.motors = MotorForce { force, at };
    }
}

#[cfg(test)]
mod tests {
    use super::super::motion::Held;
    use super::super::steering::ends;
    use super::*;

    #[test]
    fn a_command_that_is_not_repeated_ends_at_its_time() {
        let began = Instant::now();
        let mut arm = Arm::new(("0A01", "inverse3"), Motion::Held(Held::at(DVec3::X), 0.0), (began, ends(began).1));
        let limits = (10.0, Duration::from_millis(100));
        arm.advance(1.0);
        arm.command(1, DVec3::new(1.0, 0.0, -20.0), limits);
        assert_eq!((arm.motors.force, arm.clamped), (DVec3::new(1.0, 0.0, -10.0), 1));
        arm.advance(1.09);
        arm.command(1, DVec3::Y, limits);
        arm.advance(1.15);
        assert_eq!((arm.motors.force, arm.commanded_by()), (DVec3::Y, Some(1)));
        arm.advance(2.0);
        assert_eq!((arm.motors.force, arm.commanded_by()), (DVec3::ZERO, None));
        assert!((arm.motors.at - began).as_secs_f64() - 1.19 < 1e-9);
        arm.condition.calibrated = false;
        arm.command(1, DVec3::Y, limits);
        assert_eq!(arm.motors.force, DVec3::ZERO);
    }
}
