//! What is allowed out to a device and in from one.

use palpate_core::Result;
use palpate_core::simulation::Model;
use palpate_devices::DeviceLimits;

use crate::settings::refuse_unless;

/// Limits of a scene. Those of a device come on top: the lower one counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafetyLimits {
    /// Largest force, N.
    pub max_force: f64,
    /// Largest torque, N m.
    pub max_torque: f64,
    /// Fastest change of the force other than a release, N/s.
    pub max_slew: f64,
    /// Fastest change of the torque other than a release, N m/s.
    pub max_torque_slew: f64,
    /// Time over which forces are let in after the start and after a reset, s.
    pub ramp: f64,
    /// Longest time that a device may go without a new measurement while its tool is in the scene, s.
    pub max_reading_age: f64,
    /// Fastest that a tip may move between two readings, m/s.
    pub max_speed: f64,
    /// Longest time that a single tick may compute, s.
    pub max_compute: f64,
    /// Most ticks in a row that may compute past their next deadline.
    pub max_overruns: u32,
}

impl Default for SafetyLimits {
    /// A desktop device: 8 N and 0.5 N m, from zero to full in 16 ms, a quarter of a second to come in; a hand's fastest
    /// movements are near 10 m/s, and drivers give up a cable after about 50 ms.
    fn default() -> Self {
        Self {
            max_force: 8.0,
            max_torque: 0.5,
            max_slew: 500.0,
            max_torque_slew: 30.0,
            ramp: 0.25,
            max_reading_age: 0.05,
            max_speed: 10.0,
            max_compute: 0.1,
            max_overruns: 20,
        }
    }
}

impl SafetyLimits {
    /// Refuses limits that limit nothing: not a number passes every comparison by failing it.
    ///
    /// # Errors
    /// The limit, by name.
    pub fn check(&self) -> Result<()> {
        let limits = [
            ("largest force", self.max_force),
            ("largest torque", self.max_torque),
            ("fastest change of force", self.max_slew),
            ("fastest change of torque", self.max_torque_slew),
            ("longest age of a reading", self.max_reading_age),
            ("fastest movement of a tip", self.max_speed),
            ("longest time of a tick", self.max_compute),
        ];
        for (name, value) in limits {
            refuse_unless(value > 0.0, || format!("safety: the {name} must be positive, got {value}"))?;
        }
        refuse_unless(self.ramp >= 0.0 && self.ramp.is_finite(), || {
            format!("safety: the ramp must not be negative, got {} s", self.ramp)
        })?;
        refuse_unless(self.max_overruns > 0, || "safety: the number of overruns must be positive, got 0".into())
    }

    /// With those of the device of a tool.
    ///
    /// # Errors
    /// A contact stiffer than the device holds: the model would have to be another.
    pub(crate) fn with_device(&self, model: &Model, tool: usize, device: &DeviceLimits) -> Result<Self> {
        for (name, value) in [("force", device.max_force), ("torque", device.max_torque)] {
            refuse_unless(value >= 0.0, || format!("the device of tool {tool} states a largest {name} of {value}"))?;
        }
        let (asked, held) = (model.tools[tool].max_stiffness, device.max_stiffness);
        refuse_unless(asked <= held, || {
            format!(
                "tool {tool} may ask for {asked} N/m, its device holds {held} N/m: lower the tool's maximum stiffness"
            )
        })?;
        Ok(Self {
            max_force: self.max_force.min(device.max_force),
            max_torque: self.max_torque.min(device.max_torque),
            max_speed: device.max_speed.map_or(f64::INFINITY, |speed| self.max_speed.min(speed)),
            ..*self
        })
    }
}
