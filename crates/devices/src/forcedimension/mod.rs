//! Devices of Force Dimension (omega, delta, sigma, lambda) and the Novint Falcon, by the vendor's DHD library.
//!
//! The library is safe to call from any thread and owns no loop: the tick calls it directly, which has the lowest delay. A
//! thread beside it (`guard`) watches what the tick cannot: motors that have switched themselves off, a loop that has stopped
//! writing, a device that has been unplugged and comes back.
//!
//! Not verified on hardware, therefore said here: that the vendor's axes are `x` towards the person, `y` right, `z` up; that
//! an unplugged device answers by the errors 2, 4, 5 or 6; the default time guard and watchdog, which the driver sets to its
//! longest, 32 ms.

mod device;
mod ffi;
mod guard;
mod library;
mod models;

use std::sync::{Mutex, MutexGuard, PoisonError};

use self::device::ForceDimensionDevice;
use self::ffi::{Id, error, status};
use self::library::Dhd;
use self::models::{Model, model};
use crate::{Connection, DeviceLimits, FoundDevice, Listing, OpenError, Opened};

/// Ranks of the devices that this process has opened.
static OPEN: Mutex<Vec<i8>> = Mutex::new(Vec::new());

fn open_ranks() -> MutexGuard<'static, Vec<i8>> {
    OPEN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The devices that there are, by rank.
pub fn list(connection: &Connection) -> Listing {
    let (dhd, facts) = match Dhd::load(connection) {
        Ok(loaded) => loaded,
        Err(error) => return Listing { found: Vec::new(), missing: Some(error), facts: Vec::new() },
    };
    let ranks = open_ranks();
    let found: Vec<FoundDevice> =
        (0..dhd.count() as i8).map(|rank| describe(dhd, rank, ranks.contains(&rank))).collect();
    let missing = found.is_empty().then(nothing_found);
    Listing { found, missing, facts }
}

/// Opens a device by its rank (`0`, `1`, ...), by default the first one that is free.
///
/// # Errors
/// A library that is not there or too old; no such device, or one that is in use or not initialised.
pub fn open(connection: &Connection) -> Result<Opened, OpenError> {
    let (dhd, _) = Dhd::load(connection)?;
    let mut ranks = open_ranks();
    let count = dhd.count() as i8;
    if count == 0 {
        return Err(nothing_found());
    }
    let rank = match &connection.id {
        Some(asked) => asked.parse().ok().filter(|rank| (0..count).contains(rank)).ok_or_else(|| {
            let what = format!("there is no Force Dimension device {asked:?}");
            OpenError::new(what, format!("choose one from 0 to {}", count - 1))
        })?,
        None => (0..count).find(|rank| !ranks.contains(rank)).unwrap_or(0),
    };
    if ranks.contains(&rank) {
        return Err(in_use(rank));
    }
    let (id, traits) = prepared(dhd, rank)?;
    let device = ForceDimensionDevice::new(dhd, rank, id, traits)?;
    ranks.push(rank);
    Ok(Opened { device: Box::new(device), scheduler: None })
}

/// What does not change of an open device.
#[derive(Clone, Debug, PartialEq)]
struct Traits {
    system_type: i32,
    name: String,
    limits: DeviceLimits,
    has_wrist: bool,
    has_active_wrist: bool,
}

fn traits(dhd: Dhd, id: Id) -> Traits {
    let system_type = dhd.system_type(id);
    let (has_wrist, has_active_wrist) = dhd.wrist(id);
    let Model { name, mut limits } = model(system_type);
    if !has_active_wrist {
        (limits.max_torque, limits.max_angular_damping) = (0.0, 0.0);
    }
    limits.max_force = dhd.max_force(id).map_or(limits.max_force, |set| limits.max_force.min(set));
    let said = dhd.system_name(id);
    let name = if said.is_empty() { name.to_owned() } else { said };
    Traits { system_type, name: format!("Force Dimension {name}"), limits, has_wrist, has_active_wrist }
}

/// Longest watchdog, in steps of 125 microseconds: 32 ms without a force.
const WATCHDOG: u8 = 255;

/// Opens a device, and readies it for forces: these are zero until one is written.
fn prepared(dhd: Dhd, rank: i8) -> Result<(Id, Traits), OpenError> {
    let id = dhd.open(rank).map_err(|code| does_not_open(dhd, rank, code))?;
    let readied = || {
        let traits = traits(dhd, id);
        obstacle(dhd, id, &traits.name)?;
        let failed = |code| does_not_open(dhd, rank, code);
        dhd.compensate_gravity(id).map_err(failed)?;
        dhd.enable_force(true, id).map_err(failed)?;
        dhd.release(traits.has_active_wrist, id).map_err(failed)?;
        dhd.watch(WATCHDOG, id);
        Ok((id, traits))
    };
        // A force of before must not come back with the motors; a library may refuse one while they are off.
        let _ = dhd.release(traits.has_active_wrist, id);
    readied().inspect_err(|_: &OpenError| dhd.close(id))
}

/// Why an open device cannot be used.
fn obstacle(dhd: Dhd, id: Id, name: &str) -> Result<(), OpenError> {
    let status = dhd.status(id).map_err(|code| {
        let what = format!("{name} does not tell its state ({})", dhd.error_text(code));
        OpenError::new(what, "switch it off and on again")
    })?;
    if status[status::POWER] == 0 {
        return Err(OpenError::new(format!("{name} has no power"), "switch it on"));
    }
    if status[status::RESET] != 0 {
        let advice = "run the vendor's Haptic Init (HapticInit), or move it by hand to its stops as its manual says";
        return Err(OpenError::new(format!("{name} is not initialised"), advice));
    }
    Ok(())
}

fn describe(dhd: Dhd, rank: i8, is_open: bool) -> FoundDevice {
    let unknown = |error| FoundDevice {
        id: rank.to_string(),
        name: "Force Dimension device".to_owned(),
        limits: DeviceLimits::UNLIMITED,
        obstacle: Some(error),
        facts: Vec::new(),
    };
    if is_open {
        return unknown(in_use(rank));
    }
    let id = match dhd.open(rank) {
        Ok(id) => id,
        Err(code) => return unknown(does_not_open(dhd, rank, code)),
    };
    let traits = traits(dhd, id);
    let obstacle = obstacle(dhd, id, &traits.name).err();
    dhd.close(id);
    let wrist = match (traits.has_wrist, traits.has_active_wrist) {
        (_, true) => "with motors",
        (true, false) => "without motors",
        (false, false) => "none",
    };
    let facts = vec![("wrist", wrist.to_owned()), ("system type", traits.system_type.to_string())];
    FoundDevice { id: rank.to_string(), name: traits.name, limits: traits.limits, obstacle, facts }
}

fn nothing_found() -> OpenError {
    let advice =
        "plug it in and switch it on; on Linux a udev rule must let you use it, which 'palpate devices' prints";
    OpenError::new("no Force Dimension device is found", advice)
}

fn in_use(rank: i8) -> OpenError {
    OpenError::new(
        format!("Force Dimension device {rank} is in use by this program"),
        "use another one, or close it first",
    )
}

fn does_not_open(dhd: Dhd, rank: i8, code: i32) -> OpenError {
    let what = format!("Force Dimension device {rank} does not open ({})", dhd.error_text(code));
    match code {
        error::DEVICE_IN_USE => OpenError::new(what, "close the program that uses it"),
        error::NO_DEVICE_FOUND | error::NO_DRIVER_FOUND => OpenError::new(what, nothing_found().advice),
        error::DEVICE_NOT_READY => OpenError::new(what, "switch it on and wait until its light is steady"),
        _ => OpenError::new(what, "switch it off and on again"),
    }
}
