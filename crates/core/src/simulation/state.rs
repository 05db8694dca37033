//! What evolves: each tool's contact.

use glam::{DMat3, DVec3};

use super::contact_forces::solve_forces;
use super::{MAX_TOOLS, Model};
use crate::contact::Patch;

/// What a tool is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Not touching.
    #[default]
    Free,
    /// Touching, unilateral: never pulls.
    Press,
    /// Holding on, bilateral.
    Grab,
}

/// One tool's contact with the body.
#[derive(Clone, Debug, Default)]
pub struct ToolContact {
    // Written when a contact begins or ends.
    /// What the tool is doing.
    pub mode: Mode,
    /// Penetration of the untouched surface at which the next contact begins, m: zero for a tool that came from outside, and
    /// the least reached since for one that was released inside, so that a force always starts from zero.
    pub entry_depth: f64,
    /// Contact point on the untouched surface, m.
    pub point: DVec3,
    /// Unit outward normal there.
    pub normal: DVec3,
    /// Tool position at which the contact carries no force, m.
    pub anchor: DVec3,
    /// Nodes under the contact.
    pub patch: Patch,

    // Written every tick.
    /// Tool position, m.
    pub position: DVec3,
    /// Force on the body, N.
    pub force: DVec3,
    /// Whether a contact was refused: outside the touch region, or too many nodes.
    pub refused: bool,
}

/// State of a simulation.
#[derive(Clone, Debug, Default)]
pub struct State {
    /// The tools' contacts.
    pub tools: [ToolContact; MAX_TOOLS],
    /// `W_i^T Psi W_j` of the tools in contact, m/N, at the Green's function's own Young's modulus.
    pub compliance: [[DMat3; MAX_TOOLS]; MAX_TOOLS],
    /// Young's modulus over the Green's function's.
    pub stiffness_scale: f64,
}

/// What the frame side needs to draw a tick.
pub type Snapshot = State;

impl State {
    /// Copies the state; neither side allocates.
    pub fn snapshot_into(&self, snapshot: &mut Snapshot) {
        snapshot.clone_from(self);
    }

    /// Displacements of all surface dofs (3s), m: `u = u_free + Psi W f`.
    pub fn displacements(&self, model: &Model) -> Vec<f64> {
        let green = model.green();
        let mut displacements = model.free.clone();
        for tool in self.tools.iter().filter(|t| t.mode != Mode::Free) {
            let force = tool.force / self.stiffness_scale;
            crate::contact::add_patch_response(green, &tool.patch, force, &mut displacements);
        }
        displacements
    }

    /// Displacements of all surface dofs (3s) per unit way of `tool` from its anchor along each axis, m/m, for the contacts
    /// as they are. The answer is linear in the ways of all tools; `None` for a tool that does not touch.
    pub fn response(&self, model: &Model, tool: usize) -> Option<[Vec<f64>; 3]> {
        if self.tools[tool].mode == Mode::Free {
            return None;
        }
        let mut moved = self.clone();
        for contact in &mut moved.tools {
            contact.position = contact.anchor;
        }
        let response = DVec3::AXES.map(|way| {
            moved.tools[tool].position = moved.tools[tool].anchor + way;
            solve_forces(model, &mut moved);
            let displacements = moved.displacements(model);
            displacements.iter().zip(&model.free).map(|(u, free)| u - free).collect()
        });
        Some(response)
    }
}
