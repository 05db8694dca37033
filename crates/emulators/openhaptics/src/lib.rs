//! An emulated library of OpenHaptics' HD interface: the functions that the driver uses, on devices that do not exist.
//!
//! From the vendor's documentation: one stack of errors for all threads and devices, the newest on top; frames, one a device
//! and tick, which hold measurements still and set the force to zero when they begin; forces that are off until they are
//! enabled, and a largest one beyond which the amplifiers drop out and ramp back; a scheduler of 1000 Hz. Assumed: what an
//! unplugged device answers (0x0302, until it is disabled and initialised anew), that amplifiers drop out 20 ms after the last
//! frame and not when the scheduler stops, and that calls from other threads while the scheduler runs are errors (0x0102),
//! which the vendor only warns of.
//!
//! `PALPATE_EMULATED_OPENHAPTICS` names what is plugged in (`Touch, Left=PHANTOM Omni`), `PALPATE_EMULATED_HAND` leads the hand
//! that holds each.
#![allow(unsafe_code)]
// Functions of C with pointers of their callers.
// Each function is the vendor's of that name; to be called with pointers to what the vendor's documentation says.
#![allow(clippy::missing_safety_doc, missing_docs)]

mod device;
mod library;
mod numbers;
mod scheduler;

use std::ffi::{CStr, c_char, c_double, c_int, c_ulong, c_ushort, c_void};

use glam::DVec3;
use palpate_emulators::conformance::Disturbance;
use palpate_emulators::library::{Random, Steering, World, rotation, steering, world};

use crate::device::{DEFAULT, Device, Snapshot};
use crate::library::ErrorInfo;
use crate::numbers::{INVALID_HANDLE, calibration, capability, error, parameter};
use crate::scheduler::Callback;

/// The functions by which tests steer it.
#[unsafe(no_mangle)]
pub static PALPATE_EMULATOR: Steering = steering::<Device>();

/// The library's axes: x right, y up, z towards the person.
fn to_vendor(v: DVec3) -> DVec3 {
    DVec3::new(v.x, v.z, -v.y)
}

/// Back to right, away, up.
fn from_vendor(v: DVec3) -> DVec3 {
    DVec3::new(v.x, -v.z, v.y)
}

/// Whether the caller may use devices now; else there is an error on the stack.
fn may_call() -> bool {
    let may = scheduler::may_call();
    if !may {
        raise(error::INVALID_OPERATION);
    }
    may
}

/// An error of no device.
fn raise(code: u32) {
    world::<Device>().library.raise(code, INVALID_HANDLE);
}

/// Does something with an initialised device; errors lie on the stack.
fn with<R>(world: &mut World<Device>, handle: u32, act: impl FnOnce(&mut Device) -> Result<R, u32>) -> Option<R> {
    let device = world.devices.get_mut(handle as usize).filter(|device| device.hardware.is_open());
    match device.ok_or(error::BAD_HANDLE).and_then(act) {
        Ok(result) => Some(result),
        Err(code) => {
            world.library.raise(code, handle);
            None
        }
    }
}

/// Does something with the current device.
fn with_current<R>(world: &mut World<Device>, act: impl FnOnce(&mut Device) -> Result<R, u32>) -> Option<R> {
    let current = world.library.current;
    with(world, current, act)
}

/// Whether the current device answers with random numbers.
fn answers_randomly(world: &World<Device>) -> bool {
    let current = world.devices.get(world.library.current as usize);
    current.is_some_and(|device| device.hardware.has(Disturbance::Nonsense))
}

#[unsafe(no_mangle)]
pub unsafe extern "system" fn hdInitDevice(name: *const c_char) -> u32 {
    // SAFETY: by the caller null or a string.
    let name = (!name.is_null()).then(|| unsafe { CStr::from_ptr(name) }.to_string_lossy());
    if !may_call() {
        return INVALID_HANDLE;
    }
    let mut world = world::<Device>();
    let name = name.as_deref().unwrap_or(DEFAULT);
    let found =
        world.devices.iter().position(|device| device.name.to_str() == Ok(name) && device.hardware.is_plugged());
    let Some(rank) = found else {
        world.library.raise(error::DEVICE_FAULT, INVALID_HANDLE);
        return INVALID_HANDLE;
    };
    let handle = rank as u32;
    if world.devices[rank].hardware.is_open() {
        world.library.raise(error::DEVICE_ALREADY_INITIATED, handle);
        return INVALID_HANDLE;
    }
    world.devices[rank].set_initialised(true);
    world.library.current = handle;
    handle
}

#[unsafe(no_mangle)]
pub extern "system" fn hdDisableDevice(handle: u32) {
    if may_call() {
        with(&mut world(), handle, |device| {
            device.set_initialised(false);
            Ok(())
        });
    }
}

#[unsafe(no_mangle)]
pub extern "system" fn hdMakeCurrentDevice(handle: u32) {
    let mut world = world();
    if with(&mut world, handle, |_| Ok(())).is_some() {
        world.library.current = handle;
    }
}

#[unsafe(no_mangle)]
pub extern "system" fn hdEnable(one: u32) {
    with_current(&mut world(), |device| {
        device.force_output |= one == capability::FORCE_OUTPUT;
        if one == capability::FORCE_OUTPUT { Ok(()) } else { Err(error::INVALID_ENUM) }
    });
}

#[unsafe(no_mangle)]
pub extern "system" fn hdBeginFrame(handle: u32) {
    if !may_call() {
        return;
    }
    let tick = scheduler::tick();
    let mut world = world();
    if with(&mut world, handle, |_| Ok(())).is_some() {
        world.library.current = handle;
        with(&mut world, handle, |device| device.begin(tick));
    }
}

#[unsafe(no_mangle)]
pub extern "system" fn hdEndFrame(handle: u32) {
    if may_call() {
        with(&mut world(), handle, |device| device.end(scheduler::PERIOD.as_secs_f64()));
    }
}

/// Writes a value of the current device, or random numbers in its place.
///
/// # Safety
/// As many numbers of the caller as the value has.
unsafe fn get<T>(values: *mut T, of: impl FnOnce(&Device) -> Option<Vec<T>>, random: impl Fn(&mut Random) -> T) {
    let mut world = world();
    let Some(found) = with_current(&mut world, |device| of(device).ok_or(error::INVALID_ENUM)) else { return };
    let nonsense = answers_randomly(&world) && world.random.bits().is_multiple_of(2);
    for (entry, number) in found.into_iter().enumerate() {
        let number = if nonsense { random(&mut world.random) } else { number };
        // SAFETY: by the caller.
        unsafe { values.add(entry).write(number) };
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "system" fn hdGetDoublev(asked: u32, values: *mut c_double) {
    let value = |device: &Device| {
        let Snapshot { tip, .. } = device.snapshot;
        Some(match asked {
            parameter::CURRENT_VELOCITY => (1e3 * to_vendor(tip.velocity)).to_array().to_vec(),
            parameter::CURRENT_ANGULAR_VELOCITY => to_vendor(tip.angular_velocity).to_array().to_vec(),
            parameter::CURRENT_TRANSFORM => transform(device),
            parameter::NOMINAL_MAX_STIFFNESS => vec![0.5],
            parameter::NOMINAL_MAX_FORCE => vec![device.max_force],
            parameter::NOMINAL_MAX_CONTINUOUS_FORCE => vec![0.88],
            _ => return None,
        })
    };
    // SAFETY: by the caller.
    unsafe { get(values, value, |random| random.number(1e3)) };
}

/// Columns of the transform of the tip, one after the other; mm.
fn transform(device: &Device) -> Vec<f64> {
    let tip = device.snapshot.tip;
    let matrix = rotation(tip.orientation, to_vendor, from_vendor);
    let mut place = 1e3 * to_vendor(tip.position);
    if device.hardware.has(Disturbance::NotFinite) {
        place.x = f64::NAN;
    }
    let column = |axis: DVec3, last: f64| axis.extend(last).to_array();
    [column(matrix.x_axis, 0.0), column(matrix.y_axis, 0.0), column(matrix.z_axis, 0.0), column(place, 1.0)].concat()
}

#[unsafe(no_mangle)]
pub unsafe extern "system" fn hdGetIntegerv(asked: u32, values: *mut c_int) {
    let value = |device: &Device| match asked {
        parameter::CURRENT_BUTTONS => Some(vec![device.snapshot.buttons as c_int]),
        parameter::OUTPUT_DOF => Some(vec![if device.has_torque { 6 } else { 3 }]),
        parameter::CALIBRATION_STYLE => Some(vec![calibration::STYLE_INKWELL]),
        _ => None,
    };
    // SAFETY: by the caller.
    unsafe { get(values, value, |random| random.number(1e3) as c_int) };
}

#[unsafe(no_mangle)]
pub unsafe extern "system" fn hdGetBooleanv(asked: u32, values: *mut u8) {
    // Out of the well, as one driver's author has measured it.
    let value = |_: &Device| (asked == parameter::CURRENT_INKWELL_SWITCH).then(|| vec![1]);
    // SAFETY: by the caller.
    unsafe { get(values, value, |random| random.bits() as u8 % 2) };
}

/// Null where there is none.
#[unsafe(no_mangle)]
pub extern "system" fn hdGetString(asked: u32) -> *const c_char {
    let mut world = world::<Device>();
    if answers_randomly(&world) {
        return std::ptr::null();
    }
    let old = world.has(Disturbance::WrongVersion);
    let text = with_current(&mut world, |device| match asked {
        parameter::VERSION if old => Ok(c"2.0.9".as_ptr()),
        parameter::VERSION => Ok(c"3.4.0".as_ptr()),
        parameter::DEVICE_DRIVER_VERSION => Ok(c"4.3".as_ptr()),
        parameter::DEVICE_SERIAL_NUMBER => Ok(c"E0001".as_ptr()),
        parameter::DEVICE_MODEL_TYPE => Ok(device.model.as_ptr()),
        _ => Err(error::INVALID_ENUM),
    });
    text.unwrap_or(std::ptr::null())
}

/// Three numbers, within a frame.
#[unsafe(no_mangle)]
pub unsafe extern "system" fn hdSetDoublev(asked: u32, values: *const [c_double; 3]) {
    // SAFETY: by the caller.
    let vector = from_vendor(DVec3::from_array(unsafe { values.read() }));
    with_current(&mut world(), |device| {
        match asked {
            parameter::CURRENT_FORCE | parameter::CURRENT_TORQUE if !device.is_framed() => return Err(error::FRAME),
            parameter::CURRENT_FORCE => device.commanded.force = vector,
            parameter::CURRENT_TORQUE => device.commanded.torque = 1e-3 * vector,
            _ => return Err(error::INVALID_ENUM),
        }
        Ok(())
    });
}

#[unsafe(no_mangle)]
pub extern "system" fn hdGetError() -> ErrorInfo {
    let mut world = world::<Device>();
    if answers_randomly(&world) && world.random.bits().is_multiple_of(8) {
        let (code, device) = (world.random.bits() as u32 % 0x700, world.random.bits() as u32 % 3);
        return ErrorInfo { code, internal: -1, device };
    }
    world.library.pop()
}

#[unsafe(no_mangle)]
pub extern "system" fn hdGetErrorString(code: u32) -> *const c_char {
    let text = match code {
        0 => c"no error",
        0x0100..=0x01FF => c"invalid call",
        0x0200..=0x02FF => c"limit of force",
        0x0300..=0x03FF => c"error of the device",
        0x0400..=0x04FF => c"error of frames",
        _ => return std::ptr::null(),
    };
    text.as_ptr()
}

#[unsafe(no_mangle)]
pub extern "system" fn hdCheckCalibration() -> u32 {
    let uncalibrated = with_current(&mut world(), |device| Ok(device.hardware.has(Disturbance::Uncalibrated)));
    if uncalibrated == Some(false) { calibration::OK } else { calibration::NEEDS_MANUAL_INPUT }
}

/// A stylus that is not in the inkwell stays uncalibrated.
#[unsafe(no_mangle)]
pub extern "system" fn hdUpdateCalibration(_style: u32) {}

#[unsafe(no_mangle)]
pub extern "system" fn hdScheduleAsynchronous(callback: Callback, data: *mut c_void, _priority: c_ushort) -> c_ulong {
    scheduler::add(callback, data)
}

#[unsafe(no_mangle)]
pub extern "system" fn hdUnschedule(handle: c_ulong) {
    if !scheduler::remove(handle) {
        raise(error::INVALID_OPERATION);
    }
}

#[unsafe(no_mangle)]
pub extern "system" fn hdStartScheduler() {
    if !scheduler::start() {
        raise(error::TIMER);
    }
}

#[unsafe(no_mangle)]
pub extern "system" fn hdStopScheduler() {
    scheduler::stop();
}

#[cfg(test)]
mod tests {
    use palpate_emulators::library::Emulated;

    use super::*;

    fn popped() -> u32 {
        hdGetError().code
    }

    /// A device that is fresh, with forces on.
    fn fresh() -> u32 {
        PALPATE_EMULATOR.reset("Touch");
        // SAFETY: null is the default device.
        let handle = unsafe { hdInitDevice(std::ptr::null()) };
        assert_eq!((handle, popped()), (0, 0));
        assert_eq!(frame(handle, Some([1.0; 3])), [0.0; 3], "forces are off");
        hdEnable(capability::FORCE_OUTPUT);
        handle
    }

    fn frame(handle: u32, force: Option<[f64; 3]>) -> [f64; 3] {
        hdBeginFrame(handle);
        if let Some(force) = force {
            // SAFETY: three numbers.
            unsafe { hdSetDoublev(parameter::CURRENT_FORCE, &force) };
        }
        hdEndFrame(handle);
        to_vendor(world::<Device>().devices[handle as usize].motors().force).to_array()
    }

    /// One test, for the library has one state.
    #[test]
    fn the_rules_that_the_vendor_documents() {
        frames_and_errors();
        limits_and_ramp();
    }

    fn frames_and_errors() {
        let handle = fresh();
        assert_eq!(frame(handle, Some([0.5, 1.0, 0.0])), [0.5, 1.0, 0.0]);
        assert_eq!(frame(handle, None), [0.0; 3], "the force is zero when a frame begins");
        hdEndFrame(handle);
        assert_eq!(popped(), error::ILLEGAL_END);
        // SAFETY: three numbers.
        unsafe { hdSetDoublev(parameter::CURRENT_FORCE, &[1.0; 3]) };
        assert_eq!(popped(), error::FRAME);
        hdBeginFrame(handle);
        hdBeginFrame(handle);
        assert_eq!(popped(), error::ILLEGAL_BEGIN);
        hdEndFrame(handle);
        hdUnschedule(12_345);
        // SAFETY: room for what is asked: nothing.
        unsafe { hdGetIntegerv(parameter::CURRENT_INKWELL_SWITCH, &mut 0) };
        // The newest first.
        assert_eq!((popped(), popped(), popped()), (error::INVALID_ENUM, error::INVALID_OPERATION, 0));
        // SAFETY: null is the default device.
        assert_eq!(unsafe { hdInitDevice(std::ptr::null()) }, INVALID_HANDLE);
        assert_eq!(popped(), error::DEVICE_ALREADY_INITIATED);
        hdMakeCurrentDevice(7);
        assert_eq!(popped(), error::BAD_HANDLE);
    }

    /// 3.3 N, then nothing, and back at 20 N/s: 0.02 N a frame of 1 ms.
    fn limits_and_ramp() {
        let handle = fresh();
        assert_eq!(frame(handle, Some([4.0, 0.0, 0.0])), [0.0; 3]);
        assert_eq!(popped(), error::EXCEEDED_MAX_FORCE);
        let forces: Vec<f64> = (0..400).map(|_| frame(handle, Some([1.0, 0.0, 0.0]))[0]).collect();
        assert_eq!(forces[0], 0.0);
        assert!((forces[33] - 33.0 * 0.02 / 3.3).abs() < 1e-9, "{}", forces[33]);
        assert_eq!(forces[399], 1.0);
        assert_eq!(popped(), 0);
    }
}
