//! An emulated library of OpenHaptics' HD interface: the documented functions, on devices that do not exist.
//!
//! From the vendor's documentation: one stack of errors for all threads and devices, the newest on top; frames, one a device
//! and tick, which hold measurements still and set the force to zero when they begin; forces that are off until they are
//! enabled, limits after which the amplifiers drop out and ramp back; a scheduler of 1000 Hz with priorities. Assumed: what an
//! unplugged device answers (0x0302, until it is disabled and initialised anew), that amplifiers drop out 20 ms after the last
//! frame and not when the scheduler stops, and that calls from other threads while the scheduler runs are errors (0x0102),
//! which the vendor only warns of.
//!
//! `PALPATE_EMULATED_OPENHAPTICS` names what is plugged in (`Touch, Left=PHANTOM Omni`), `PALPATE_EMULATED_HAND` leads the hand
//! that holds each.
#![allow(unsafe_code)]
// Functions of C with pointers of their callers.
// Each function is the vendor's of that name; to be called with pointers to what the vendor's documentation says, or null.
#![allow(clippy::missing_safety_doc, missing_docs)]

mod device;
mod frames;
mod numbers;
mod scheduler;
mod steering;
mod values;
mod world;

use std::ffi::{CStr, c_char, c_double, c_ulong, c_ushort, c_void};

use crate::numbers::{INVALID_HANDLE, calibration, capability, error};
use crate::scheduler::{Callback, is_running, is_servo};
use crate::world::{ErrorInfo, world};

/// Whether the caller may use devices now; else it is told by the stack.
fn may_call() -> bool {
    let may = is_servo() || !is_running();
    if !may {
        world().raise(error::INVALID_OPERATION, INVALID_HANDLE);
    }
    may
}

#[unsafe(no_mangle)]
pub unsafe extern "system" fn hdInitDevice(name: *const c_char) -> u32 {
    // SAFETY: by the caller null or a string.
    let name = (!name.is_null()).then(|| unsafe { CStr::from_ptr(name) }.to_string_lossy());
    if !may_call() {
        return INVALID_HANDLE;
    }
    let mut world = world();
    let found = world.named(name.as_deref());
    let Some(handle) = found.filter(|handle| world.devices[*handle as usize].is_plugged()) else {
        world.raise(error::DEVICE_FAULT, INVALID_HANDLE);
        return INVALID_HANDLE;
    };
    if world.devices[handle as usize].initialised {
        world.raise(error::DEVICE_ALREADY_INITIATED, handle);
        return INVALID_HANDLE;
    }
    world.devices[handle as usize].initialise();
    world.current = handle;
    handle
}

#[unsafe(no_mangle)]
pub extern "system" fn hdDisableDevice(handle: u32) {
    if may_call()
        && let Some(device) = world().find(handle)
    {
        device.disable();
    }
}

#[unsafe(no_mangle)]
pub extern "system" fn hdMakeCurrentDevice(handle: u32) {
    let mut world = world();
    if world.find(handle).is_some() {
        world.current = handle;
    }
}

#[unsafe(no_mangle)]
pub extern "system" fn hdGetCurrentDevice() -> u32 {
    world().current
}

#[unsafe(no_mangle)]
pub extern "system" fn hdEnable(one: u32) {
    switch(one, true);
}

#[unsafe(no_mangle)]
pub extern "system" fn hdDisable(one: u32) {
    switch(one, false);
}

fn switch(one: u32, on: bool) {
    let mut world = world();
    let handle = world.current;
    if !capability::ALL.contains(&one) {
        return world.raise(error::INVALID_ENUM, handle);
    }
    if let Some(device) = world.current() {
        device.enabled.retain(|other| *other != one);
        if on {
            device.enabled.push(one);
        }
    }
}

#[unsafe(no_mangle)]
pub extern "system" fn hdIsEnabled(one: u32) -> u8 {
    world().current().is_some_and(|device| device.is_enabled(one)).into()
}

#[unsafe(no_mangle)]
pub extern "system" fn hdGetError() -> ErrorInfo {
    let mut world = world();
    if world.talks_nonsense() && world.bits().is_multiple_of(8) {
        let (code, device) = (world.bits() as u32 % 0x700, world.bits() as u32 % 3);
        return ErrorInfo { code, internal: -1, device };
    }
    world.pop()
}

#[unsafe(no_mangle)]
pub extern "system" fn hdGetErrorString(code: u32) -> *const c_char {
    let text = match code {
        0 => c"no error",
        0x0100..=0x01FF => c"invalid call",
        0x0200..=0x02FF => c"limit of force",
        0x0300..=0x03FF => c"error of the device",
        0x0400..=0x04FF => c"error of frames",
        0x0500..=0x05FF => c"error of the scheduler",
        0x0600 => c"no licence",
        _ => return std::ptr::null(),
    };
    text.as_ptr()
}

#[unsafe(no_mangle)]
pub extern "system" fn hdCheckCalibration() -> u32 {
    let mut world = world();
    match world.current() {
        Some(device) if device.uncalibrated => calibration::NEEDS_MANUAL_INPUT,
        Some(_) => calibration::OK,
        None => calibration::NEEDS_MANUAL_INPUT,
    }
}

/// A stylus that is not in the inkwell stays uncalibrated.
#[unsafe(no_mangle)]
pub extern "system" fn hdUpdateCalibration(_style: u32) {}

#[unsafe(no_mangle)]
pub unsafe extern "system" fn hdScheduleAsynchronous(
    callback: Callback,
    data: *mut c_void,
    priority: c_ushort,
) -> c_ulong {
    if is_servo() {
        // SAFETY: the caller has promised that it may be called with its data.
        if unsafe { callback(data) } == 0 {
            return 0;
        }
    }
    scheduler::add(callback, data, priority)
}

#[unsafe(no_mangle)]
pub unsafe extern "system" fn hdScheduleSynchronous(callback: Callback, data: *mut c_void, priority: c_ushort) {
    if is_servo() || !is_running() {
        // SAFETY: as above.
        while unsafe { callback(data) } != 0 {}
        return;
    }
    let handle = scheduler::add(callback, data, priority);
    while scheduler::is_scheduled(handle) && is_running() {
        std::thread::yield_now();
    }
}

#[unsafe(no_mangle)]
pub extern "system" fn hdUnschedule(handle: c_ulong) {
    if !scheduler::remove(handle) {
        world().raise(error::INVALID_OPERATION, INVALID_HANDLE);
    }
}

/// Waits for a callback to be done, or says whether it still is called.
#[unsafe(no_mangle)]
pub extern "system" fn hdWaitForCompletion(handle: c_ulong, code: u32) -> u8 {
    while code == 1 && scheduler::is_scheduled(handle) && is_running() && !is_servo() {
        std::thread::yield_now();
    }
    scheduler::is_scheduled(handle).into()
}

#[unsafe(no_mangle)]
pub extern "system" fn hdStartScheduler() {
    scheduler::start();
}

#[unsafe(no_mangle)]
pub extern "system" fn hdStopScheduler() {
    scheduler::stop();
}

#[unsafe(no_mangle)]
pub extern "system" fn hdSetSchedulerRate(hertz: c_ulong) {
    if !scheduler::set_rate(hertz) {
        world().raise(error::INVALID_VALUE, INVALID_HANDLE);
    }
}

#[unsafe(no_mangle)]
pub extern "system" fn hdGetSchedulerTimeStamp() -> c_double {
    scheduler::since_tick()
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};

    use super::frames::{hdBeginFrame, hdEndFrame};
    use super::numbers::parameter;
    use super::steering::{palpate_emulator_hurry, palpate_emulator_reset};
    use super::values::{hdGetDoublev, hdGetIntegerv, hdSetDoublev, hdSetLongv};
    use super::*;

    fn popped() -> u32 {
        hdGetError().code
    }

    /// A device that is fresh, with forces on.
    fn fresh() -> u32 {
        // SAFETY: a string.
        unsafe { palpate_emulator_reset(c"Touch".as_ptr()) };
        // SAFETY: null is the default device.
        let handle = unsafe { hdInitDevice(std::ptr::null()) };
        assert_eq!((handle, popped()), (0, 0));
        assert_eq!(hdIsEnabled(capability::FORCE_OUTPUT), 0);
        hdEnable(capability::FORCE_OUTPUT);
        handle
    }

    fn frame(handle: u32, force: Option<[f64; 3]>) -> [f64; 3] {
        hdBeginFrame(handle);
        if let Some(force) = force {
            // SAFETY: three numbers.
            unsafe { hdSetDoublev(parameter::CURRENT_FORCE, force.as_ptr()) };
        }
        hdEndFrame(handle);
        let (force, _) = world().devices[handle as usize].motors();
        device::to_vendor(force).to_array()
    }

    /// One test, for the library has one state.
    #[test]
    fn the_rules_that_the_vendor_documents() {
        frames_and_errors();
        limits_and_ramp();
        callbacks_by_priority();
    }

    fn frames_and_errors() {
        let handle = fresh();
        assert_eq!(frame(handle, Some([0.5, 1.0, 0.0])), [0.5, 1.0, 0.0]);
        assert_eq!(frame(handle, None), [0.0; 3], "the force is zero when a frame begins");
        hdEndFrame(handle);
        assert_eq!(popped(), error::ILLEGAL_END);
        // SAFETY: three numbers; so below.
        unsafe { hdSetDoublev(parameter::CURRENT_FORCE, [1.0; 3].as_ptr()) };
        assert_eq!(popped(), error::FRAME);
        hdBeginFrame(handle);
        hdBeginFrame(handle);
        assert_eq!(popped(), error::ILLEGAL_BEGIN);
        // SAFETY: as above.
        unsafe { hdSetDoublev(parameter::CURRENT_FORCE, [1.0; 3].as_ptr()) };
        hdSetLongv(parameter::CURRENT_MOTOR_DAC_VALUES, std::ptr::null());
        hdEndFrame(handle);
        assert_eq!(popped(), error::FORCE_ERROR);
        let mut number = 0;
        // SAFETY: room for what is asked.
        unsafe { hdGetIntegerv(parameter::CURRENT_INKWELL_SWITCH, &mut number) };
        // SAFETY: as above.
        unsafe { hdGetDoublev(0x1234, &mut 0.0) };
        // The newest first.
        assert_eq!((popped(), popped(), popped()), (error::INVALID_ENUM, error::INVALID_INPUT_TYPE, 0));
        // SAFETY: as above.
        assert_eq!(unsafe { hdInitDevice(std::ptr::null()) }, INVALID_HANDLE);
        assert_eq!(popped(), error::DEVICE_ALREADY_INITIATED);
        hdMakeCurrentDevice(7);
        assert_eq!(popped(), error::BAD_HANDLE);
        hdUnschedule(12_345);
        assert_eq!(popped(), error::INVALID_OPERATION);
        hdSetSchedulerRate(1234);
        assert_eq!(popped(), error::INVALID_VALUE);
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
        hdEnable(capability::MAX_FORCE_CLAMPING);
        assert!((frame(handle, Some([4.0, 0.0, 0.0]))[0] - 3.3).abs() < 1e-12);
        assert_eq!(popped(), 0);
    }

    static CALLS: AtomicU32 = AtomicU32::new(0);

    /// Writes its number down behind the others; done from the third tick on.
    unsafe extern "system" fn note(number: *mut c_void) -> u32 {
        let before = CALLS.load(Ordering::Relaxed);
        CALLS.store(10 * before + number as u32, Ordering::Relaxed);
        u32::from(before < 1_000)
    }

    fn callbacks_by_priority() {
        CALLS.store(0, Ordering::Relaxed);
        // SAFETY: the callback reads its pointer as a number; so below.
        let low = unsafe { hdScheduleAsynchronous(note, std::ptr::without_provenance_mut(1), 10) };
        // SAFETY: as above.
        unsafe { hdScheduleAsynchronous(note, std::ptr::without_provenance_mut(2), 60_000) };
        palpate_emulator_hurry(1);
        hdStartScheduler();
        hdWaitForCompletion(low, 1);
        hdStopScheduler();
        palpate_emulator_hurry(0);
        // Three ticks, in each the one of the higher priority first.
        assert_eq!(CALLS.load(Ordering::Relaxed), 212_121);
    }
}
