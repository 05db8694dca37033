//! One emulated device and what it does in time.

use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};

use glam::DVec3;
use palpate_devices::Wrench;
use palpate_emulators::Tip;
use palpate_emulators::conformance::Disturbance;
use palpate_emulators::library::{Emulated, Hardware, World};

use crate::error;
use crate::models::{Model, model};

/// Added to the watchdog's time: the thread that should feed it runs on a machine that may be busy.
const WATCHDOG_LENIENCY: Duration = Duration::from_millis(200);

/// Causes of motors that are off, by the vendor's numbers.
mod force_off {
    pub const NONE: i32 = 0;
    pub const BUTTON: i32 = 1;
    pub const WATCHDOG: i32 = 3;
    pub const PROGRAM: i32 = 4;
    pub const UNPLUGGED: i32 = 5;
}

/// One device, plugged in or not.
pub struct Device {
    pub hardware: Hardware,
    pub model: Model,
    moved: Instant,
    /// Whether the motors are on.
    enabled: bool,
    force_off_cause: i32,
    /// The latest command, which the motors put out whenever they are on.
    commanded: Wrench,
    commanded_at: Instant,
    /// In steps of 125 microseconds; 0: none.
    pub watchdog: u8,
    measured: Option<Tip>,
}

impl Emulated for Device {
    type Library = Library;

    const VARIABLE: &str = "PALPATE_EMULATED_FORCEDIMENSION";
    const DEFAULT_DEVICES: &str = "omega.6";

    fn world() -> &'static OnceLock<Mutex<World<Self>>> {
        static WORLD: OnceLock<Mutex<World<Device>>> = OnceLock::new();
        &WORLD
    }

    fn named(entry: &str) -> Option<Self> {
        let (model, now) = (model(entry)?, Instant::now());
        Some(Self {
            hardware: Hardware::new(model.mechanics),
            model,
            moved: now,
            enabled: false,
            force_off_cause: force_off::NONE,
            commanded: Wrench::default(),
            commanded_at: now,
            watchdog: 0,
            measured: None,
        })
    }

    fn hardware(&mut self) -> &mut Hardware {
        self.advance();
        &mut self.hardware
    }

    fn disturb(&mut self, disturbance: Option<Disturbance>) {
        self.hardware.disturb(disturbance);
        if disturbance == Some(Disturbance::MotorsOff) {
            self.switch(false, force_off::BUTTON);
        } else if self.force_off_cause == force_off::BUTTON {
            self.switch(true, force_off::NONE);
        }
        if !self.hardware.is_plugged() {
            self.commanded = Wrench::default();
            self.switch(false, force_off::UNPLUGGED);
        }
    }

    fn motors(&mut self) -> Wrench {
        self.advance();
        self.output()
    }
}

/// What the library has beside its devices.
#[derive(Default)]
pub struct Library {
    /// Whether the functions for experts are enabled.
    pub expert: bool,
}

impl Device {
    /// Begins a call to the open device, which has moved meanwhile and may have switched off.
    pub fn begin_call(&mut self) -> Result<(), i32> {
        self.advance();
        match (self.hardware.is_open(), self.hardware.is_connected()) {
            (false, _) => Err(error::NOT_AVAILABLE),
            (true, false) => Err(error::COMMUNICATION),
            (true, true) => Ok(()),
        }
    }

    /// Moves to now.
    fn advance(&mut self) {
        let now = Instant::now();
        let allowed = Duration::from_micros(125 * u64::from(self.watchdog)) + WATCHDOG_LENIENCY;
        if self.enabled && self.watchdog > 0 && now - self.commanded_at > allowed {
            self.switch(false, force_off::WATCHDOG);
        }
        self.hardware.tip.advance((now - self.moved).as_secs_f64());
        self.moved = now;
    }

    /// Switches the motors off, or on again with the latest command.
    fn switch(&mut self, enabled: bool, cause: i32) {
        (self.enabled, self.force_off_cause, self.commanded_at) = (enabled, cause, Instant::now());
        self.hardware.tip.write(self.output().force);
    }

    pub fn open(&mut self) {
        self.hardware.set_open(true);
        (self.watchdog, self.measured, self.commanded) = (0, None, Wrench::default());
        self.switch(false, force_off::NONE);
    }

    pub fn close(&mut self) {
        self.hardware.set_open(false);
        self.commanded = Wrench::default();
        self.switch(false, force_off::NONE);
    }

    /// Switches the motors; a button that is held down keeps them off.
    pub fn enable(&mut self, enabled: bool) {
        if enabled != self.enabled && self.force_off_cause != force_off::BUTTON {
            self.switch(enabled, if enabled { force_off::NONE } else { force_off::PROGRAM });
        }
    }

    /// The error of measurements and commands.
    fn check_geometry(&self) -> Result<(), i32> {
        if self.hardware.has(Disturbance::DriverError) { Err(error::GEOMETRY) } else { Ok(()) }
    }

    /// What the device measures, and whether this was measured before.
    pub fn measure(&mut self) -> Result<(Tip, bool), i32> {
        self.check_geometry()?;
        if self.hardware.has(Disturbance::ReadsFail) {
            return Err(error::COMMUNICATION);
        }
        let repeated = self.measured.filter(|_| self.hardware.has(Disturbance::SlowReplies));
        let tip = repeated.unwrap_or_else(|| self.hardware.tip.measure());
        self.measured = Some(tip);
        Ok((tip, repeated.is_some()))
    }

    /// What belongs to the position that was read last.
    pub fn latest(&mut self) -> Result<Tip, i32> {
        self.measured.map_or_else(|| self.measure().map(|(tip, _)| tip), Ok)
    }

    /// Commands a wrench. Its size is not limited: drivers keep to the largest force.
    pub fn command(&mut self, wrench: Wrench) -> Result<(), i32> {
        self.check_geometry()?;
        if !wrench.force.is_finite() || !wrench.torque.is_finite() {
            return Err(error::INVALID);
        }
        let torque = if self.model.active_wrist { wrench.torque } else { DVec3::ZERO };
        self.commanded = Wrench { torque, ..wrench };
        if !self.enabled {
            return Err(error::NOT_ENABLED);
        }
        self.commanded_at = Instant::now();
        self.hardware.tip.write(wrench.force);
        Ok(())
    }

    fn output(&self) -> Wrench {
        if self.enabled { self.commanded } else { Wrench::default() }
    }

    /// Power, connection, whether it is to be initialised, and why its motors are off, where the vendor has them.
    pub fn status(&self) -> [i32; 17] {
        let mut status = [0; 17];
        (status[0], status[1]) = (1, i32::from(self.hardware.is_connected()));
        (status[3], status[14]) = (i32::from(self.hardware.has(Disturbance::Uncalibrated)), self.force_off_cause);
        status
    }
}
