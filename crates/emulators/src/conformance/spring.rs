//! Controller of the test rig: a spring to a fixed point, and the reaction to a fault.

use glam::DVec3;
use palpate_devices::{Device, DeviceFault, Reading, Wrench};

/// Stiffness of the suite's spring, N/m: weak enough that its force at [`PUSH`] is rendered by any device.
pub const STIFFNESS: f64 = 100.0;

/// How far the suite pushes, m: within the workspace of any device.
pub const PUSH: f64 = 0.010;

/// A spring to a point.
pub struct Spring {
    /// Where it pulls to, m, by the device's own origin.
    pub anchor: DVec3,
    /// The fault that the loop has latched: no force until a reset.
    pub fault: Option<DeviceFault>,
}

impl Spring {
    pub fn to(anchor: DVec3) -> Self {
        Self { anchor, fault: None }
    }

    /// One tick: reads, answers, writes. What was read, and what was written.
    pub fn tick(&mut self, device: &mut dyn Device, now_ns: u64) -> (Result<Reading, DeviceFault>, Wrench) {
        let reading = device.read(now_ns, 1e-3);
        let wrench = match reading {
            Ok(reading) if self.fault.is_none() => {
                let force = STIFFNESS * (self.anchor - reading.pose.position);
                Wrench { force, torque: DVec3::ZERO }
            }
            Ok(_) => Wrench::default(),
            Err(fault) => {
                self.fault.get_or_insert(fault);
                Wrench::default()
            }
        };
        if let Err(fault) = device.write(wrench) {
            self.fault.get_or_insert(fault);
        }
        (reading, wrench)
    }
}
