//! One emulated device and what it does in time.

use std::time::{Duration, Instant};

use glam::{DMat3, DVec3};
use palpate_emulators::conformance::{Disturbance, Tip};
use palpate_emulators::{SteeredTip, hand_from_environment};

use crate::error;
use crate::models::Model;

/// Damping of motors whose windings are shorted, N s/m.
const BRAKE_DAMPING: f64 = 10.0;

/// Added to the watchdog's time: the thread that should feed it runs on a machine that may be busy.
const WATCHDOG_LENIENCY: Duration = Duration::from_millis(200);

/// Speed of the tip above which the device brakes, m/s, until somebody sets another.
const USUAL_FASTEST: f64 = 2.0;

/// Cause of motors that are off: a button.
const BUTTON: i32 = 1;

/// What the motors do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Nothing: positions only.
    Idle,
    /// What they are told.
    Force,
    /// Shorted.
    Brake,
}

/// One device, plugged in or not.
pub struct Device {
    pub model: Model,
    tip: SteeredTip,
    moved: Instant,
    pub buttons: u32,
    pub disturbance: Option<Disturbance>,
    /// Everything that is said is random.
    pub nonsense: bool,
    pub uncalibrated: bool,
    /// Measuring fails, and nothing else.
    pub reads_fail: bool,
    pub open: bool,
    /// Unplugged while it was open: it stays so for who has it open.
    broken: bool,
    pub mode: Mode,
    pub force_off_cause: i32,
    /// What the motors were told last, which they put out whenever they are on.
    force: DVec3,
    torque: DVec3,
    pub told: Instant,
    pub gravity: bool,
    pub max_force: Option<f64>,
    /// In steps of 125 microseconds; 0: none.
    pub watchdog: u8,
    pub timeguard: Duration,
    pub fastest: f64,
    measured: Tip,
    measured_at: Option<Instant>,
}

impl Device {
    pub fn new(model: Model) -> Self {
        let now = Instant::now();
        Self {
            model,
            tip: SteeredTip::new(model.mechanics, hand_from_environment()),
            moved: now,
            buttons: 0,
            disturbance: None,
            nonsense: false,
            uncalibrated: false,
            reads_fail: false,
            open: false,
            broken: false,
            mode: Mode::Idle,
            force_off_cause: 0,
            force: DVec3::ZERO,
            torque: DVec3::ZERO,
            told: now,
            gravity: true,
            max_force: None,
            watchdog: 0,
            timeguard: Duration::ZERO,
            fastest: USUAL_FASTEST,
            measured: Tip::default(),
            measured_at: None,
        }
    }

    pub fn is_plugged(&self) -> bool {
        self.disturbance != Some(Disturbance::Unplugged)
    }

    pub fn disturb(&mut self, disturbance: Option<Disturbance>) {
        self.disturbance = disturbance;
        if !self.is_plugged() {
            self.broken = self.open;
            self.forget();
            self.switch(Mode::Idle, 5);
        }
    }

    /// What every call of an open device begins with: it has moved, and may have switched off.
    pub fn begin_call(&mut self) -> Result<(), i32> {
        self.go_on();
        if !self.open {
            return Err(error::NOT_AVAILABLE);
        }
        if self.broken || !self.is_plugged() {
            return Err(error::COMMUNICATION);
        }
        Ok(())
    }

    /// What measuring and telling forces fails with, and nothing else.
    fn check_geometry(&self) -> Result<(), i32> {
        if self.disturbance == Some(Disturbance::DriverError) { Err(error::GEOMETRY) } else { Ok(()) }
    }

    /// Time goes on.
    pub fn go_on(&mut self) {
        let now = Instant::now();
        if self.mode == Mode::Force && self.watchdog > 0 {
            let allowed = Duration::from_micros(125 * u64::from(self.watchdog)) + WATCHDOG_LENIENCY;
            if now - self.told > allowed {
                self.switch(Mode::Brake, 3);
            }
        }
        if self.mode == Mode::Brake && !self.tip.is_put() {
            let velocity = self.tip.measure().velocity;
            self.tip.write(-BRAKE_DAMPING * velocity);
        }
        self.tip.advance((now - self.moved).as_secs_f64());
        self.moved = now;
    }

    /// Motors off, or on again with what they were told last.
    fn switch(&mut self, mode: Mode, cause: i32) {
        (self.mode, self.force_off_cause, self.told) = (mode, cause, Instant::now());
        self.tip.write(self.motors().0);
    }

    fn forget(&mut self) {
        (self.force, self.torque) = (DVec3::ZERO, DVec3::ZERO);
    }

    /// By a button that somebody holds down, or lets go.
    pub fn switch_motors_off(&mut self, down: bool) {
        match (down, self.force_off_cause) {
            (true, _) => self.switch(Mode::Brake, BUTTON),
            (false, BUTTON) => self.switch(Mode::Force, 0),
            (false, _) => (),
        }
    }

    pub fn put(&mut self, tip: Tip) {
        self.go_on();
        self.tip.put(tip);
    }

    pub fn open(&mut self) {
        self.go_on();
        (self.open, self.broken) = (true, false);
        (self.watchdog, self.measured_at, self.gravity) = (0, None, true);
        self.forget();
        self.switch(Mode::Idle, 0);
    }

    pub fn close(&mut self) {
        (self.open, self.broken) = (false, false);
        self.forget();
        self.switch(Mode::Brake, 0);
    }

    pub fn enable(&mut self, on: bool) {
        if on && self.force_off_cause == BUTTON {
            return;
        }
        let mode = match (on, self.mode) {
            (true, _) => Mode::Force,
            (false, _) => Mode::Brake,
        };
        if mode != self.mode {
            self.switch(mode, if on { 0 } else { 4 });
        }
    }

    /// What the device measures, and whether this was measured before.
    pub fn measure(&mut self) -> Result<(Tip, bool), i32> {
        self.check_geometry()?;
        if self.reads_fail {
            return Err(error::COMMUNICATION);
        }
        let slow = self.disturbance == Some(Disturbance::SlowReplies);
        let cached = self.measured_at.is_some_and(|at| slow || at.elapsed() < self.timeguard);
        if !cached {
            self.measured = self.tip.measure();
            self.measured_at = Some(Instant::now());
            if !self.tip.is_put() && self.measured.velocity.length() > self.fastest && self.mode == Mode::Force {
                self.switch(Mode::Brake, 2);
            }
        }
        Ok((self.measured, cached))
    }

    /// What belongs to the position that was told last.
    pub fn latest(&mut self) -> Result<Tip, i32> {
        if self.measured_at.is_none() { self.measure().map(|(tip, _)| tip) } else { Ok(self.measured) }
    }

    /// Tells the motors; whether they saturate. The force keeps its direction.
    pub fn tell(&mut self, force: DVec3, torque: DVec3) -> Result<bool, i32> {
        self.check_geometry()?;
        if !force.is_finite() || !torque.is_finite() {
            return Err(error::INVALID);
        }
        let largest = self.max_force.map_or(self.model.max_force, |set| set.min(self.model.max_force));
        let put_force = force.clamp_length_max(largest);
        let put_torque = torque.clamp_length_max(self.model.max_torque);
        (self.force, self.torque) = (put_force, put_torque);
        if self.mode != Mode::Force {
            return Err(error::NOT_ENABLED);
        }
        self.told = Instant::now();
        self.tip.write(put_force);
        // What rounding does to a force at the limit is no saturation.
        let saturated =
            force.length() > largest * (1.0 + 1e-9) || torque.length() > self.model.max_torque * (1.0 + 1e-9);
        Ok(saturated)
    }

    /// What the motors put out: force, torque.
    pub fn motors(&self) -> (DVec3, DVec3) {
        if self.mode == Mode::Force { (self.force, self.torque) } else { (DVec3::ZERO, DVec3::ZERO) }
    }

    pub fn status(&self) -> [i32; 17] {
        let mut status = [0; 17];
        (status[0], status[1], status[2]) = (1, i32::from(!self.broken && self.is_plugged()), 1);
        status[3] = i32::from(self.uncalibrated);
        (status[4], status[5]) = (i32::from(self.mode == Mode::Idle), i32::from(self.mode == Mode::Force));
        (status[6], status[7]) = (i32::from(self.mode == Mode::Brake), i32::from(self.model.active_wrist));
        (status[8], status[10]) = (i32::from(self.model.wrist), i32::from(self.gravity));
        (status[11], status[12]) = (i32::from(!self.timeguard.is_zero()), 1);
        (status[14], status[16]) = (self.force_off_cause, 1);
        status
    }
}

/// The library's axes: x towards the person, y right, z up.
pub fn to_vendor(v: DVec3) -> DVec3 {
    DVec3::new(-v.y, v.x, v.z)
}

/// Back to right, away, up.
pub fn from_vendor(v: DVec3) -> DVec3 {
    DVec3::new(v.y, -v.x, v.z)
}

/// Rows of the matrix of a tip's orientation in the library's axes.
pub fn rows(tip: &Tip) -> [[f64; 3]; 3] {
    let ours = DMat3::from_quat(tip.orientation);
    // How the axes of the library turn, column by column.
    let turned = |axis: DVec3| to_vendor(ours * from_vendor(axis));
    DMat3::from_cols(turned(DVec3::X), turned(DVec3::Y), turned(DVec3::Z)).transpose().to_cols_array_2d()
}
