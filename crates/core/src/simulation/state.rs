//! What evolves: each tool's contact.

use glam::{DMat3, DVec3};

use super::contact_forces::{solve_forces, update_compliance};
use super::{Energy, MAX_TOOLS, Model, Motion};
use crate::contact::{Patch, add_patch_response, compliance_block};
use crate::dynamics::{Lanes, Projection};

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

impl ToolContact {
    /// Out of the scene: as at the start, without touching the patch's arrays.
    pub(super) fn clear(&mut self, position: DVec3) {
        (self.mode, self.entry_depth, self.patch.count) = (Mode::Free, 0.0, 0);
        (self.point, self.normal, self.anchor, self.force) = Default::default();
        (self.position, self.refused) = (position, false);
    }
}

/// State of a simulation.
#[derive(Clone, Debug, Default)]
pub struct State {
    /// The tools' contacts.
    pub tools: [ToolContact; MAX_TOOLS],
    /// Compliance between the tools in contact, m/N: static, at the Green's function's own Young's modulus, or of one step.
    pub compliance: [[DMat3; MAX_TOOLS]; MAX_TOOLS],
    /// Young's modulus over the Green's function's.
    pub stiffness_scale: f64,
    /// How the body moves, if it does.
    pub motion: Option<Motion>,
}

/// What the frame side needs to draw a tick; its memory is sized once.
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    /// The tools' contacts.
    pub tools: [ToolContact; MAX_TOOLS],
    /// Where the energy of a body in motion is.
    pub energy: Option<Energy>,
    /// Time that a body in motion has gone through since the start, s.
    pub body_time: f64,
    stiffness_scale: f64,
    /// Modal displacements; empty for a body at rest.
    modal: Vec<Lanes>,
}

impl State {
    /// Copies what is drawn; nothing is allocated where the snapshot is one of this model's.
    pub fn snapshot_into(&self, snapshot: &mut Snapshot) {
        snapshot.tools.clone_from(&self.tools);
        snapshot.stiffness_scale = self.stiffness_scale;
        if let Some(motion) = &self.motion {
            (snapshot.energy, snapshot.body_time) = (Some(motion.energy), motion.time);
            snapshot.modal.copy_from_slice(motion.modal_displacements());
        }
    }

    /// Displacement of one surface node, m; never allocates.
    pub fn displacement_of(&mut self, model: &Model, node: usize) -> DVec3 {
        let mut sum = DVec3::from_slice(&model.free[3 * node..3 * node + 3]);
        for tool in self.tools.iter().filter(|tool| tool.mode != Mode::Free) {
            sum += response_of(model, node, tool) / self.stiffness_scale;
        }
        if let (Some(motion), Some(dynamics)) = (&mut self.motion, &model.dynamics) {
            sum += motion.beyond_static(&dynamics.modes, &self.tools, node);
        }
        sum
    }
}

/// Static displacement of a surface node under the force of a tool, m.
fn response_of(model: &Model, node: usize, tool: &ToolContact) -> DVec3 {
    let mut here = Patch { count: 1, ..Patch::default() };
    (here.nodes[0], here.weights[0]) = (node as u32, 1.0);
    compliance_block(model.green(), &here, &tool.patch).unwrap_or(DMat3::ZERO) * tool.force
}

impl Snapshot {
    /// Of a body at rest.
    pub fn new(model: &Model) -> Self {
        let modal = model.dynamics.as_ref().map_or_else(Vec::new, |d| d.modes.state().q);
        let energy = model.dynamics.as_ref().map(|_| Energy::default());
        Self { stiffness_scale: 1.0, modal, energy, ..Self::default() }
    }

    /// Displacements of some surface nodes, m.
    pub fn displacements_of(&self, model: &Model, nodes: &[u32]) -> Vec<DVec3> {
        let moving = self.moving(model);
        nodes.iter().map(|&node| self.displacement_of(model, &moving, node)).collect()
    }

    fn displacement_of(&self, model: &Model, moving: &[Lanes], node: u32) -> DVec3 {
        let first = 3 * node as usize;
        let mut sum = DVec3::from_slice(&model.free[first..first + 3]);
        for tool in self.touching() {
            sum += response_of(model, node as usize, tool) / self.stiffness_scale;
        }
        if let Some(dynamics) = &model.dynamics {
            let mut moved = [0.0; 3];
            dynamics.modes.read(moving, first.., &mut moved);
            sum += DVec3::from(moved);
        }
        sum
    }

    /// Displacements of all surface dofs (3s), m: `u = u_free + Psi W f`, and `Phi (q - p / k)` of a body in motion.
    pub fn displacements(&self, model: &Model) -> Vec<f64> {
        let green = model.green();
        let mut displacements = model.free.clone();
        for tool in self.touching() {
            let force = tool.force / self.stiffness_scale;
            add_patch_response(green, &tool.patch, force, &mut displacements);
        }
        if let Some(dynamics) = &model.dynamics {
            let mut moved = vec![0.0; displacements.len()];
            dynamics.modes.read(&self.moving(model), 0.., &mut moved);
            displacements.iter_mut().zip(&moved).for_each(|(u, m)| *u += m);
        }
        displacements
    }

    fn touching(&self) -> impl Iterator<Item = &ToolContact> {
        self.tools.iter().filter(|tool| tool.mode != Mode::Free)
    }

    /// Modal displacements of what is drawn beside `Psi W f`, so that the modes left out are there too: `q - p / k`, `p`
    /// being the modal force `Phi^T W f`.
    fn moving(&self, model: &Model) -> Vec<Lanes> {
        let Some(dynamics) = &model.dynamics else { return Vec::new() };
        let modes = &dynamics.modes;
        let (mut projection, mut moving) = (Projection::new(modes), self.modal.clone());
        for tool in self.touching() {
            projection.gather(modes, tool.patch.iter().map(|(node, weight)| (3 * node, weight)));
            projection.take_static(modes, tool.force, &mut moving);
        }
        moving
    }

    /// Displacements of all surface dofs (3s) per unit way of `tool` from its anchor along each axis, m/m, for the contacts
    /// as they are and a body come to rest. The answer is linear in the ways of all tools; `None` for a tool that does not
    /// touch.
    pub fn response(&self, model: &Model, tool: usize) -> Option<[Vec<f64>; 3]> {
        if self.tools[tool].mode == Mode::Free {
            return None;
        }
        let mut pushed = State { tools: self.tools.clone(), stiffness_scale: self.stiffness_scale, ..State::default() };
        for other in 0..MAX_TOOLS {
            if pushed.tools[other].mode != Mode::Free {
                update_compliance(model, &mut pushed, other);
            }
            pushed.tools[other].position = pushed.tools[other].anchor;
        }
        Some(DVec3::AXES.map(|way| {
            pushed.tools[tool].position = pushed.tools[tool].anchor + way;
            solve_forces(model, &mut pushed);
            let at_rest =
                Self { tools: pushed.tools.clone(), stiffness_scale: self.stiffness_scale, ..Self::default() };
            at_rest.displacements(model).iter().zip(&model.free).map(|(u, free)| u - free).collect()
        }))
    }
}
