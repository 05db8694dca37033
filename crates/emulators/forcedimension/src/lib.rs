//! An emulated library of Force Dimension's DHD: the documented functions, on devices that do not exist.
//!
//! From the vendor's documentation: results below zero are errors, told apart by the calling thread's last error, 1 is
//! a measurement that is repeated because it was asked for too early, 2 a motor that saturates; no forces before they are
//! enabled; a watchdog, a brake for a tip that is too fast, causes of motors that are off. Which error an unplugged device
//! answers with is an assumption (2, communication), as is that the device has to be opened anew afterwards. Assumed for the
//! worst: motors that have been off and are on again put out what they were told last.
//!
//! `PALPATE_EMULATED_FORCEDIMENSION` names the models that are plugged in (`omega.3`, `omega.6`, `omega.7`, `delta.3`, `sigma.7`,
//! `lambda.7`, `falcon`, by commas), `PALPATE_EMULATED_HAND` leads the hand that holds each.
#![allow(unsafe_code)]
// Functions of C with pointers of their callers.
// Each function is the vendor's of that name; to be called with pointers to what the vendor's documentation says, or null.
#![allow(clippy::missing_safety_doc, missing_docs)]

mod device;
mod models;
mod motion;
mod steering;
mod world;

use std::ffi::{CStr, c_char, c_double, c_int, c_uchar, c_uint, c_ushort};
use std::time::Duration;

use palpate_emulators::conformance::Disturbance;

use crate::world::{last_error, returned, with, world};

/// Numbers of errors.
mod error {
    pub const NONE: i32 = 0;
    pub const COMMUNICATION: i32 = 2;
    pub const NO_DEVICE_FOUND: i32 = 5;
    pub const NOT_AVAILABLE: i32 = 6;
    pub const GEOMETRY: i32 = 8;
    pub const EXPERT_MODE_DISABLED: i32 = 9;
    pub const INVALID_INDEX: i32 = 15;
    pub const NULL_ARGUMENT: i32 = 17;
    pub const NOT_ENABLED: i32 = 19;
    pub const DEVICE_IN_USE: i32 = 20;
    pub const INVALID: i32 = 21;
}

const TEXTS: [&CStr; 23] = [
    c"no error",
    c"undocumented error",
    c"communication error",
    c"controller busy",
    c"no driver found",
    c"no device found",
    c"not available",
    c"timeout",
    c"geometry error",
    c"expert mode disabled",
    c"not implemented",
    c"out of memory",
    c"device not ready",
    c"file not found",
    c"configuration error",
    c"invalid index",
    c"deprecated",
    c"null argument",
    c"redundant encoders disagree",
    c"not enabled",
    c"device in use",
    c"invalid argument",
    c"no regulation",
];

#[unsafe(no_mangle)]
pub extern "system" fn dhdGetDeviceCount() -> c_int {
    world().plugged().len() as c_int
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdGetAvailableCount() -> c_int {
    let world = world();
    world.plugged().into_iter().filter(|rank| !world.devices[*rank].open).count() as c_int
}

/// Ranks count what is plugged in; numbers of open devices stay when another one is unplugged.
#[unsafe(no_mangle)]
pub extern "system" fn dhdOpenID(id: c_char) -> c_int {
    let mut world = world();
    let plugged = world.plugged();
    let wanted = match i8::from_ne_bytes(id.to_ne_bytes()) {
        -1 => plugged.iter().copied().find(|rank| !world.devices[*rank].open),
        rank => usize::try_from(rank).ok().and_then(|rank| plugged.get(rank).copied()),
    };
    returned(match wanted {
        None => Err(error::NO_DEVICE_FOUND),
        Some(rank) if world.devices[rank].open => Err(error::DEVICE_IN_USE),
        Some(rank) => {
            world.devices[rank].open();
            Ok(rank as c_int)
        }
    })
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdOpen() -> c_int {
    dhdOpenID(-1_i8 as c_char)
}

#[unsafe(no_mangle)]
pub extern "system" fn drdOpenID(id: c_char) -> c_int {
    dhdOpenID(id)
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdClose(id: c_char) -> c_int {
    let mut world = world();
    returned(match world.find(id) {
        Some(rank) if world.devices[rank].open => {
            world.devices[rank].close();
            Ok(0)
        }
        _ => Err(error::INVALID_INDEX),
    })
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdStop(id: c_char) -> c_int {
    dhdEnableForce(0, id)
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdEnableForce(on: c_uchar, id: c_char) -> c_int {
    with(id, |device| {
        device.enable(on != 0);
        Ok(0)
    })
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdGetButton(index: c_int, id: c_char) -> c_int {
    with(id, |device| match index {
        0..=31 => Ok((device.buttons >> index & 1) as c_int),
        _ => Err(error::INVALID_INDEX),
    })
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdGetButtonMask(id: c_char) -> c_uint {
    let mut mask = 0;
    with(id, |device| {
        mask = device.buttons;
        Ok(0)
    });
    let mut world = world();
    if world.find(id).is_some_and(|rank| world.devices[rank].nonsense) { world.bits() as c_uint } else { mask }
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdSetGravityCompensation(on: c_int, id: c_char) -> c_int {
    with(id, |device| {
        device.gravity = on != 0;
        Ok(0)
    })
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdSetMaxForce(newtons: c_double, id: c_char) -> c_int {
    with(id, |device| {
        device.max_force = (newtons >= 0.0).then_some(newtons);
        Ok(0)
    })
}

/// -1 where none has been set.
#[unsafe(no_mangle)]
pub extern "system" fn dhdGetMaxForce(id: c_char) -> c_double {
    let world = world();
    world.find(id).and_then(|rank| world.devices[rank].max_force).unwrap_or(-1.0)
}

/// kHz.
#[unsafe(no_mangle)]
pub extern "system" fn dhdGetComFreq(_id: c_char) -> c_double {
    4.0
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdGetSystemType(id: c_char) -> c_int {
    let mut world = world();
    match world.find(id) {
        Some(rank) if world.devices[rank].nonsense => world.bits() as c_int,
        Some(rank) => world.devices[rank].model.system_type,
        None => returned(Err(error::INVALID_INDEX)),
    }
}

/// Each device has its own, whatever else is plugged in.
#[unsafe(no_mangle)]
pub unsafe extern "system" fn dhdGetSerialNumber(serial: *mut c_ushort, id: c_char) -> c_int {
    let mut world = world();
    let number = match world.find(id) {
        Some(rank) if world.devices[rank].nonsense => world.bits() as c_ushort,
        Some(rank) if world.devices[rank].open && !serial.is_null() => 1000 + rank as c_ushort,
        _ => return returned(Err(error::INVALID_INDEX)),
    };
    if serial.is_null() {
        return returned(Err(error::NULL_ARGUMENT));
    }
    // SAFETY: not null, and the caller's number.
    unsafe { serial.write(number) };
    returned(Ok(0))
}

/// Null where there is none.
#[unsafe(no_mangle)]
pub extern "system" fn dhdGetSystemName(id: c_char) -> *const c_char {
    let world = world();
    let device = world.find(id).map(|rank| &world.devices[rank]).filter(|device| !device.nonsense);
    device.map_or(std::ptr::null(), |device| device.model.name.as_ptr())
}

#[unsafe(no_mangle)]
pub unsafe extern "system" fn dhdGetStatus(status: *mut [c_int; 17], id: c_char) -> c_int {
    let mut values = None;
    let mut code = with(id, |device| {
        values = Some(device.status());
        if status.is_null() { Err(error::NULL_ARGUMENT) } else { Ok(0) }
    });
    let mut world = world();
    if world.find(id).is_some_and(|rank| world.devices[rank].nonsense) {
        values = Some(std::array::from_fn(|_| world.bits() as c_int % 7));
        code = 0;
    }
    if let Some(values) = values.filter(|_| code >= 0 && !status.is_null()) {
        // SAFETY: not null, and the caller's array is as long as documented.
        unsafe { status.write(values) };
    }
    code
}

fn asked(id: c_char, what: impl FnOnce(&models::Model) -> bool) -> bool {
    let world = world();
    world.find(id).is_some_and(|rank| what(&world.devices[rank].model))
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdIsLeftHanded(_id: c_char) -> bool {
    false
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdHasWrist(id: c_char) -> bool {
    asked(id, |model| model.wrist)
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdHasActiveWrist(id: c_char) -> bool {
    asked(id, |model| model.active_wrist)
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdHasGripper(id: c_char) -> bool {
    asked(id, |model| model.gripper)
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdErrorGetLast() -> c_int {
    last_error()
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdErrorGetLastStr() -> *const c_char {
    dhdErrorGetStr(last_error())
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdErrorGetStr(code: c_int) -> *const c_char {
    usize::try_from(code).ok().and_then(|code| TEXTS.get(code)).map_or(std::ptr::null(), |text| text.as_ptr())
}

#[unsafe(no_mangle)]
pub unsafe extern "system" fn dhdGetSDKVersion(
    major: *mut c_int,
    minor: *mut c_int,
    release: *mut c_int,
    revision: *mut c_int,
) {
    let old = world().devices.iter().any(|device| device.disturbance == Some(Disturbance::WrongVersion));
    let version = if old { [2, 9, 1, 0] } else { [3, 17, 5, 0] };
    for (place, number) in [major, minor, release, revision].into_iter().zip(version) {
        if !place.is_null() {
            // SAFETY: not null, and the caller's integer.
            unsafe { place.write(number) };
        }
    }
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdEnableExpertMode() -> c_int {
    world().expert = true;
    returned(Ok(0))
}

fn as_expert(id: c_char, act: impl FnOnce(&mut device::Device)) -> c_int {
    if !world().expert {
        return returned(Err(error::EXPERT_MODE_DISABLED));
    }
    with(id, |device| {
        act(device);
        Ok(0)
    })
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdSetTimeGuard(microseconds: c_int, id: c_char) -> c_int {
    as_expert(id, |device| device.timeguard = Duration::from_micros(u64::try_from(microseconds).unwrap_or(0)))
}

/// In steps of 125 microseconds; 0: none.
#[unsafe(no_mangle)]
pub extern "system" fn dhdSetWatchdog(steps: c_uchar, id: c_char) -> c_int {
    as_expert(id, |device| device.watchdog = steps)
}

/// The unit is not documented here: taken as mm/s.
#[unsafe(no_mangle)]
pub extern "system" fn dhdSetVelocityThreshold(threshold: c_uint, id: c_char) -> c_int {
    as_expert(id, |device| device.fastest = 1e-3 * f64::from(threshold))
}
