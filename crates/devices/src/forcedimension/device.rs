//! Reading and writing of a device in the tick.

use std::ffi::c_int;

use glam::{DMat3, DQuat, DVec3};

use super::guard::{Guard, State};
use super::library::{Dhd, Freshness, fault};
use super::open_devices::OpenDevice;
use super::{Traits, ffi::Id};
use crate::frame::rotation;
use crate::{Buttons, Device, DeviceFault, DeviceLimits, Frame, OpenError, Pose, Reading, Twist, Wrench};

const FRAME: Frame = Frame::TowardsRightUp;

/// Longest time for which the library may repeat a measurement, ns.
const STALE_AFTER_NS: u64 = 20_000_000;

/// An open device. When it is dropped its motors are off.
pub struct ForceDimensionDevice {
    dhd: Dhd,
    traits: Traits,
    guard: Guard,
    /// When the latest fresh position was measured.
    fresh_ns: Option<u64>,
}

impl ForceDimensionDevice {
    pub fn new(dhd: Dhd, place: OpenDevice, id: Id, traits: Traits) -> Result<Self, OpenError> {
        let guard = Guard::start(dhd, place, id, traits.clone())?;
        Ok(Self { dhd, traits, guard, fresh_ns: None })
    }

    /// Notes what an error means for the tick and for the guard.
    fn fault_of(&self, code: c_int, id: Id) -> DeviceFault {
        let fault = fault(code);
        if fault == DeviceFault::Disconnected {
            // Nothing is written from now on, and what cannot be read may still hear.
            let _ = self.dhd.release(self.traits.has_active_wrist, id);
            let _ = self.dhd.enable_force(false, id);
            self.guard.mark_lost();
        }
        fault
    }

    fn measure(&mut self, id: Id, now_ns: u64) -> Result<Reading, c_int> {
        let dhd = self.dhd;
        let (position, freshness) = dhd.position(id)?;
        let linear = dhd.linear_velocity(id)?;
        let (orientation, angular) = match self.traits.has_wrist {
            true => (orientation(dhd.orientation(id)?), dhd.angular_velocity(id)?),
            false => (DQuat::IDENTITY, DVec3::ZERO),
        };
        let fresh_ns = match self.fresh_ns {
            Some(fresh_ns) if freshness == Freshness::Cached => fresh_ns,
            _ => now_ns,
        };
        self.fresh_ns = Some(fresh_ns);
        Ok(Reading {
            pose: Pose { position: FRAME.to_palpate(position), orientation: FRAME.orientation_to_palpate(orientation) },
            twist: Twist { linear: FRAME.to_palpate(linear), angular: FRAME.to_palpate(angular) },
            buttons: Buttons(dhd.buttons(id)),
            active: true,
            timestamp_ns: fresh_ns,
        })
    }
}

/// Rotation of a matrix by its rows; not a number if it is none.
fn orientation(rows: [[f64; 3]; 3]) -> DQuat {
    rotation(DMat3::from_cols_array_2d(&rows).transpose())
}

impl Device for ForceDimensionDevice {
    fn name(&self) -> &str {
        &self.traits.name
    }

    fn read(&mut self, now_ns: u64, _period: f64) -> Result<Reading, DeviceFault> {
        let id = match self.guard.state() {
            State::Lost => return Err(DeviceFault::Disconnected),
            State::MotorsOff => return Err(DeviceFault::MotorsOff),
            State::Ready(id) => id,
        };
        let reading = self.measure(id, now_ns).map_err(|code| self.fault_of(code, id))?;
        let Reading { pose, twist, timestamp_ns, .. } = reading;
        if !pose.is_finite() || !twist.linear.is_finite() || !twist.angular.is_finite() {
            return Err(DeviceFault::NotFinite);
        }
        if now_ns.saturating_sub(timestamp_ns) > STALE_AFTER_NS {
            return Err(DeviceFault::Stale);
        }
        Ok(reading)
    }

    fn write(&mut self, wrench: Wrench) -> Result<(), DeviceFault> {
        let State::Ready(id) = self.guard.state() else {
            return Err(DeviceFault::MotorsOff);
        };
        let Wrench { force, torque } = wrench;
        let finite = force.is_finite() && torque.is_finite();
        let put_out = |vector: DVec3, largest: f64| match finite {
            true => FRAME.to_vendor(vector.clamp_length_max(largest)),
            false => DVec3::ZERO,
        };
        let force = put_out(force, self.traits.limits.max_force);
        // Zero forces are sent too: with them comes the compensation of gravity.
        let written = match self.traits.has_active_wrist {
            true => {
                let torque = put_out(torque, self.traits.limits.max_torque);
                self.dhd.set_force_and_torque(force, torque, id)
            }
            false => self.dhd.set_force(force, id),
        };
        self.guard.note_write();
        if let Err(code) = written {
            // A force that cannot be replaced is switched off; the guard switches on again what is well.
            let _ = self.dhd.enable_force(false, id);
            return Err(self.fault_of(code, id));
        }
        if finite { Ok(()) } else { Err(DeviceFault::NotFinite) }
    }

    fn limits(&self) -> DeviceLimits {
        self.traits.limits
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_turned_into_the_rotation_that_they_are() {
        let quarter = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let turned = orientation(quarter) * DVec3::X;
        assert!((turned - DVec3::Y).length() < 1e-15);
        // The vendor's `z` is up, and so is ours: a quarter turn to the left.
        let ours = FRAME.orientation_to_palpate(orientation(quarter)) * DVec3::X;
        assert!((ours - DVec3::Y).length() < 1e-15);
    }

    #[test]
    fn what_is_no_rotation_is_no_number() {
        let mirrored = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]];
        let stretched = [[1.01, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        for rows in [mirrored, stretched, [[0.0; 3]; 3], [[f64::NAN; 3]; 3]] {
            assert!(!orientation(rows).is_finite());
        }
    }
}
