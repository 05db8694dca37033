//! The same ticks without a clock.

use std::sync::Arc;

use glam::DVec3;
use palpate_core::simulation::{Input, MAX_TOOLS, Model};
use palpate_devices::DeviceState;

use crate::RATE;
use crate::safety::{Fault, SafetyLimits};
use crate::ticker::Ticker;

/// Moves the first tool through `positions`, one tick each; forces on the device, and the fault if one latched.
pub fn run(
    model: Arc<Model>,
    limits: SafetyLimits,
    settings: &Input,
    positions: &[DVec3],
) -> (Vec<DVec3>, Option<Fault>) {
    let mut ticker = Ticker::new(model, limits);
    let mut devices = [DeviceState::default(); MAX_TOOLS];
    let mut previous = positions.first().copied().unwrap_or_default();
    let mut fault = None;
    let forces = positions
        .iter()
        .map(|&position| {
            devices[0] = DeviceState { position, velocity: (position - previous) * RATE, active: true, grab: false };
            previous = position;
            let output = ticker.tick(&devices, settings, 1.0 / RATE);
            fault = fault.or(output.fault);
            output.forces[0]
        })
        .collect();
    (forces, fault)
}
