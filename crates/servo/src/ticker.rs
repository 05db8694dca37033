//! One tick, the same for the loop and for an offline run.

use std::sync::Arc;

use glam::DVec3;
use palpate_core::simulation::{Energy, Input, MAX_TOOLS, Model, Scratch, Snapshot, State, step};
use palpate_devices::DeviceState;

use crate::safety::{Fault, Safety, SafetyLimits};

/// A simulation with its safety stages, ready to tick.
pub struct Ticker {
    model: Arc<Model>,
    state: State,
    scratch: Scratch,
    safety: [Safety; MAX_TOOLS],
}

/// Result of a tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct TickOutput {
    /// Force on each device after the safety stage, N.
    pub forces: [DVec3; MAX_TOOLS],
    /// The first latched fault.
    pub fault: Option<Fault>,
}

impl Ticker {
    /// At rest, at the start of the safety ramp.
    pub fn new(model: Arc<Model>, limits: SafetyLimits) -> Self {
        let (state, scratch) = (model.state(), model.scratch());
        Self { model, state, scratch, safety: std::array::from_fn(|_| Safety::new(limits)) }
    }

    /// Contacts and forces for what the devices say; never allocates.
    pub fn tick(&mut self, devices: &[DeviceState; MAX_TOOLS], settings: &Input, period: f64) -> TickOutput {
        let mut input = *settings;
        for (tool, device) in devices.iter().enumerate() {
            input.tools[tool].position = device.position;
            input.tools[tool].velocity = device.velocity;
            input.tools[tool].active = device.active;
            input.tools[tool].grab = device.grab;
            if settings.reset {
                self.safety[tool].reset();
            }
            if device.active && !device.position.is_finite() {
                self.safety[tool].latch(Fault::PositionNotFinite);
            }
        }
        let computed = step(&self.model, &mut self.state, &mut self.scratch, &input);
        let mut output = TickOutput::default();
        for tool in 0..MAX_TOOLS {
            output.forces[tool] = self.safety[tool].apply(computed.force_on_device[tool], period);
            output.fault = output.fault.or(self.safety[tool].fault());
        }
        output
    }

    /// Energies of a body in motion.
    pub fn energy(&self) -> Option<Energy> {
        self.state.motion.as_ref().map(|motion| motion.energy)
    }

    /// Displacement of one surface node after the last tick, m; never allocates.
    pub fn displacement_of(&mut self, node: usize) -> DVec3 {
        self.state.displacement_of(&self.model, node)
    }

    /// Copies what is drawn of the last tick; never allocates.
    pub fn snapshot_into(&self, snapshot: &mut Snapshot) {
        self.state.snapshot_into(snapshot);
    }
}
