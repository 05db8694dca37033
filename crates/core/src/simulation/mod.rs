//! Chapter 7: the tick. `step(&Model, &mut State, &mut Scratch, &Input) -> Output` never allocates, locks, reads a clock
//! or panics on bad numbers; the same input gives the same bits.

mod contact_forces;
mod model;
mod motion;
mod state;
mod step;
mod stick;

pub use model::{Model, Scratch};
pub use motion::{Dynamics, Energy, Motion, Strike};
pub use state::{Mode, Snapshot, State, ToolContact};
pub use step::step;

use glam::DVec3;

/// Most tools a simulation may have.
pub const MAX_TOOLS: usize = 4;

/// What one device says at a tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct ToolInput {
    /// Centre of the tool sphere, m.
    pub position: DVec3,
    /// Its velocity, m/s.
    pub velocity: DVec3,
    /// Whether the tool is in the scene at all.
    pub active: bool,
    /// Whether it holds on to the surface it touches.
    pub grab: bool,
}

/// What all devices and settings say at a tick.
#[derive(Clone, Copy, Debug)]
pub struct Input {
    /// The tools.
    pub tools: [ToolInput; MAX_TOOLS],
    /// Contact radius of contacts that begin now, m.
    pub contact_radius: f64,
    /// Young's modulus over that of the Green's function: it only scales forces.
    pub stiffness_scale: f64,
    /// Let go of everything.
    pub reset: bool,
    /// How far a body in motion advances in this tick, s.
    pub advance: f64,
    /// A blow for a body in motion.
    pub strike: Option<Strike>,
}

impl Default for Input {
    fn default() -> Self {
        Self {
            tools: Default::default(),
            contact_radius: 0.0,
            stiffness_scale: 1.0,
            reset: false,
            advance: 1e-3,
            strike: None,
        }
    }
}

/// What the tick answers.
#[derive(Clone, Copy, Debug, Default)]
pub struct Output {
    /// Force on each device, N: minus the force on the body. Not yet made safe.
    pub force_on_device: [DVec3; MAX_TOOLS],
    /// Whether each tool touches.
    pub in_contact: [bool; MAX_TOOLS],
}
