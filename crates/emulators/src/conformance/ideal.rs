//! A device in this process, as exact as numbers are; and the same with one flaw, which the suite must find.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use glam::{DQuat, DVec3};
use palpate_devices::{
    Buttons, Device, DeviceFault, DeviceLimits, OpenError, Opened, Pose, Reading, Twist, Wrench, known,
};

use super::{Bench, Disturbance, Facts, Motors, Tip};

/// What a driver may get wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flaw {
    MirroredPositions,
    Millimetres,
    SwappedAxes,
    MirroredVelocity,
    FastVelocity,
    InvertedOrientation,
    SwappedButtons,
    MirroredForce,
    StrongForce,
    LateReadings,
    LateForces,
    MillinewtonMetres,
    Unclamped,
    ForceFromNan,
    ForceWithoutLoop,
    ForceAfterClosing,
    Unnamed,
    SilentWhenUnplugged,
    ForceAfterFault,
    Unrecovered,
    WrongError,
    NeverStale,
    TellsNan,
    OpensWrongVersion,
    OpensNothing,
    BriefError,
    SometimesFaulty,
}

/// The emulated hardware.
struct Hardware {
    tip: Tip,
    since: Instant,
    buttons: Buttons,
    wrench: Wrench,
    at: Instant,
    disturbance: Option<Disturbance>,
    disturbed: Instant,
    flaw: Option<Flaw>,
}

impl Hardware {
    fn tip(&self) -> Tip {
        let time = self.since.elapsed().as_secs_f64();
        let Tip { position, velocity, orientation, angular_velocity } = self.tip;
        let orientation = DQuat::from_scaled_axis(angular_velocity * time) * orientation;
        Tip { position: position + velocity * time, velocity, orientation, angular_velocity }
    }
}

const MIDDLE: DVec3 = DVec3::new(0.0, -0.1, 0.2);
const STALE_AFTER: Duration = Duration::from_millis(10);
const FORCE_HOLDS: Duration = Duration::from_millis(40);
const ERROR: DeviceFault = DeviceFault::Driver(7);

pub struct Ideal(Arc<Mutex<Hardware>>);

impl Ideal {
    pub fn new(flaw: Option<Flaw>) -> Self {
        let (tip, now) = (Tip::default(), Instant::now());
        let (buttons, wrench) = (Buttons(0), Wrench::default());
        Self(Arc::new(Mutex::new(Hardware {
            tip,
            since: now,
            buttons,
            wrench,
            at: now,
            disturbance: None,
            disturbed: now,
            flaw,
        })))
    }

    fn hardware(&self) -> MutexGuard<'_, Hardware> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
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
            hurries: true,
        }
    }

    fn open(&mut self) -> Result<Opened, OpenError> {
        let (disturbance, flaw) = {
            let hardware = self.hardware();
            (hardware.disturbance, hardware.flaw)
        };
        let advice = if flaw == Some(Flaw::BriefError) { "" } else { "install a later one" };
        match disturbance {
            Some(Disturbance::WrongVersion) if flaw != Some(Flaw::OpensWrongVersion) => {
                return Err(OpenError::new("its software is of version 0.1", advice));
            }
            Some(Disturbance::Unplugged) if flaw != Some(Flaw::OpensNothing) => {
                return Err(OpenError::new("there is no device", "plug it in"));
            }
            _ => (),
        }
        let driver =
            Driver { hardware: Arc::clone(&self.0), last: None, held: Wrench::default(), ticks: 0, lost: false };
        Ok(Opened { device: Box::new(driver), scheduler: None })
    }

    fn set_tip(&mut self, tip: Tip) {
        let mut hardware = self.hardware();
        (hardware.tip, hardware.since) = (tip, Instant::now());
    }

    fn press(&mut self, buttons: Buttons) {
        self.hardware().buttons = buttons;
    }

    fn motors(&mut self) -> Motors {
        let hardware = self.hardware();
        let held = hardware.at.elapsed() < FORCE_HOLDS || hardware.flaw == Some(Flaw::ForceWithoutLoop);
        Motors { wrench: if held { hardware.wrench } else { Wrench::default() }, at: hardware.at }
    }

    fn disturb(&mut self, disturbance: Option<Disturbance>) {
        let mut hardware = self.hardware();
        (hardware.disturbance, hardware.disturbed) = (disturbance, Instant::now());
    }
}

struct Driver {
    hardware: Arc<Mutex<Hardware>>,
    last: Option<Reading>,
    held: Wrench,
    ticks: usize,
    lost: bool,
}

impl Driver {
    fn fault(&mut self, hardware: &Hardware) -> Option<DeviceFault> {
        let flaw = hardware.flaw;
        self.lost |= hardware.disturbance == Some(Disturbance::Unplugged);
        if flaw == Some(Flaw::SometimesFaulty) && self.ticks % 2_000 == 1_999 {
            return Some(DeviceFault::Stale);
        }
        if flaw == Some(Flaw::Unrecovered) && self.lost {
            return Some(DeviceFault::Disconnected);
        }
        let said = match hardware.disturbance? {
            Disturbance::Unplugged => (Flaw::SilentWhenUnplugged, DeviceFault::Disconnected),
            Disturbance::DriverError if flaw == Some(Flaw::WrongError) => return Some(DeviceFault::Driver(8)),
            Disturbance::DriverError => return Some(ERROR),
            Disturbance::SlowReplies if hardware.disturbed.elapsed() < STALE_AFTER => return None,
            Disturbance::SlowReplies => (Flaw::NeverStale, DeviceFault::Stale),
            Disturbance::NotFinite => (Flaw::TellsNan, DeviceFault::NotFinite),
            Disturbance::WrongVersion => return None,
        };
        (flaw != Some(said.0)).then_some(said.1)
    }
}

fn clamped(vector: DVec3, largest: f64) -> DVec3 {
    if vector.is_finite() { vector.clamp_length_max(largest) } else { DVec3::ZERO }
}

impl Device for Driver {
    fn name(&self) -> &str {
        let unnamed = self.hardware.lock().is_ok_and(|hardware| hardware.flaw == Some(Flaw::Unnamed));
        if unnamed { "" } else { "ideal" }
    }

    fn read(&mut self, now_ns: u64, _period: f64) -> Result<Reading, DeviceFault> {
        let shared = Arc::clone(&self.hardware);
        let hardware = shared.lock().unwrap_or_else(PoisonError::into_inner);
        self.ticks += 1;
        if let Some(fault) = self.fault(&hardware) {
            return Err(fault);
        }
        let (Tip { position, velocity, orientation, angular_velocity }, flaw) = (hardware.tip(), hardware.flaw);
        let (mut position, mut linear, mut buttons) = (MIDDLE + position, velocity, hardware.buttons);
        let mut orientation = orientation;
        match flaw {
            Some(Flaw::MirroredPositions) => position.x = -position.x,
            Some(Flaw::Millimetres) => position *= 1e3,
            Some(Flaw::SwappedAxes) => {
                position = MIDDLE + DVec3::new(1.0, 0.0, 0.0) * (position - MIDDLE).x + DVec3::Y * (position - MIDDLE).z
                    - DVec3::Z * (position - MIDDLE).y
            }
            Some(Flaw::MirroredVelocity) => linear.y = -linear.y,
            Some(Flaw::FastVelocity) => linear *= 1.05,
            Some(Flaw::InvertedOrientation) => orientation = orientation.inverse(),
            Some(Flaw::SwappedButtons) => buttons = Buttons(buttons.0 << 1 & 0b111 | buttons.0 >> 2),
            Some(Flaw::TellsNan) if hardware.disturbance == Some(Disturbance::NotFinite) => position.x = f64::NAN,
            _ => (),
        }
        let reading = Reading {
            pose: Pose { position, orientation },
            twist: Twist { linear, angular: angular_velocity },
            buttons,
            active: true,
            timestamp_ns: now_ns,
        };
        let told = if flaw == Some(Flaw::LateReadings) { self.last.unwrap_or(reading) } else { reading };
        self.last = Some(reading);
        Ok(Reading { timestamp_ns: now_ns, ..told })
    }

    fn write(&mut self, wrench: Wrench) -> Result<(), DeviceFault> {
        let mut hardware = self.hardware.lock().unwrap_or_else(PoisonError::into_inner);
        let limits = known::SIGMA;
        let mut put = Wrench {
            force: clamped(wrench.force, limits.max_force),
            torque: clamped(wrench.torque, limits.max_torque),
        };
        match hardware.flaw {
            Some(Flaw::MirroredForce) => put.force = -put.force,
            Some(Flaw::StrongForce) => put.force *= 1.05,
            Some(Flaw::MillinewtonMetres) => put.torque *= 1e3,
            Some(Flaw::Unclamped) if wrench.force.is_finite() => put.force = wrench.force,
            Some(Flaw::ForceFromNan) if !wrench.force.is_finite() => put.force = DVec3::X,
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
        let mut hardware = self.hardware.lock().unwrap_or_else(PoisonError::into_inner);
        let kept = hardware.flaw == Some(Flaw::ForceAfterClosing);
        hardware.wrench = if kept { Wrench { force: DVec3::Z, torque: DVec3::ZERO } } else { Wrench::default() };
        hardware.at = Instant::now() + if kept { Duration::from_secs(1) } else { Duration::ZERO };
    }
}
