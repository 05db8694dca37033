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
mod open_devices;

use self::device::ForceDimensionDevice;
use self::ffi::{Id, error, status};
use self::library::Dhd;
use self::models::{Model, model};
use self::open_devices::{OpenDevice, open_devices, ranks_have_moved};
use crate::{Connection, DeviceLimits, FoundDevice, Listing, OpenError, ReadyDevice};

/// The devices that there are, by rank.
pub fn list(connection: &Connection) -> Listing {
    let (dhd, facts) = match Dhd::load(connection) {
        Ok(loaded) => loaded,
        Err(error) => return Listing { found: Vec::new(), missing: Some(error), facts: Vec::new() },
    };
    let open_devices = open_devices();
    let count = dhd.count() as i8;
    let found: Vec<FoundDevice> = (0..count).map(|rank| describe(dhd, rank, &open_devices, count)).collect();
    let missing = found.is_empty().then(nothing_found);
    Listing { found, missing, facts }
}

/// Opens a device by its rank (`0`, `1`, ...), by default the first one that is free.
///
/// # Errors
/// A library that is not there or too old; no such device, or one that is in use or not initialised.
pub fn open(connection: &Connection) -> Result<ReadyDevice, OpenError> {
    let (dhd, _) = Dhd::load(connection)?;
    let mut open_devices = open_devices();
    let count = dhd.count() as i8;
    if count == 0 {
        return Err(nothing_found());
    }
    let rank = match &connection.id {
        Some(asked) => asked.parse().ok().filter(|rank| (0..count).contains(rank)).ok_or_else(|| {
            let what = format!("there is no Force Dimension device {asked:?}");
            OpenError::new(what, format!("choose one from 0 to {}", count - 1))
        })?,
        None => (0..count).find(|rank| open_devices.iter().all(|one| one.rank != *rank)).unwrap_or(0),
    };
    if open_devices.iter().any(|one| one.rank == rank) {
        return Err(in_use_error(rank));
    }
    let (id, traits) = open_unclaimed(dhd, rank, &open_devices)?;
    prepare_for_forces(dhd, rank, id, &traits)?;
    let place = OpenDevice { rank, id: Some(id), count };
    let device = ForceDimensionDevice::new(dhd, place, id, traits)?;
    open_devices.push(place);
    Ok(ReadyDevice { device: Box::new(device), scheduler: None })
}

/// What does not change of an open device.
#[derive(Clone, Debug, PartialEq)]
struct Traits {
    system_type: i32,
    serial: Option<u16>,
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
    let system_name = dhd.system_name(id);
    let name = if system_name.is_empty() { name.to_owned() } else { system_name };
    let name = format!("Force Dimension {name}");
    Traits { system_type, serial: dhd.serial(id), name, limits, has_wrist, has_active_wrist }
}

/// Longest watchdog, in steps of 125 microseconds: 32 ms without a force.
const WATCHDOG: u8 = 255;

/// Opens a device that nobody in this process holds, whatever its rank has been.
fn open_unclaimed(dhd: Dhd, rank: i8, open_devices: &[OpenDevice]) -> Result<(Id, Traits), OpenError> {
    let id = dhd.open(rank).map_err(|code| open_error(dhd, rank, code))?;
    if open_devices.iter().any(|one| one.id == Some(id)) {
        // Not opened anew, and not to be closed.
        return Err(in_use_error(rank));
    }
    Ok((id, traits(dhd, id)))
}

/// Readies an open device for forces, which are zero until one is written, or closes it.
fn prepare_for_forces(dhd: Dhd, rank: i8, id: Id, traits: &Traits) -> Result<(), OpenError> {
    let ready = || {
        obstacle(dhd, id, &traits.name)?;
        let failed = |code| open_error(dhd, rank, code);
        dhd.compensate_gravity(id).map_err(failed)?;
        // A force of before must not come back with the motors; a library may refuse one while they are off.
        let _ = dhd.release(traits.has_active_wrist, id);
        dhd.enable_force(true, id).map_err(failed)?;
        dhd.release(traits.has_active_wrist, id).map_err(failed)?;
        dhd.watch(WATCHDOG, id);
        Ok(())
    };
    ready().inspect_err(|_: &OpenError| dhd.close(id))
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

/// Why a device may not be opened to be described.
fn hindrance(rank: i8, open_devices: &[OpenDevice], count: i8) -> Option<OpenError> {
    if ranks_have_moved(open_devices, count) {
        let what = format!("Force Dimension device {rank} cannot be told from those in use: some have come or gone");
        return Some(OpenError::new(what, "close those of this program, then look again"));
    }
    open_devices.iter().any(|one| one.rank == rank).then(|| in_use_error(rank))
}

fn describe(dhd: Dhd, rank: i8, open_devices: &[OpenDevice], count: i8) -> FoundDevice {
    let unknown = |error| FoundDevice {
        id: rank.to_string(),
        name: "Force Dimension device".to_owned(),
        limits: DeviceLimits::UNLIMITED,
        obstacle: Some(error),
        facts: Vec::new(),
    };
    if let Some(hindrance) = hindrance(rank, open_devices, count) {
        return unknown(hindrance);
    }
    let (id, traits) = match open_unclaimed(dhd, rank, open_devices) {
        Ok(opened) => opened,
        Err(error) => return unknown(error),
    };
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

fn in_use_error(rank: i8) -> OpenError {
    OpenError::new(
        format!("Force Dimension device {rank} is in use by this program"),
        "use another one, or close it first",
    )
}

fn open_error(dhd: Dhd, rank: i8, code: i32) -> OpenError {
    let what = format!("Force Dimension device {rank} does not open ({})", dhd.error_text(code));
    match code {
        error::DEVICE_IN_USE => OpenError::new(what, "close the program that uses it"),
        error::NO_DEVICE_FOUND | error::NO_DRIVER_FOUND => OpenError::new(what, nothing_found().advice),
        error::DEVICE_NOT_READY => OpenError::new(what, "switch it on and wait until its light is steady"),
        _ => OpenError::new(what, "switch it off and on again"),
    }
}
