//! One emulated device: frames, forces and what limits them.

use std::ffi::CString;
use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};

use glam::DVec3;
use palpate_devices::Wrench;
use palpate_devices::emulated::known;
use palpate_emulators::Tip;
use palpate_emulators::conformance::Disturbance;
use palpate_emulators::library::{Emulated, Hardware, World, world};

use crate::library::Library;
use crate::numbers::error;

/// Name of the default device.
pub const DEFAULT: &str = "Default Device";

/// Time without a frame after which the amplifiers drop out. An assumption: what the hardware does is not documented.
const AMPLIFIER_HOLDS: Duration = Duration::from_millis(20);

/// Rate at which amplifiers that have dropped out let the force through again, N/s. An assumption.
const RAMP: f64 = 20.0;

/// What a frame holds still.
#[derive(Clone, Copy, Debug, Default)]
pub struct Snapshot {
    pub tip: Tip,
    pub buttons: u32,
}

/// One device, plugged in or not.
pub struct Device {
    /// Open while it is initialised.
    pub hardware: Hardware,
    /// In the vendor's setup.
    pub name: CString,
    pub model: CString,
    pub has_torque: bool,
    /// Beyond which the amplifiers drop out, N.
    pub max_force: f64,
    /// Whether forces are enabled.
    pub force_output: bool,
    pub snapshot: Snapshot,
    /// What a program has set in this frame.
    pub commanded: Wrench,
    framed: bool,
    framed_tick: Option<u64>,
    /// Part of the force that the amplifiers let through.
    ramp: f64,
    output: Wrench,
    output_at: Instant,
}

impl Emulated for Device {
    type Library = Library;

    /// Models by commas, each with its name in the setup (`Left=PHANTOM Omni`); the first without a name is the default device.
    const VARIABLE: &str = "PALPATE_EMULATED_OPENHAPTICS";
    const DEFAULT_DEVICES: &str = "Touch";

    fn world() -> &'static OnceLock<Mutex<World<Self>>> {
        static WORLD: OnceLock<Mutex<World<Device>>> = OnceLock::new();
        &WORLD
    }

    fn named(entry: &str) -> Option<Self> {
        let (name, model) = entry.split_once('=').unwrap_or((DEFAULT, entry));
        let (name, model) = (name.trim(), model.trim());
        let max_force = match model {
            "PHANTOM Desktop" => 7.9,
            "PHANTOM Premium 1.5 6DOF" => 8.5,
            "PHANTOM Premium 3.0 6DOF" => 22.0,
            _ => 3.3,
        };
        Some(Self {
            hardware: Hardware::new(known::mechanics(model).or_else(|| known::mechanics("Touch"))?),
            name: CString::new(name).ok()?,
            model: CString::new(model).ok()?,
            has_torque: model.contains("6DOF"),
            max_force,
            force_output: false,
            snapshot: Snapshot::default(),
            commanded: Wrench::default(),
            framed: false,
            framed_tick: None,
            ramp: 1.0,
            output: Wrench::default(),
            output_at: Instant::now(),
        })
    }

    fn hardware(&mut self) -> &mut Hardware {
        &mut self.hardware
    }

    fn disturb(&mut self, disturbance: Option<Disturbance>) {
        self.hardware.disturb(disturbance);
        if !self.hardware.is_plugged() {
            self.set_output(Wrench::default());
        }
    }

    fn motors(&mut self) -> Wrench {
        if self.output_at.elapsed() > AMPLIFIER_HOLDS && self.output != Wrench::default() {
            self.set_output(Wrench::default());
        }
        self.output
    }

    fn run_fast(as_fast_as_possible: bool) {
        world::<Self>().library.fast = as_fast_as_possible;
    }
}

impl Device {
    /// Takes it for a program, with forces off, or gives it back.
    pub fn set_initialised(&mut self, initialised: bool) {
        self.hardware.set_open(initialised);
        (self.force_output, self.framed, self.ramp) = (false, false, 1.0);
        self.set_output(Wrench::default());
    }

    /// Time passes, s.
    pub fn advance(&mut self, seconds: f64) {
        self.hardware.tip.advance(seconds);
    }

    pub fn is_framed(&self) -> bool {
        self.framed
    }

    /// Holds still what is measured, and sets the force to zero. A tick of the scheduler has one frame at most.
    pub fn begin(&mut self, tick: Option<u64>) -> Result<(), u32> {
        if self.framed || (tick.is_some() && self.framed_tick == tick) {
            return Err(error::ILLEGAL_BEGIN);
        }
        (self.framed, self.framed_tick, self.commanded) = (true, tick, Wrench::default());
        if !self.hardware.is_connected() {
            return Err(error::COMMUNICATION);
        }
        self.snapshot = Snapshot { tip: self.hardware.tip.measure(), buttons: self.hardware.buttons };
        match self.hardware.disturbance {
            Some(Disturbance::ReadsFail) => Err(error::DEVICE_FAULT),
            Some(Disturbance::DriverError) => Err(error::TIMER),
            Some(Disturbance::MotorsOff) => {
                self.ramp = 0.0;
                Err(error::WARM_MOTORS)
            }
            _ => Ok(()),
        }
    }

    /// Puts out what was set, for a period, s.
    pub fn end(&mut self, period: f64) -> Result<(), u32> {
        if !self.framed {
            return Err(error::ILLEGAL_END);
        }
        self.framed = false;
        if !self.hardware.is_connected() {
            return Err(error::COMMUNICATION);
        }
        let Wrench { force, torque } = self.commanded;
        if !force.is_finite() || force.length() > self.max_force * (1.0 + 1e-9) {
            self.ramp = 0.0;
            self.set_output(Wrench::default());
            return Err(error::EXCEEDED_MAX_FORCE);
        }
        let share = if self.force_output { self.ramp } else { 0.0 };
        let torque = if self.has_torque { torque } else { DVec3::ZERO };
        self.set_output(Wrench { force: share * force, torque: share * torque });
        self.ramp = (self.ramp + RAMP / self.max_force * period).min(1.0);
        Ok(())
    }

    fn set_output(&mut self, wrench: Wrench) {
        (self.output, self.output_at) = (wrench, Instant::now());
        self.hardware.tip.write(wrench.force);
    }
}
