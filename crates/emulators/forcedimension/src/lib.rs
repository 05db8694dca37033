//! An emulated library of Force Dimension's DHD: the functions that the driver uses, on devices that do not exist.
//!
//! From the vendor's documentation: results below zero are errors, told apart by the calling thread's last error, 1 is
//! a measurement that is repeated because it was asked for too early; no forces before they are enabled; a watchdog; causes of
//! motors that are off. Which error an unplugged device answers with is an assumption (2, communication), as is that the device
//! has to be opened anew afterwards. Assumed for the worst: motors that have been off and are on again put out the latest
//! command, and motors put out a command of any size.
//!
//! `PALPATE_EMULATED_FORCEDIMENSION` names the models that are plugged in (`omega.3`, `omega.6`, `omega.7`, `delta.3`, `sigma.7`,
//! `lambda.7`, `falcon`, by commas), `PALPATE_EMULATED_HAND` leads the hand that holds each.
#![allow(unsafe_code)]
// Functions of C with pointers of their callers.
// Each function is the vendor's of that name; to be called with pointers to what the vendor's documentation says.
#![allow(clippy::missing_safety_doc, missing_docs)]

mod device;
mod error;
mod models;

use std::cell::Cell;
use std::ffi::{CStr, c_char, c_double, c_int, c_uchar, c_uint, c_ushort};

use glam::DVec3;
use palpate_devices::Wrench;
use palpate_emulators::conformance::Disturbance;
use palpate_emulators::library::{Steering, World, rotation, steering, world};

use crate::device::Device;

/// The values are those of the last call.
const TIMEGUARD: c_int = 1;

/// The functions by which tests steer it.
#[unsafe(no_mangle)]
pub static PALPATE_EMULATOR: Steering = steering::<Device>();

thread_local! {
    static LAST_ERROR: Cell<c_int> = const { Cell::new(error::NONE) };
}

/// What a call returns; its error is kept for the thread.
fn returned(result: Result<c_int, c_int>) -> c_int {
    LAST_ERROR.set(result.err().unwrap_or(error::NONE));
    result.unwrap_or(-1)
}

/// The library's axes: x towards the person, y right, z up.
fn to_vendor(v: DVec3) -> DVec3 {
    DVec3::new(-v.y, v.x, v.z)
}

/// Back to right, away, up.
fn from_vendor(v: DVec3) -> DVec3 {
    DVec3::new(v.y, -v.x, v.z)
}

/// The device of a number.
fn find(world: &mut World<Device>, id: c_char) -> Option<&mut Device> {
    let rank = usize::try_from(i8::from_ne_bytes(id.to_ne_bytes())).ok()?;
    world.devices.get_mut(rank)
}

/// Something with an open device.
fn with(id: c_char, act: impl FnOnce(&mut Device) -> Result<c_int, c_int>) -> c_int {
    let mut world = world();
    returned(match find(&mut world, id) {
        Some(device) => device.begin_call().and_then(|()| act(device)),
        None => Err(error::INVALID_INDEX),
    })
}

/// A fact of a device, or one by random bits.
fn fact<R>(id: c_char, of: impl FnOnce(&Device) -> R, random: impl FnOnce(u64) -> R) -> Option<R> {
    let mut world = world();
    let fact = of(find(&mut world, id)?);
    let nonsense = find(&mut world, id)?.hardware.has(Disturbance::Nonsense);
    Some(if nonsense { random(world.random.bits()) } else { fact })
}

/// Random numbers in the place of these, and a random result, if the device talks nonsense.
fn randomize_if_disturbed(id: c_char, code: c_int, values: &mut [f64]) -> c_int {
    let mut world = world();
    if !find(&mut world, id).is_some_and(|device| device.hardware.has(Disturbance::Nonsense)) {
        return code;
    }
    values.fill_with(|| world.random.number(1.0));
    [0, 0, 0, 1, 2, -1, i32::MIN, i32::MAX][world.random.bits() as usize % 8]
}

/// Numbers of an open device and the call's result.
fn measured<const N: usize>(
    id: c_char,
    of: impl FnOnce(&mut Device) -> Result<([f64; N], c_int), c_int>,
) -> (c_int, [f64; N]) {
    let mut values = [0.0; N];
    let code = with(id, |device| {
        let code;
        (values, code) = of(device)?;
        Ok(code)
    });
    (randomize_if_disturbed(id, code, &mut values), values)
}

/// Writes what was measured, unless the call has failed.
///
/// # Safety
/// Pointers to numbers of the caller.
unsafe fn put<const N: usize>(places: [*mut c_double; N], (code, values): (c_int, [f64; N])) -> c_int {
    if code >= 0 {
        // SAFETY: by the caller.
        places.into_iter().zip(values).for_each(|(place, value)| unsafe { place.write(value) });
    }
    code
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdGetDeviceCount() -> c_int {
    world::<Device>().devices.iter().filter(|device| device.hardware.is_plugged()).count() as c_int
}

/// Ranks count what is plugged in; numbers of open devices stay when another one is unplugged.
#[unsafe(no_mangle)]
pub extern "system" fn dhdOpenID(id: c_char) -> c_int {
    let mut world = world::<Device>();
    let mut plugged = (0..world.devices.len()).filter(|rank| world.devices[*rank].hardware.is_plugged());
    let wanted = usize::try_from(i8::from_ne_bytes(id.to_ne_bytes())).ok().and_then(|rank| plugged.nth(rank));
    returned(match wanted {
        None => Err(error::NO_DEVICE_FOUND),
        Some(rank) if world.devices[rank].hardware.is_open() => Err(error::DEVICE_IN_USE),
        Some(rank) => {
            world.devices[rank].open();
            Ok(rank as c_int)
        }
    })
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdClose(id: c_char) -> c_int {
    let mut world = world();
    returned(match find(&mut world, id).filter(|device| device.hardware.is_open()) {
        Some(device) => {
            device.close();
            Ok(0)
        }
        None => Err(error::INVALID_INDEX),
    })
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdEnableForce(on: c_uchar, id: c_char) -> c_int {
    with(id, |device| {
        device.enable(on != 0);
        Ok(0)
    })
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdSetGravityCompensation(_on: c_int, id: c_char) -> c_int {
    with(id, |_| Ok(0))
}

#[unsafe(no_mangle)]
pub unsafe extern "system" fn dhdGetPosition(
    x: *mut c_double,
    y: *mut c_double,
    z: *mut c_double,
    id: c_char,
) -> c_int {
    let position = measured(id, |device| {
        let (tip, repeated) = device.measure()?;
        let mut position = to_vendor(tip.position);
        if device.hardware.has(Disturbance::NotFinite) {
            position.y = f64::NAN;
        }
        Ok((position.to_array(), if repeated { TIMEGUARD } else { 0 }))
    });
    // SAFETY: by the caller.
    unsafe { put([x, y, z], position) }
}

#[unsafe(no_mangle)]
pub unsafe extern "system" fn dhdGetLinearVelocity(
    x: *mut c_double,
    y: *mut c_double,
    z: *mut c_double,
    id: c_char,
) -> c_int {
    let velocity = measured(id, |device| Ok((to_vendor(device.latest()?.velocity).to_array(), 0)));
    // SAFETY: by the caller.
    unsafe { put([x, y, z], velocity) }
}

#[unsafe(no_mangle)]
pub unsafe extern "system" fn dhdGetAngularVelocityRad(
    x: *mut c_double,
    y: *mut c_double,
    z: *mut c_double,
    id: c_char,
) -> c_int {
    let velocity = measured(id, |device| Ok((to_vendor(device.latest()?.angular_velocity).to_array(), 0)));
    // SAFETY: by the caller.
    unsafe { put([x, y, z], velocity) }
}

/// Nine numbers, row by row.
#[unsafe(no_mangle)]
pub unsafe extern "system" fn dhdGetOrientationFrame(matrix: *mut [c_double; 9], id: c_char) -> c_int {
    let rows = measured(id, |device| {
        Ok((rotation(device.latest()?.orientation, to_vendor, from_vendor).transpose().to_cols_array(), 0))
    });
    // SAFETY: by the caller.
    unsafe { put(std::array::from_fn(|entry| matrix.cast::<c_double>().wrapping_add(entry)), rows) }
}

fn command(id: c_char, force: DVec3, torque: DVec3) -> c_int {
    let wrench = Wrench { force: from_vendor(force), torque: from_vendor(torque) };
    let code = with(id, |device| device.command(wrench).map(|()| 0));
    randomize_if_disturbed(id, code, &mut [])
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdSetForce(x: c_double, y: c_double, z: c_double, id: c_char) -> c_int {
    command(id, DVec3::new(x, y, z), DVec3::ZERO)
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdSetForceAndTorque(
    x: c_double,
    y: c_double,
    z: c_double,
    about_x: c_double,
    about_y: c_double,
    about_z: c_double,
    id: c_char,
) -> c_int {
    command(id, DVec3::new(x, y, z), DVec3::new(about_x, about_y, about_z))
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdGetButtonMask(id: c_char) -> c_uint {
    fact(id, |device| device.hardware.buttons, |bits| bits as u32).unwrap_or(0)
}

/// No limit has been set.
#[unsafe(no_mangle)]
pub extern "system" fn dhdGetMaxForce(_id: c_char) -> c_double {
    -1.0
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdGetSystemType(id: c_char) -> c_int {
    fact(id, |device| device.model.system_type, |bits| bits as c_int).unwrap_or(-1)
}

/// Each device has its own, whatever else is plugged in.
#[unsafe(no_mangle)]
pub unsafe extern "system" fn dhdGetSerialNumber(serial: *mut c_ushort, id: c_char) -> c_int {
    let Some(number) = fact(id, |_| 1000 + id as c_ushort, |bits| bits as c_ushort) else {
        return returned(Err(error::INVALID_INDEX));
    };
    // SAFETY: by the caller.
    unsafe { serial.write(number) };
    returned(Ok(0))
}

/// Null where there is none.
#[unsafe(no_mangle)]
pub extern "system" fn dhdGetSystemName(id: c_char) -> *const c_char {
    fact(id, |device| device.model.name.as_ptr(), |_| std::ptr::null()).unwrap_or(std::ptr::null())
}

#[unsafe(no_mangle)]
pub unsafe extern "system" fn dhdGetStatus(status: *mut [c_int; 17], id: c_char) -> c_int {
    let code = with(id, |_| Ok(0));
    let random = |bits: u64| std::array::from_fn(|entry| bits.rotate_left(3 * entry as u32) as c_int % 7);
    let nonsense = fact(id, |device| device.hardware.has(Disturbance::Nonsense), |_| true) == Some(true);
    let Some(values) = fact(id, Device::status, random).filter(|_| code >= 0 || nonsense) else { return code };
    // SAFETY: by the caller.
    unsafe { status.write(values) };
    0
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdHasWrist(id: c_char) -> bool {
    find(&mut world(), id).is_some_and(|device| device.model.wrist)
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdHasActiveWrist(id: c_char) -> bool {
    find(&mut world(), id).is_some_and(|device| device.model.active_wrist)
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdErrorGetLast() -> c_int {
    LAST_ERROR.get()
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdErrorGetStr(code: c_int) -> *const c_char {
    let text: &CStr = match code {
        error::NONE => c"no error",
        error::COMMUNICATION => c"communication error",
        error::NO_DEVICE_FOUND => c"no device found",
        error::NOT_AVAILABLE => c"not available",
        error::GEOMETRY => c"geometry error",
        error::EXPERT_MODE_DISABLED => c"expert mode disabled",
        error::INVALID_INDEX => c"invalid index",
        error::NOT_ENABLED => c"not enabled",
        error::DEVICE_IN_USE => c"device in use",
        error::INVALID => c"invalid argument",
        _ => return std::ptr::null(),
    };
    text.as_ptr()
}

#[unsafe(no_mangle)]
pub unsafe extern "system" fn dhdGetSDKVersion(
    major: *mut c_int,
    minor: *mut c_int,
    release: *mut c_int,
    revision: *mut c_int,
) {
    let old = world::<Device>().has(Disturbance::WrongVersion);
    let version = if old { [2, 9, 1, 0] } else { [3, 17, 5, 0] };
    for (place, number) in [major, minor, release, revision].into_iter().zip(version) {
        // SAFETY: by the caller.
        unsafe { place.write(number) };
    }
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdEnableExpertMode() -> c_int {
    world::<Device>().library.expert = true;
    returned(Ok(0))
}

/// In steps of 125 microseconds; 0: none.
#[unsafe(no_mangle)]
pub extern "system" fn dhdSetWatchdog(steps: c_uchar, id: c_char) -> c_int {
    if !world::<Device>().library.expert {
        return returned(Err(error::EXPERT_MODE_DISABLED));
    }
    with(id, |device| {
        device.watchdog = steps;
        Ok(0)
    })
}
