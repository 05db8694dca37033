//! Ideal device in this process, exact up to rounding; and the same with one flaw, which the suite must find.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use glam::DVec3;
use palpate_devices::{
    Buttons, Device, DeviceFault, DeviceLimits, OpenError, Pose, Reading, ReadyDevice, Twist, Wrench, known,
};

use super::{Bench, Disturbance, Facts};
use crate::tip::Tip;

/// What a driver may get wrong.
#[derive(Clone, Copy, Debug)]
pub enum Flaw {
    /// What it reads.
    Reading(fn(&mut Reading)),
    /// What it puts out, of what was written.
    Wrench(fn(&mut Wrench, Wrench)),
    /// The fault of a tick.
    Fault(fn(&Hardware, Option<DeviceFault>) -> Option<DeviceFault>),
    /// Why it does not open.
    Refusal(fn(OpenError) -> Option<OpenError>),
    Unnamed,
    LateReadings,
    LateForces,
    ForceWithoutLoop,
    ForceAfterClosing,
    ForceAfterFault,
}

/// The emulated hardware.
pub struct Hardware {
    tip: Tip,
    since: Instant,
    buttons: Buttons,
    wrench: Wrench,
    at: Instant,
    disturbance: Option<Disturbance>,
    disturbed: Instant,
    flaw: Option<Flaw>,
    /// Ticks of its drivers.
    pub ticks: usize,
    /// It has been unplugged once.
    pub lost: bool,
}

pub const MIDDLE: DVec3 = DVec3::new(0.0, -0.1, 0.2);
pub const ERROR: DeviceFault = DeviceFault::Driver(7);
const STALE_AFTER: Duration = Duration::from_millis(10);
const FORCE_HOLDS: Duration = Duration::from_millis(40);

type Shared = Arc<Mutex<Hardware>>;

fn locked(shared: &Shared) -> MutexGuard<'_, Hardware> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

pub struct Ideal(Shared);

impl Ideal {
    pub fn new(flaw: Option<Flaw>) -> Self {
        let now = Instant::now();
        Self(Arc::new(Mutex::new(Hardware {
            tip: Tip::default(),
            since: now,
            buttons: Buttons(0),
            wrench: Wrench::default(),
            at: now,
            disturbance: None,
            disturbed: now,
            flaw,
            ticks: 0,
            lost: false,
        })))
    }
}

impl Bench for Ideal {
    fn facts(&self) -> Facts {
        Facts {
            middle: MIDDLE,
            position_tolerance: 1e-9,
            velocity_tolerance: 1e-9,
            velocity_settles: Duration::ZERO,
            force_tolerance: 1e-3,
            turns: true,
            buttons: 3,
            late_ticks: 0,
            stale_after: STALE_AFTER,
            force_holds: FORCE_HOLDS,
            recovers_within: Duration::from_millis(100),
            driver_error: ERROR,
            can_run_fast: true,
        }
    }

    fn open(&mut self) -> Result<ReadyDevice, OpenError> {
        let hardware = locked(&self.0);
        let refusal = match hardware.disturbance {
            Some(Disturbance::WrongVersion) => {
                Some(OpenError::new("its software is of version 0.1", "install a later one"))
            }
            Some(Disturbance::Unplugged) => Some(OpenError::new("there is no device", "plug it in")),
            _ => None,
        };
        let refusal = match hardware.flaw {
            Some(Flaw::Refusal(changed)) => refusal.and_then(changed),
            _ => refusal,
        };
        match refusal {
            Some(error) => Err(error),
            None => {
                let driver = Driver { hardware: Arc::clone(&self.0), last: None, held: Wrench::default() };
                Ok(ReadyDevice { device: Box::new(driver), scheduler: None })
            }
        }
    }

    fn set_tip(&mut self, tip: Tip) {
        let mut hardware = locked(&self.0);
        (hardware.tip, hardware.since) = (tip, Instant::now());
    }

    fn press(&mut self, buttons: Buttons) {
        locked(&self.0).buttons = buttons;
    }

    fn motors(&mut self) -> Wrench {
        let hardware = locked(&self.0);
        let held = hardware.at.elapsed() < FORCE_HOLDS || matches!(hardware.flaw, Some(Flaw::ForceWithoutLoop));
        if held { hardware.wrench } else { Wrench::default() }
    }

    fn disturb(&mut self, disturbance: Option<Disturbance>) {
        let mut hardware = locked(&self.0);
        (hardware.disturbance, hardware.disturbed) = (disturbance, Instant::now());
    }
}

struct Driver {
    hardware: Shared,
    last: Option<Reading>,
    held: Wrench,
}

impl Hardware {
    fn fault(&mut self) -> Option<DeviceFault> {
        self.ticks += 1;
        self.lost |= self.disturbance == Some(Disturbance::Unplugged);
        let fault = match self.disturbance {
            Some(Disturbance::Unplugged) => Some(DeviceFault::Disconnected),
            Some(Disturbance::DriverError) => Some(ERROR),
            Some(Disturbance::SlowReplies) if self.disturbed.elapsed() >= STALE_AFTER => Some(DeviceFault::Stale),
            Some(Disturbance::NotFinite) => Some(DeviceFault::NotFinite),
            _ => None,
        };
        if let Some(Flaw::Fault(changed)) = self.flaw { changed(self, fault) } else { fault }
    }

    fn reading(&self, now_ns: u64) -> Reading {
        let Tip { position, velocity, orientation, angular_velocity } =
            self.tip.after(self.since.elapsed().as_secs_f64());
        let mut reading = Reading {
            pose: Pose { position: MIDDLE + position, orientation },
            twist: Twist { linear: velocity, angular: angular_velocity },
            buttons: self.buttons,
            active: true,
            timestamp_ns: now_ns,
        };
        if self.disturbance == Some(Disturbance::NotFinite) {
            reading.pose.position.x = f64::NAN;
        }
        if let Some(Flaw::Reading(change)) = self.flaw {
            change(&mut reading);
        }
        reading
    }
}

fn clamped(vector: DVec3, largest: f64) -> DVec3 {
    if vector.is_finite() { vector.clamp_length_max(largest) } else { DVec3::ZERO }
}

impl Device for Driver {
    fn name(&self) -> &str {
        let unnamed = matches!(locked(&self.hardware).flaw, Some(Flaw::Unnamed));
        if unnamed { "" } else { "ideal" }
    }

    fn read(&mut self, now_ns: u64, _period: f64) -> Result<Reading, DeviceFault> {
        let mut hardware = locked(&self.hardware);
        if let Some(fault) = hardware.fault() {
            return Err(fault);
        }
        let reading = hardware.reading(now_ns);
        let last = self.last.replace(reading);
        let late = matches!(hardware.flaw, Some(Flaw::LateReadings));
        Ok(Reading { timestamp_ns: now_ns, ..last.filter(|_| late).unwrap_or(reading) })
    }

    fn write(&mut self, wrench: Wrench) -> Result<(), DeviceFault> {
        let mut hardware = locked(&self.hardware);
        let limits = known::SIGMA;
        let mut put = Wrench {
            force: clamped(wrench.force, limits.max_force),
            torque: clamped(wrench.torque, limits.max_torque),
        };
        match hardware.flaw {
            Some(Flaw::Wrench(change)) => change(&mut put, wrench),
            Some(Flaw::LateForces) => std::mem::swap(&mut put, &mut self.held),
            Some(Flaw::ForceAfterFault) if hardware.disturbance.is_some() => return Ok(()),
            _ => (),
        }
        if hardware.disturbance == Some(Disturbance::Unplugged) {
            put = Wrench::default();
        }
        (hardware.wrench, hardware.at) = (put, Instant::now());
        Ok(())
    }

    fn limits(&self) -> DeviceLimits {
        known::SIGMA
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        let mut hardware = locked(&self.hardware);
        let lingers = matches!(hardware.flaw, Some(Flaw::ForceAfterClosing));
        hardware.wrench = if lingers { Wrench { force: DVec3::Z, torque: DVec3::ZERO } } else { Wrench::default() };
        hardware.at = Instant::now() + if lingers { Duration::from_secs(1) } else { Duration::ZERO };
    }
}
