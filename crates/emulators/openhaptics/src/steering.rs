//! Functions by which tests steer the emulated devices; the types are those of `palpate_emulators::vendor`.

use std::ffi::{CStr, c_char};

use palpate_emulators::vendor::{
    MOTORS_LENGTH, MOTORS_OFF, NO_SCHEDULER, NONSENSE, READS_FAIL, TIP_LENGTH, UNCALIBRATED, disturbance,
    tip_of_numbers,
};

use crate::device::Device;
use crate::scheduler;
use crate::world::{World, world};

fn with_device(rank: u32, act: impl FnOnce(&mut Device)) {
    if let Some(device) = world().devices.get_mut(rank as usize) {
        act(device);
    }
}

/// New devices of these models, by commas.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_emulator_reset(models: *const c_char) {
    // SAFETY: by the caller a string.
    let models = unsafe { CStr::from_ptr(models) }.to_string_lossy();
    scheduler::refuse_to_start(false);
    *world() = World::new(&models);
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_emulator_set_tip(rank: u32, numbers: *const [f64; TIP_LENGTH]) {
    // SAFETY: by the caller as many numbers.
    let tip = tip_of_numbers(unsafe { numbers.read() });
    with_device(rank, |device| device.put(tip));
}

#[unsafe(no_mangle)]
pub extern "C" fn palpate_emulator_press(rank: u32, buttons: u32) {
    with_device(rank, |device| device.buttons = buttons);
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_emulator_motors(rank: u32, numbers: *mut [f64; MOTORS_LENGTH]) {
    with_device(rank, |device| {
        let (force, torque) = device.motors();
        let ago = device.told.elapsed().as_secs_f64();
        // SAFETY: by the caller as many numbers.
        unsafe { numbers.write([force.x, force.y, force.z, torque.x, torque.y, torque.z, ago]) };
    });
}

#[unsafe(no_mangle)]
pub extern "C" fn palpate_emulator_disturb(rank: u32, number: u32) {
    scheduler::refuse_to_start(number == NO_SCHEDULER);
    with_device(rank, |device| {
        device.nonsense = number == NONSENSE;
        device.uncalibrated = number == UNCALIBRATED;
        device.reads_fail = number == READS_FAIL;
        device.switch_motors_off(number == MOTORS_OFF);
        device.disturb(disturbance(number));
    });
}

/// Ticks without pauses, or at the rate again.
#[unsafe(no_mangle)]
pub extern "C" fn palpate_emulator_hurry(on: u32) {
    scheduler::hurry(on != 0);
}
