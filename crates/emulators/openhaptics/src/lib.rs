//! An emulated library of OpenHaptics' HD interface: the documented functions, on devices that do not exist.
//!
//! From the vendor's documentation: one stack of errors for all threads and devices, the newest on top; frames, one a device
//! and tick, which hold measurements still and set the force to zero when they begin; forces that are off until they are
//! enabled, limits after which the amplifiers drop out and ramp back; a scheduler of 1000 Hz with priorities. Assumed: what an
//! unplugged device answers (0x0302, until it is disabled and initialised anew), that amplifiers drop out 20 ms after the last
//! frame, and that calls from other threads while the scheduler runs are errors (0x0102), which the vendor only warns of.
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
    if world.talks_nonsense() && world.bits() % 8 == 0 {
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
pub extern "system" fn hdScheduleAsynchronous(callback: Callback, data: *mut c_void, priority: c_ushort) -> c_ulong {
    if is_servo() {
        // SAFETY: the caller has promised that it may be called with its data.
        if unsafe { callback(data) } == 0 {
            return 0;
        }
    }
    scheduler::add(callback, data, priority)
}

#[unsafe(no_mangle)]
pub extern "system" fn hdScheduleSynchronous(callback: Callback, data: *mut c_void, priority: c_ushort) {
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
