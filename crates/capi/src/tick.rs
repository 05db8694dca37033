//! A tick from the program's own thread or a device's callback.
#![allow(unsafe_code)] // called from C with raw pointers
#![allow(clippy::missing_safety_doc)] // palpate.h states at its top what holds for all pointers

use palpate_devices::{Buttons, Reading, Twist, Wrench};

use crate::arguments::{array, array_mut, require_count, shared};
use crate::force_loop::{Loop, pose, running};
use crate::status::{Outcome, Refusal, Status, catching_panics};

/// Of palpate_reading.buttons: the tool holds on to what it touches.
pub const PALPATE_BUTTON_GRAB: u32 = 1;

/// What a device says at a tick. Never grows.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct DeviceReading {
    /// Of the tip, m, in the world.
    pub position: [f64; 3],
    /// World from tool, a unit quaternion w x y z; four zeros for a device that does not turn.
    pub orientation: [f64; 4],
    /// Of the tip, m/s, in the world.
    pub velocity: [f64; 3],
    /// Angular velocity, rad/s, in the world.
    pub angular_velocity: [f64; 3],
    /// When the device measured this, ns, by any clock that only goes forward; 0 for the time of the tick. A tool whose
    /// time stands still for 50 ms while it is in the scene is a fault.
    pub timestamp_ns: u64,
    /// PALPATE_BUTTON_...
    pub buttons: u32,
    /// Whether the tool is in the scene: 0 or 1.
    pub active: u32,
}

/// Force and torque. Never grows.
#[repr(C)]
#[derive(Clone, Copy, Default)]
pub struct DeviceWrench {
    /// N, in the world.
    pub force: [f64; 3],
    /// About the tip, N m, in the world.
    pub torque: [f64; 3],
}

/// Refuses devices that cannot be ticked with a time `period` between two ticks, s: ask once, before the first tick.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_check_period(force_loop: *const Loop, period: f64) -> Status {
    catching_panics(|| {
        require_period(period)?;
        // SAFETY: the caller's pointer.
        unsafe { shared(force_loop, "loop") }?.frame().check_period(period)?;
        Ok(())
    })
}

/// One tick: takes the readings of all tools, in the order in which they were added to the scene, and gives the wrenches on
/// their devices, made safe. `now_ns` is the time for which it is due, by palpate_now_ns; `period` the time between two
/// ticks, s. For a device's callback: it never allocates, locks, waits or does files; only a refused call keeps a message.
///
/// Returns PALPATE_OK, or PALPATE_FAULT where a fault has latched: palpate_loop_get_frame tells which. The tools that it
/// concerns have no wrench then; after a refused call no tool has one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_tick(
    force_loop: *mut Loop,
    now_ns: u64,
    period: f64,
    readings: *const DeviceReading,
    wrenches: *mut DeviceWrench,
    tools: usize,
) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointers.
        let wrenches = unsafe { array_mut(wrenches, tools, "wrenches") }?;
        // Not one of an earlier tick, whatever happens below.
        wrenches.fill(DeviceWrench::default());
        require_period(period)?;
        // SAFETY: the caller's pointers.
        let (own, readings) = unsafe { (shared(force_loop, "loop")?, array(readings, tools, "readings")?) };
        let mut side = own.try_tick()?;
        let side = &mut *side;
        require_count("tools", tools, side.ends.len())?;
        let force_loop = side.force_loop.as_mut().ok_or_else(running)?;
        for (end, input) in side.ends.iter_mut().zip(readings) {
            end.set_reading(reading(input, now_ns));
        }
        force_loop.tick(now_ns, period);
        for (end, to) in side.ends.iter_mut().zip(wrenches) {
            let Wrench { force, torque } = end.take();
            *to = DeviceWrench { force: force.to_array(), torque: torque.to_array() };
        }
        Ok(if force_loop.fault().is_some() { Status::PalpateFault } else { Status::PalpateOk })
    })
}

fn reading(input: &DeviceReading, now_ns: u64) -> Reading {
    Reading {
        pose: pose(input.position, input.orientation),
        twist: Twist { linear: input.velocity.into(), angular: input.angular_velocity.into() },
        buttons: Buttons(input.buttons),
        active: input.active != 0,
        timestamp_ns: if input.timestamp_ns == 0 { now_ns } else { input.timestamp_ns },
    }
}

fn require_period(period: f64) -> Outcome {
    if period > 0.0 && period.is_finite() {
        return Ok(());
    }
    Err(Refusal::argument(format!("period is {period} s, it must be positive")))
}
