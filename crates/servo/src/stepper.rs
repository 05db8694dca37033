//! A scene stepped by poses that are given, tick by tick: no thread, no clock.
//!
//! An offline run is a stepper whose poses come from a script; a sensor of a robot simulator has one for each copy of a scene.

use std::sync::Arc;

use palpate_core::Result;
use palpate_core::simulation::{Model, Pose, TaxelGrid};
use palpate_devices::{Buttons, DeviceLimits, Reading, Twist, Wrench};

use crate::force_loop::ForceLoop;
use crate::handoff::{LoopHandle, Published};
use crate::preparation::Preparation;
use crate::preparer::StrainPreparer;
use crate::replay::{Readings, ReplayedDevice};
use crate::safety::SafetyLimits;
use crate::settings::Settings;

/// Rows of the log that a stepper keeps: its log is never read.
const LOG_ROWS: usize = 1;

/// A force loop whose tools are at the poses given. Copies of one model share all that was prepared of it.
pub struct Stepper {
    model: Arc<Model>,
    force_loop: ForceLoop,
    pub(crate) handle: LoopHandle,
    preparation: Preparation,
    readings: Vec<Readings>,
    /// The last reading of each tool.
    latest: Vec<Reading>,
    ticks: usize,
    /// Time of the next tick, ns, and the time to the one after it, s.
    now_ns: u64,
    period: f64,
}

impl Stepper {
    /// At rest, with what the device of each tool can render; no limits of devices for anything.
    ///
    /// # Errors
    /// See [`ForceLoop::new`].
    pub fn new(
        model: &Arc<Model>,
        devices: &[DeviceLimits],
        limits: SafetyLimits,
        settings: Settings,
        strain: &StrainPreparer,
    ) -> Result<Self> {
        let tools = model.tools.len();
        let device = |tool: usize| {
            let limits = devices.get(tool).copied().unwrap_or(DeviceLimits::UNLIMITED);
            // A pose is commanded: it may jump.
            ReplayedDevice::boxed(DeviceLimits { max_speed: None, ..limits })
        };
        let (readings, devices) = (0..tools).map(device).unzip();
        let (force_loop, mut handle) = ForceLoop::without_clock(model, devices, limits, settings, strain, LOG_ROWS)?;
        let preparation = Preparation::new(&mut handle, strain)?;
        let latest = vec![Reading::default(); tools];
        let (model, ticks, now_ns, period) = (model.clone(), 0, 0, 0.0);
        Ok(Self { model, force_loop, handle, preparation, readings, latest, ticks, now_ns, period })
    }

    /// Makes a tick: tools are at these poses, and `period`, s, has passed since the last one. A position that is not finite takes
    /// its tool out of the scene; `grabs` has whether each tool holds on, or is empty.
    pub fn step(&mut self, poses: &[Pose], grabs: &[bool], period: f64) {
        self.prepare(poses, grabs, period);
        self.tick();
        self.finish();
    }

    /// What comes before a tick.
    pub(crate) fn prepare(&mut self, poses: &[Pose], grabs: &[bool], period: f64) {
        let now_ns = (1e9 * period * self.ticks as f64).round() as u64;
        (self.now_ns, self.period) = (now_ns.max(self.now_ns), period);
        for (tool, (latest, readings)) in self.latest.iter_mut().zip(&mut self.readings).enumerate() {
            let pose = poses.get(tool).copied().unwrap_or(Pose::at(glam::DVec3::NAN));
            let before = *latest;
            latest.active = pose.position.is_finite();
            latest.timestamp_ns = self.now_ns;
            let grab = grabs.get(tool).copied().unwrap_or(false);
            latest.buttons = if grab { Buttons::GRAB } else { Buttons::default() };
            if latest.active {
                latest.pose = pose;
                latest.twist = if before.active { twist(&before.pose, &pose, period) } else { Twist::default() };
            }
            let _ = readings.push(Ok(*latest));
        }
        self.preparation.hand_over(self.ticks);
    }

    pub(crate) fn tick(&mut self) {
        self.force_loop.tick(self.now_ns, self.period);
    }

    /// What comes after a tick.
    pub(crate) fn finish(&mut self) {
        self.preparation.prepare(self.ticks);
        self.ticks += 1;
    }

    /// Lets go of everything, brings moving bodies to rest and clears faults, in the next tick.
    ///
    /// # Errors
    /// More resets than ticks.
    pub fn reset(&mut self) -> Result<()> {
        self.handle.reset()
    }

    /// The last tick.
    pub fn latest(&mut self) -> &Published {
        self.handle.latest()
    }

    /// Wrench on a tool in the last tick as the contacts give it, before ramp, slew limit and largest force of its device.
    pub fn contact_wrench(&mut self, tool: usize) -> Wrench {
        self.force_loop.computed(tool).limited
    }

    /// Adds the normal pressures of a tool's contacts, Pa, to the taxels of a grid.
    pub fn add_pressures(&self, tool: usize, grid: &TaxelGrid, pressures: &mut [f64]) {
        self.force_loop.state().add_pressures(&self.model, tool, grid, pressures);
    }
}

/// Mean velocity from one pose to the next.
fn twist(before: &Pose, now: &Pose, period: f64) -> Twist {
    Twist { linear: (now.position - before.position) / period, angular: now.rotation_from(before) / period }
}
