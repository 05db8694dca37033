//! The loop on emulated devices, without a clock: the closed loop of device, hand and bodies, the same bits in every run.

use std::ops::ControlFlow;
use std::sync::Arc;

use palpate_core::Result;
use palpate_core::simulation::{MAX_TOOLS, Model, Wrench};
use palpate_devices::emulated::{EmulatedDevice, Handle, Truth};
use palpate_devices::{Device, Reading};

use crate::force_loop::ForceLoop;
use crate::safety::{Fault, SafetyLimits};
use crate::settings::Settings;

/// A tick of devices in motion; of each tool in the order of the scene's.
#[derive(Clone, Copy, Debug, Default)]
pub struct EmulatedTick {
    /// What the tips do when they are read.
    pub truths: [Truth; MAX_TOOLS],
    /// What the devices say of it.
    pub readings: [Reading; MAX_TOOLS],
    /// What goes out to them.
    pub wrenches: [Wrench; MAX_TOOLS],
    /// The first fault that is latched.
    pub fault: Option<Fault>,
}

/// Ticks `period` seconds apart, until `each` breaks off. It gets the number of each tick from zero and what happened in it, and
/// the devices' handles to steer by.
///
/// # Errors
/// See [`ForceLoop::new`].
pub fn run_emulated(
    model: &Arc<Model>,
    devices: Vec<(Handle, EmulatedDevice)>,
    limits: SafetyLimits,
    settings: Settings,
    period: f64,
    mut each: impl FnMut(usize, &EmulatedTick, &mut [Handle]) -> ControlFlow<()>,
) -> Result<()> {
    let (mut handles, devices): (Vec<_>, Vec<_>) =
        devices.into_iter().map(|(handle, device)| (handle, Box::new(device) as Box<dyn Device>)).unzip();
    let (mut force_loop, mut handle) = ForceLoop::with_clock(model.clone(), devices, limits, settings, || 0)?;
    let mut happened = EmulatedTick::default();
    for tick in 0.. {
        force_loop.tick((1e9 * period * tick as f64).round() as u64, period);
        let status = &handle.latest().status;
        for (truth, device) in happened.truths.iter_mut().zip(&mut handles) {
            *truth = device.truth();
        }
        (happened.readings, happened.wrenches, happened.fault) = (status.readings, status.wrenches, status.fault);
        if each(tick, &happened, &mut handles).is_break() {
            break;
        }
    }
    Ok(())
}
