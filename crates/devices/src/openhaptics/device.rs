//! Reading and writing of a device in the tick: `read` begins the device's frame, `write` ends it.

use std::sync::Arc;

use glam::{DMat3, DQuat, DVec3};

use super::errors::fault;
use super::ffi::{Handle, error, parameter};
use super::library::Hd;
use super::scheduler::{HdScheduler, Slot};
use crate::frame::rotation;
use crate::{Buttons, Device, DeviceFault, DeviceLimits, Frame, Pose, Reading, Twist, Wrench};

const FRAME: Frame = Frame::RightUpTowards;

/// Millimetres of the library to metres; its millinewton metres of torque to newton metres just so.
const MILLI: f64 = 1e-3;

/// Longest time between two ticks of the library's scheduler after which its measurements are trusted, ns: the library does
/// not tell how old they are.
const STALE_AFTER_NS: u64 = 100_000_000;

/// An open device. When it is dropped its motors are off.
pub struct TouchDevice {
    hd: Hd,
    scheduler: &'static HdScheduler,
    slot: Arc<Slot>,
    /// Its frame has begun and not ended.
    framed: bool,
    read_ns: Option<u64>,
}

impl TouchDevice {
    pub fn new(scheduler: &'static HdScheduler, slot: Arc<Slot>) -> Self {
        Self { hd: scheduler.hd, scheduler, slot, framed: false, read_ns: None }
    }

    /// The device's number, where it may be used.
    fn handle(&self) -> Result<Handle, DeviceFault> {
        if self.scheduler.is_suspended() {
            return Err(DeviceFault::Disconnected);
        }
        if !self.scheduler.is_ticking() {
            // Another thread than the library's: it would break the frames of this one.
            return Err(DeviceFault::Stale);
        }
        self.slot.handle().ok_or(DeviceFault::Disconnected)
    }

    fn begin(&mut self, handle: Handle) {
        if !self.framed {
            self.hd.begin_frame(handle);
            self.framed = true;
        }
    }

    /// Ends a frame that has begun, without a force, of a device that may be gone and may still hear.
    fn end_without_force(&mut self) {
        if std::mem::take(&mut self.framed)
            && self.scheduler.is_ticking()
            && let Some(handle) = self.slot.last_handle()
        {
            self.end(handle);
            self.scheduler.errors(handle);
        }
    }

    fn end(&mut self, handle: Handle) {
        self.hd.end_frame(handle);
        self.framed = false;
        self.slot.note_frame();
    }

    /// The first error since the last call.
    fn check(&self, handle: Handle) -> Result<(), DeviceFault> {
        let own = self.scheduler.errors(handle);
        let Some(code) = self.slot.take_foreign_error().or(own) else { return Ok(()) };
        let fault = fault(code);
        if fault == DeviceFault::Disconnected && code != error::SUCCESS {
            self.slot.mark_lost();
        }
        Err(fault)
    }

    fn measure(&self, now_ns: u64) -> Reading {
        let hd = self.hd;
        let transform: [f64; 16] = hd.doubles(parameter::CURRENT_TRANSFORM);
        let position = DVec3::new(transform[12], transform[13], transform[14]);
        let velocity = DVec3::from_array(hd.doubles(parameter::CURRENT_VELOCITY));
        let angular = DVec3::from_array(hd.doubles(parameter::CURRENT_ANGULAR_VELOCITY));
        Reading {
            pose: Pose {
                position: MILLI * FRAME.to_palpate(position),
                orientation: FRAME.orientation_to_palpate(orientation(&transform)),
            },
            twist: Twist { linear: MILLI * FRAME.to_palpate(velocity), angular: FRAME.to_palpate(angular) },
            buttons: Buttons(hd.integer(parameter::CURRENT_BUTTONS) as u32),
            active: true,
            timestamp_ns: now_ns,
        }
    }
}

/// Rotation of a transform whose columns lie one after the other; not a number if it is none.
fn orientation(transform: &[f64; 16]) -> DQuat {
    let column = |first: usize| DVec3::new(transform[first], transform[first + 1], transform[first + 2]);
    rotation(DMat3::from_cols(column(0), column(4), column(8)))
}

impl Device for TouchDevice {
    fn name(&self) -> &str {
        &self.slot.traits.name
    }

    fn read(&mut self, now_ns: u64, _period: f64) -> Result<Reading, DeviceFault> {
        let handle = match self.handle() {
            Ok(handle) => handle,
            Err(fault) => {
                self.end_without_force();
                return Err(fault);
            }
        };
        let late = self.read_ns.is_some_and(|last_ns| now_ns.saturating_sub(last_ns) > STALE_AFTER_NS);
        self.read_ns = Some(now_ns);
        self.begin(handle);
        let reading = self.measure(now_ns);
        self.check(handle)?;
        let Reading { pose, twist, .. } = reading;
        if !pose.is_finite() || !twist.linear.is_finite() || !twist.angular.is_finite() {
            return Err(DeviceFault::NotFinite);
        }
        if late { Err(DeviceFault::Stale) } else { Ok(reading) }
    }

    fn write(&mut self, wrench: Wrench) -> Result<(), DeviceFault> {
        let handle = match self.handle() {
            Ok(handle) => handle,
            // The scheduler is stopped and the motors are off, or the device is gone.
            Err(fault) => {
                self.end_without_force();
                return if wrench == Wrench::default() { Ok(()) } else { Err(fault) };
            }
        };
        let Wrench { force, torque } = wrench;
        let finite = force.is_finite() && torque.is_finite();
        self.begin(handle);
        // Other devices have begun their frames since.
        self.hd.make_current(handle);
        // The library has set the force to zero when the frame began.
        if finite && !self.scheduler.is_force_off() {
            let limits = &self.slot.traits.limits;
            let force = FRAME.to_vendor(force.clamp_length_max(limits.max_force));
            self.hd.set_doubles(parameter::CURRENT_FORCE, force.to_array());
            if limits.max_torque > 0.0 {
                let torque = FRAME.to_vendor(torque.clamp_length_max(limits.max_torque)) / MILLI;
                self.hd.set_doubles(parameter::CURRENT_TORQUE, torque.to_array());
            }
        }
        self.end(handle);
        self.check(handle)?;
        if finite { Ok(()) } else { Err(DeviceFault::NotFinite) }
    }

    fn limits(&self) -> DeviceLimits {
        self.slot.traits.limits
    }
}

impl Drop for TouchDevice {
    fn drop(&mut self) {
        self.scheduler.remove(&self.slot);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quarter turn about the vendor's `y`, which is up: from `z`, towards the person, to `x`, right.
    #[test]
    fn transforms_are_columns() {
        #[rustfmt::skip]
        let transform = [
            0.0, 0.0, -1.0, 0.0,
            0.0, 1.0, 0.0, 0.0,
            1.0, 0.0, 0.0, 0.0,
            0.0, 0.0, 0.0, 1.0,
        ];
        assert!((orientation(&transform) * DVec3::Z - DVec3::X).length() < 1e-15);
        let ours = FRAME.orientation_to_palpate(orientation(&transform));
        assert!((ours * DVec3::NEG_Y - DVec3::X).length() < 1e-15);
        assert!(!orientation(&[0.0; 16]).is_finite() && !orientation(&[f64::NAN; 16]).is_finite());
    }
}
