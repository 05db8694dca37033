//! Safety limits on wrenches, readings and ticks.

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
    /// Strongest damping that the passivity controller may put in, N s/m.
    pub max_damping: f64,
    /// Strongest damping of rotation that it may put in, N m s/rad.
    pub max_angular_damping: f64,
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
    /// movements are near 10 m/s, and drivers give up a cable after about 50 ms. The damping is the strongest of the devices
    /// in `palpate_devices::known`: one that states none has no motors that could oscillate.
    fn default() -> Self {
        Self {
            max_force: 8.0,
            max_torque: 0.5,
            max_slew: 500.0,
            max_torque_slew: 30.0,
            max_damping: 30.0,
            max_angular_damping: 0.07,
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
        for (name, value) in [("damping", self.max_damping), ("damping of rotation", self.max_angular_damping)] {
            refuse_unless(value >= 0.0, || format!("safety: the strongest {name} must not be negative, got {value}"))?;
        }
        refuse_unless(self.ramp >= 0.0 && self.ramp.is_finite(), || {
            format!("safety: the ramp must not be negative, got {} s", self.ramp)
        })?;
        refuse_unless(self.max_overruns > 0, || "safety: the number of overruns must be positive, got 0".into())
    }

    /// Without a limit on the time of a tick: a late force harms nobody where no device has motors, and a page's worker may be
    /// suspended within a tick for as long as the browser or the computer likes.
    #[must_use]
    pub fn of_any_tick_time(self) -> Self {
        Self { max_compute: f64::INFINITY, max_overruns: u32::MAX, ..self }
    }

    /// With those of the device of a tool.
    ///
    /// # Errors
    /// A limit of the device that limits nothing, or a contact stiffer than it holds at any rate.
    pub(crate) fn with_device(&self, model: &Model, tool: usize, device: &DeviceLimits) -> Result<Self> {
        let stated = [
            ("largest force", device.max_force),
            ("largest torque", device.max_torque),
            ("strongest damping", device.max_damping),
            ("strongest damping of rotation", device.max_angular_damping),
            ("damping of its own", device.own_damping.unwrap_or(0.0)),
            ("delay", device.delay),
        ];
        for (name, value) in stated {
            refuse_unless(value >= 0.0, || format!("the device of tool {tool} states a {name} of {value}"))?;
        }
        check_stiffness(model, tool, device, None)?;
        Ok(Self {
            max_damping: self.max_damping.min(device.max_damping),
            max_angular_damping: self.max_angular_damping.min(device.max_angular_damping),
            max_force: self.max_force.min(device.max_force),
            max_torque: self.max_torque.min(device.max_torque),
            // In the scene, which may be many times as large as the workspace of the hand.
            max_speed: device.max_speed.unwrap_or(f64::INFINITY),
            ..*self
        })
    }
}

/// Refuses a tool that may ask for a stiffer contact than its device holds with a time `period` between two ticks, s; `None`
/// where that is not known yet. The model would have to be another: a force that is capped is not that of the body.
///
/// # Errors
/// The tool, with the largest stiffness that may stand there.
pub fn check_stiffness(model: &Model, tool: usize, device: &DeviceLimits, period: Option<f64>) -> Result<()> {
    let asked = model.tools[tool].max_stiffness;
    let (held, rate) = match period {
        Some(period) => (device.largest_stiffness(period), format!(" at {:.0} Hz", 1.0 / period)),
        None => (device.max_stiffness, String::new()),
    };
    refuse_unless(asked <= held, || {
        // Rounded down: what the message says is accepted.
        let held = held.floor();
        format!(
            "tool {tool} may ask for {asked} N/m, its device holds at most {held} N/m{rate}: lower max_stiffness to {held}"
        )
    })
}
