//! The same ticks without a clock.

use std::sync::Arc;

use glam::DVec3;
use palpate_core::simulation::{Energy, Input, MAX_TOOLS, Model, Snapshot, Strike};
use palpate_devices::DeviceState;

use crate::RATE;
use crate::safety::{Fault, SafetyLimits};
use crate::ticker::Ticker;

/// What happens, tick by tick.
pub struct Script<'a> {
    /// Where the first tool is, m; not finite while it is out of the scene.
    pub positions: &'a [DVec3],
    /// Blows and their ticks, in order.
    pub strikes: &'a [(usize, Strike)],
    /// Surface nodes (ranks) whose displacements are recorded.
    pub watch: &'a [u32],
}

/// What came of it.
#[derive(Default)]
pub struct Recording {
    /// Force on the first device at each tick, N.
    pub forces: Vec<DVec3>,
    /// Energy at each tick; empty for a body that does not move.
    pub energies: Vec<Energy>,
    /// Displacements of the watched nodes at each tick, m.
    pub displacements: Vec<DVec3>,
    /// The fault, if one latched.
    pub fault: Option<Fault>,
}

/// Ticks through a script.
pub fn run(model: Arc<Model>, limits: SafetyLimits, settings: &Input, script: &Script<'_>) -> Recording {
    let mut ticker = Ticker::new(model.clone(), limits);
    let mut snapshot = Snapshot::new(&model);
    let mut devices = [DeviceState::default(); MAX_TOOLS];
    let mut previous = None;
    let mut strikes = script.strikes.iter().peekable();
    let mut recording = Recording::default();
    for (tick, &position) in script.positions.iter().enumerate() {
        let active = position.is_finite();
        let velocity = previous.filter(|_| active).map_or(DVec3::ZERO, |before| (position - before) * RATE);
        previous = active.then_some(position);
        devices[0] = if active {
            DeviceState { position, velocity, active, grab: false }
        } else {
            DeviceState { active, ..devices[0] }
        };
        let strike = strikes.next_if(|(when, _)| *when == tick).map(|&(_, strike)| strike);
        let output = ticker.tick(&devices, &Input { strike, ..*settings }, 1.0 / RATE);
        recording.fault = recording.fault.or(output.fault);
        recording.forces.push(output.forces[0]);
        recording.energies.extend(ticker.energy());
        if !script.watch.is_empty() {
            ticker.snapshot_into(&mut snapshot);
            recording.displacements.extend(snapshot.displacements_of(&model, script.watch));
        }
    }
    recording
}
