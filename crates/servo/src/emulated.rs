//! The loop on emulated devices, without a clock: the closed loop of bodies, device and hand, the same bits in every run.

use std::ops::ControlFlow;
use std::sync::Arc;

use palpate_core::Result;
use palpate_core::simulation::{MAX_TOOLS, Model};
use palpate_devices::emulated::{EmulatedDevice, Handle, TrueMotion};
use palpate_devices::{Device, Reading, Wrench};

use crate::force_loop::ForceLoop;
use crate::handoff::LOG_ROWS;
use crate::preparation::Preparation;
use crate::preparer::StrainPreparer;
use crate::safety::{Fault, SafetyLimits};
use crate::settings::Settings;

/// A loop to be run on emulated devices.
pub struct Emulation<'a> {
    /// Bodies and tools.
    pub model: &'a Arc<Model>,
    /// Limits of the scene.
    pub limits: SafetyLimits,
    /// Unchanged throughout.
    pub settings: Settings,
    /// Measures strain where it is limited.
    pub strain: &'a StrainPreparer,
    /// Time between two ticks, s.
    pub period: f64,
}

/// A tick of an [`Emulation`]; of each tool in the order of the scene's.
#[derive(Clone, Copy, Debug, Default)]
pub struct EmulatedTick {
    /// Since the start.
    pub number: usize,
    /// What the tips do when they are read.
    pub true_motions: [TrueMotion; MAX_TOOLS],
    /// What the devices say of it.
    pub readings: [Reading; MAX_TOOLS],
    /// What goes out to them.
    pub wrenches: [Wrench; MAX_TOOLS],
    /// The first fault that is latched.
    pub fault: Option<Fault>,
}

impl Emulation<'_> {
    /// Ticks until `each` breaks off, which is told what happened and may steer the devices by their handles.
    ///
    /// # Errors
    /// See [`ForceLoop::new`].
    pub fn run(
        &self,
        devices: Vec<(Handle, EmulatedDevice)>,
        mut each: impl FnMut(&EmulatedTick, &mut [Handle]) -> ControlFlow<()>,
    ) -> Result<()> {
        let (mut handles, devices): (Vec<_>, Vec<_>) =
            devices.into_iter().map(|(handle, device)| (handle, Box::new(device) as Box<dyn Device>)).unzip();
        let Self { model, limits, settings, strain, period } = *self;
        let (mut force_loop, mut handle) =
            ForceLoop::without_clock(model, devices, limits, settings, strain, LOG_ROWS)?;
        let mut preparation = Preparation::new(&mut handle, strain)?;
        for number in 0.. {
            preparation.hand_over(number);
            force_loop.tick((1e9 * period * number as f64).round() as u64, period);
            preparation.prepare(number);
            let status = &handle.latest().status;
            let (readings, wrenches, fault) = (status.readings, status.wrenches, status.fault);
            let mut tick = EmulatedTick { number, readings, wrenches, fault, ..EmulatedTick::default() };
            for (true_motion, device) in tick.true_motions.iter_mut().zip(&mut handles) {
                *true_motion = device.true_motion();
            }
            if each(&tick, &mut handles).is_break() {
                break;
            }
        }
        Ok(())
    }
}
