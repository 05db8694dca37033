//! One emulated device: frames, forces and what limits them.

use std::ffi::CString;
use std::time::{Duration, Instant};

use glam::{DMat3, DVec3};
use palpate_devices::emulated::known;
use palpate_emulators::conformance::{Disturbance, Tip};
use palpate_emulators::{SteeredTip, hand_from_environment};

use crate::numbers::{capability, error};

/// Time without a frame after which the amplifiers drop out. An assumption: what the hardware does is not documented.
const AMPLIFIER_HOLDS: Duration = Duration::from_millis(20);

/// Usual limits: N, N a frame, mm/s, N/s. All but the force are assumptions.
const USUAL: Limits = Limits { force: 3.3, impulse: 10.0, speed: 3000.0, ramp: 20.0 };

/// What a program may set.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    pub force: f64,
    pub impulse: f64,
    pub speed: f64,
    pub ramp: f64,
}

/// What a frame holds still.
#[derive(Clone, Copy, Debug, Default)]
pub struct Snapshot {
    pub tip: Tip,
    pub buttons: u32,
}

/// What a program has set within a frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Commanded {
    /// N, right, away, up.
    pub force: DVec3,
    /// N m.
    pub torque: DVec3,
    /// A force or torque at the tip has been set.
    pub at_tip: bool,
    /// Motors have been set one by one.
    pub motors: bool,
}

/// One device, plugged in or not.
pub struct Device {
    /// In the vendor's setup.
    pub name: CString,
    pub model: CString,
    pub has_torque: bool,
    tip: SteeredTip,
    pub buttons: u32,
    pub disturbance: Option<Disturbance>,
    /// Everything that is said is random.
    pub nonsense: bool,
    pub uncalibrated: bool,
    /// Frames begin with a fault of the device, and go on.
    pub reads_fail: bool,
    /// The motors are too warm.
    warm: bool,
    pub initialised: bool,
    /// Unplugged while it was initialised: it stays so for who has it.
    pub broken: bool,
    pub enabled: Vec<u32>,
    pub limits: Limits,
    pub snapshot: Snapshot,
    pub last: Snapshot,
    pub last_force: DVec3,
    pub commanded: Commanded,
    framed: bool,
    framed_tick: Option<u64>,
    /// Part of the force that the amplifiers let through.
    ramp: f64,
    force: DVec3,
    torque: DVec3,
    pub told: Instant,
}

impl Device {
    pub fn new(name: &str, model: &str) -> Self {
        let mechanics = known::mechanics(model).or_else(|| known::mechanics("Touch"));
        let mechanics = mechanics.expect("the mechanics of a Touch are known");
        let has_torque = model.contains("6DOF");
        let force = match model {
            "PHANTOM Desktop" => 7.9,
            "PHANTOM Premium 1.5 6DOF" => 8.5,
            "PHANTOM Premium 3.0 6DOF" => 22.0,
            _ => USUAL.force,
        };
        Self {
            name: CString::new(name).unwrap_or_default(),
            model: CString::new(model).unwrap_or_default(),
            has_torque,
            tip: SteeredTip::new(mechanics, hand_from_environment()),
            buttons: 0,
            disturbance: None,
            nonsense: false,
            uncalibrated: false,
            reads_fail: false,
            warm: false,
            initialised: false,
            broken: false,
            enabled: Vec::new(),
            limits: Limits { force, ..USUAL },
            snapshot: Snapshot::default(),
            last: Snapshot::default(),
            last_force: DVec3::ZERO,
            commanded: Commanded::default(),
            framed: false,
            framed_tick: None,
            ramp: 1.0,
            force: DVec3::ZERO,
            torque: DVec3::ZERO,
            told: Instant::now(),
        }
    }

    pub fn is_plugged(&self) -> bool {
        self.disturbance != Some(Disturbance::Unplugged)
    }

    pub fn disturb(&mut self, disturbance: Option<Disturbance>) {
        self.disturbance = disturbance;
        if !self.is_plugged() {
            self.broken = self.initialised;
            self.motors_off();
        }
    }

    pub fn initialise(&mut self) {
        (self.initialised, self.broken, self.framed, self.ramp) = (true, false, false, 1.0);
        // Forces are off; of the rest the clamping, which would hide forces that are too large.
        let off = [capability::FORCE_OUTPUT, capability::MAX_FORCE_CLAMPING];
        self.enabled = capability::ALL.into_iter().filter(|one| !off.contains(one)).collect();
        self.motors_off();
    }

    pub fn disable(&mut self) {
        (self.initialised, self.broken, self.framed) = (false, false, false);
        self.motors_off();
    }

    pub fn is_enabled(&self, capability: u32) -> bool {
        self.enabled.contains(&capability)
    }

    pub fn motors_off(&mut self) {
        (self.force, self.torque, self.told) = (DVec3::ZERO, DVec3::ZERO, Instant::now());
        self.tip.write(DVec3::ZERO);
    }

    pub fn put(&mut self, tip: Tip) {
        self.tip.put(tip);
    }

    /// Time goes on, s.
    pub fn advance(&mut self, seconds: f64) {
        self.tip.advance(seconds);
    }

    pub fn is_framed(&self) -> bool {
        self.framed
    }

    /// Holds still what is measured, and sets the force to zero.
    pub fn begin(&mut self, tick: Option<u64>) -> Result<(), u32> {
        let again = tick.is_some() && self.framed_tick == tick && self.is_enabled(capability::ONE_FRAME_LIMIT);
        if self.framed || again {
            return Err(error::ILLEGAL_BEGIN);
        }
        (self.framed, self.framed_tick) = (true, tick);
        self.commanded = Commanded::default();
        if self.broken || !self.is_plugged() {
            return Err(error::COMMUNICATION);
        }
        self.last = self.snapshot;
        self.snapshot = Snapshot { tip: self.tip.measure(), buttons: self.buttons };
        if self.reads_fail {
            return Err(error::DEVICE_FAULT);
        }
        if self.disturbance == Some(Disturbance::DriverError) {
            return Err(error::TIMER);
        }
        if self.warm {
            self.drop_out();
            return Err(error::WARM_MOTORS);
        }
        let speed = 1e3 * self.snapshot.tip.velocity.length();
        let limited = self.is_enabled(capability::SOFTWARE_VELOCITY_LIMIT) && !self.tip.is_put();
        if limited && speed > self.limits.speed {
            self.drop_out();
            return Err(error::EXCEEDED_MAX_VELOCITY);
        }
        Ok(())
    }

    /// Until they have cooled.
    pub fn switch_motors_off(&mut self, warm: bool) {
        self.warm = warm;
    }

    /// Amplifiers off, from where they come back.
    fn drop_out(&mut self) {
        self.ramp = 0.0;
    }

    /// Puts out what was set, for a period, s.
    pub fn end(&mut self, period: f64) -> Result<(), u32> {
        if !self.framed {
            return Err(error::ILLEGAL_END);
        }
        self.framed = false;
        if self.broken || !self.is_plugged() {
            return Err(error::COMMUNICATION);
        }
        let Commanded { mut force, torque, at_tip, motors } = self.commanded;
        if at_tip && motors {
            self.drop_out();
            self.put_out(DVec3::ZERO, DVec3::ZERO);
            return Err(error::FORCE_ERROR);
        }
        let exceeded = force.length() > self.limits.force * (1.0 + 1e-9);
        if exceeded && self.is_enabled(capability::MAX_FORCE_CLAMPING) {
            force = force.clamp_length_max(self.limits.force);
        } else if !force.is_finite() || (exceeded && self.is_enabled(capability::SOFTWARE_FORCE_LIMIT)) {
            self.drop_out();
            self.put_out(DVec3::ZERO, DVec3::ZERO);
            return Err(error::EXCEEDED_MAX_FORCE);
        }
        let step = (force - self.last_force).length();
        let impulse = self.is_enabled(capability::SOFTWARE_FORCE_IMPULSE_LIMIT) && step > self.limits.impulse;
        if impulse {
            self.drop_out();
        }
        let ramped = if self.is_enabled(capability::FORCE_RAMPING) { self.ramp } else { 1.0 };
        self.last_force = force;
        match self.is_enabled(capability::FORCE_OUTPUT) {
            true => self.put_out(ramped * force, ramped * torque),
            false => self.put_out(DVec3::ZERO, DVec3::ZERO),
        }
        self.ramp = (self.ramp + self.limits.ramp / self.limits.force * period).min(1.0);
        if impulse { Err(error::EXCEEDED_MAX_FORCE_IMPULSE) } else { Ok(()) }
    }

    fn put_out(&mut self, force: DVec3, torque: DVec3) {
        let torque = if self.has_torque { torque } else { DVec3::ZERO };
        (self.force, self.torque, self.told) = (force, torque, Instant::now());
        self.tip.write(force);
    }

    /// What the motors put out: force, torque.
    pub fn motors(&mut self) -> (DVec3, DVec3) {
        if self.told.elapsed() > AMPLIFIER_HOLDS && self.force != DVec3::ZERO {
            self.motors_off();
        }
        (self.force, self.torque)
    }
}

/// The library's axes: x right, y up, z towards the person.
pub fn to_vendor(v: DVec3) -> DVec3 {
    DVec3::new(v.x, v.z, -v.y)
}

/// Back to right, away, up.
pub fn from_vendor(v: DVec3) -> DVec3 {
    DVec3::new(v.x, -v.z, v.y)
}

/// The transform of a tip, its columns one after the other; mm.
pub fn transform(tip: &Tip) -> [f64; 16] {
    let ours = DMat3::from_quat(tip.orientation);
    let column = |axis: DVec3| to_vendor(ours * from_vendor(axis));
    let (x, y, z) = (column(DVec3::X), column(DVec3::Y), column(DVec3::Z));
    let place = 1e3 * to_vendor(tip.position);
    [x.x, x.y, x.z, 0.0, y.x, y.y, y.z, 0.0, z.x, z.y, z.z, 0.0, place.x, place.y, place.z, 1.0]
}
