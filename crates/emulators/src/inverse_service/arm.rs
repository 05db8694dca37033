//! One emulated arm: its tip, its motors and what the service holds of it.

use std::time::{Duration, Instant};

use glam::{DQuat, DVec3};
use palpate_devices::Buttons;

use super::steering::{ActiveCommand, ArmEnd, MotorForce};
use crate::tip::{SteeredTip, Tip};

/// Most changes of the motors' force that are remembered.
const MOST_CHANGES: usize = 1 << 16;

/// Time after which a command that is not repeated ends. UNVERIFIED: the vendor states none.
pub const IDLE_TIMEOUT: Duration = Duration::from_millis(100);

/// Largest force of the motors an axis, N. UNVERIFIED: that of other programs.
pub const MAX_FORCE: f64 = 10.0;

/// The middle of the workspace from the mounting face of the base, m: where the vendor's samples put their sphere.
pub const MIDDLE: DVec3 = DVec3::new(0.0, -0.1, 0.18);

/// An arm.
pub struct Arm {
    /// Four hexadecimal digits.
    pub id: String,
    /// `inverse3`, `inverse3x` or `minverse`.
    pub kind: &'static str,
    /// Whether it has been calibrated since it was switched on.
    pub calibrated: bool,
    /// Whether its cable is in.
    pub plugged: bool,
    tip: SteeredTip,
    /// Latest state that something asked for.
    pub measured: Tip,
    /// On the motors.
    pub motors: MotorForce,
    /// All that has been on the motors, oldest first.
    pub changes: Vec<MotorForce>,
    /// Session whose command is in force, and until when.
    command: Option<(u64, f64)>,
    began: Instant,
    /// To the test that steers it.
    end: ArmEnd,
}

impl Arm {
    /// Without a force.
    pub fn new((id, kind): (&str, &'static str), mut tip: SteeredTip, (began, end): (Instant, ArmEnd)) -> Self {
        Self {
            id: id.into(),
            kind,
            calibrated: true,
            plugged: true,
            measured: tip.measure(),
            tip,
            motors: MotorForce { force: DVec3::ZERO, at: began },
            changes: Vec::new(),
            command: None,
            began,
            end,
        }
    }

    /// Moves on to a time, s; a command that has not been repeated ends on the way.
    pub fn advance(&mut self, to: f64) {
        if let Some((tip, since)) = self.end.take_new_tip() {
            self.tip.put(tip, since);
        }
        if let Some((_, until)) = self.command.filter(|(_, until)| *until <= to) {
            self.move_to(until);
            self.release();
        }
        self.move_to(to);
    }

    fn move_to(&mut self, to: f64) {
        self.tip.advance((to - self.tip.time()).max(0.0));
    }

    /// Measures now: something addresses the arm.
    pub fn refresh(&mut self) {
        self.measured = self.tip.measure();
    }

    /// A session's command of a force, N, which ends after the timeout. Motors clamp each axis at the largest force.
    pub fn command(&mut self, session: u64, force: DVec3) {
        self.command = Some((session, self.tip.time() + IDLE_TIMEOUT.as_secs_f64()));
        let clamped = force.clamp(DVec3::splat(-MAX_FORCE), DVec3::splat(MAX_FORCE));
        self.set_motors(if self.calibrated && self.plugged { clamped } else { DVec3::ZERO });
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
        let at = moment(self.tip.time());
        let until = self.command.map(|(_, until)| moment(until));
        self.end.publish(ActiveCommand { motors: MotorForce { force, at }, until });
        if force != self.motors.force {
            self.tip.write(force);
            if self.changes.len() < MOST_CHANGES {
                self.changes.push(MotorForce { force, at });
            }
        }
        self.motors = MotorForce { force, at };
    }
}

/// A VerseGrip, which is paired with an arm: it turns as that is held, and is refreshed with it. By radio, with three buttons.
pub struct Grip {
    /// Identity.
    pub id: String,
    /// Identity of its arm.
    pub arm: String,
    /// Held buttons.
    pub buttons: Buttons,
    /// Latest orientation that something asked for.
    pub orientation: DQuat,
    /// Whether it is switched on.
    pub awake: bool,
}

impl Grip {
    /// Paired with an arm, at rest.
    pub fn new(id: &str, arm: &str) -> Self {
        let (buttons, orientation) = (Buttons::default(), DQuat::IDENTITY);
        Self { id: id.into(), arm: arm.into(), buttons, orientation, awake: true }
    }

    /// Whether button `rank` is held.
    pub fn holds(&self, rank: u32) -> bool {
        self.buttons.0 & (1 << rank) != 0
    }
}

#[cfg(test)]
mod tests {
    use super::super::steering::ends;
    use super::*;

    #[test]
    fn a_command_that_is_not_repeated_ends_at_its_time() {
        let began = Instant::now();
        let mut arm = Arm::new(("0A01", "inverse3"), SteeredTip::held(), (began, ends(began).1));
        arm.advance(1.0);
        arm.command(1, DVec3::new(1.0, 0.0, -20.0));
        assert_eq!(arm.motors.force, DVec3::new(1.0, 0.0, -10.0));
        arm.advance(1.09);
        arm.command(1, DVec3::Y);
        arm.advance(1.15);
        assert_eq!((arm.motors.force, arm.commanded_by()), (DVec3::Y, Some(1)));
        arm.advance(2.0);
        assert_eq!((arm.motors.force, arm.commanded_by()), (DVec3::ZERO, None));
        assert!((arm.motors.at - began).as_secs_f64() - 1.19 < 1e-9);
        arm.calibrated = false;
        arm.command(1, DVec3::Y);
        assert_eq!(arm.motors.force, DVec3::ZERO);
    }
}
