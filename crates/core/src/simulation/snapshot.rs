//! Snapshot of a tick for drawing; its memory is allocated once.

use glam::DVec3;

use super::MAX_TOOLS;
use super::body::BodyModel;
use super::contacts::Contacts;
use super::indented::{apply, indentations};
use super::model::Model;
use super::state::{State, ToolState};
use super::strike::gather_rows;
use crate::dynamics::{Energy, Lanes, Projection};

/// Snapshot of a body.
#[derive(Clone, Debug, Default)]
struct BodySnapshot {
    energy: Option<Energy>,
    time: f64,
    stiffness_scale: f64,
    /// Modal displacements; empty for a body at rest.
    modal: Vec<Lanes>,
}

/// State of a simulation after a tick, as it is drawn.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// The contacts.
    pub contacts: Contacts,
    /// The tools.
    pub tools: [ToolState; MAX_TOOLS],
    bodies: Vec<BodySnapshot>,
}

impl State {
    /// Copies the state into a snapshot; nothing is allocated if the snapshot is of the same model.
    pub fn snapshot_into(&self, snapshot: &mut Snapshot) {
        snapshot.contacts.copy_from(&self.contacts);
        snapshot.tools = self.tools;
        for (state, body) in self.bodies.iter().zip(&mut snapshot.bodies) {
            body.stiffness_scale = state.stiffness_scale;
            if let Some(motion) = &state.motion {
                (body.energy, body.time) = (Some(motion.energy()), motion.time);
                body.modal.copy_from_slice(motion.modal_displacements());
            }
        }
    }
}

impl Snapshot {
    /// Bodies at rest, without contacts.
    pub fn new(model: &Model) -> Self {
        let body = |body: &BodyModel| BodySnapshot {
            energy: body.dynamics.as_ref().map(|_| Energy::default()),
            time: 0.0,
            stiffness_scale: 1.0,
            modal: body.dynamics.as_ref().map_or_else(Vec::new, |dynamics| dynamics.modes.state().q),
        };
        Self {
            contacts: Contacts::default(),
            tools: Default::default(),
            bodies: model.bodies.iter().map(body).collect(),
        }
    }

    /// Energy of a body in motion.
    pub fn energy(&self, body: usize) -> Option<Energy> {
        self.bodies.get(body).and_then(|body| body.energy)
    }

    /// Time of a body in motion since the start, s.
    pub fn body_time(&self, body: usize) -> f64 {
        self.bodies.get(body).map_or(0.0, |body| body.time)
    }

    /// Displacements of some surface nodes of a body, m, in its frame: [`Self::displacements`] has all.
    pub fn displacements_of(&self, model: &Model, body: usize, nodes: &[u32]) -> Vec<DVec3> {
        let modal_beyond_static = self.modal_beyond_static(model, body);
        let displacement = |node| self.displacement_of(model, body, &modal_beyond_static, node);
        let indented = indentations(model, body, self.contacts.iter(), displacement);
        nodes.iter().map(|&node| apply(&indented, &model.bodies[body], node, displacement(node))).collect()
    }

    fn displacement_of(&self, model: &Model, body: usize, modal_beyond_static: &[Lanes], node: u32) -> DVec3 {
        let (fixed, first) = (&model.bodies[body], 3 * node as usize);
        let mut sum = fixed.load_displacement(node as usize);
        for slot in self.contacts.on(body) {
            let compliance = self.contacts.patches[slot].compliance_at(&fixed.green, node as usize);
            sum += compliance * self.contacts.slots[slot].force / self.bodies[body].stiffness_scale;
        }
        if let Some(dynamics) = &fixed.dynamics {
            let mut moved = [0.0; 3];
            dynamics.modes.read(modal_beyond_static, first.., &mut moved);
            sum += DVec3::from(moved);
        }
        sum
    }

    /// Displacements of all surface dofs (3s) of a body, m, in its frame: `u = u_free + Psi W f`, and `Phi (q - p / k)` of a
    /// body in motion. The surface of a hyperelastic body meets the tools.
    pub fn displacements(&self, model: &Model, body: usize) -> Vec<f64> {
        let fixed = &model.bodies[body];
        let mut displacements = fixed.free.clone();
        for slot in self.contacts.on(body) {
            let force = self.contacts.slots[slot].force / self.bodies[body].stiffness_scale;
            self.contacts.patches[slot].add_response(&fixed.green, force, &mut displacements);
        }
        if let Some(dynamics) = &fixed.dynamics {
            let mut moved = vec![0.0; displacements.len()];
            dynamics.modes.read(&self.modal_beyond_static(model, body), 0.., &mut moved);
            displacements.iter_mut().zip(&moved).for_each(|(u, m)| *u += m);
        }
        let displacement = |node: u32| DVec3::from_slice(&displacements[3 * node as usize..][..3]);
        let indented = indentations(model, body, self.contacts.iter(), displacement);
        for (node, displacement) in displacements.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            *displacement = apply(&indented, fixed, node as u32, DVec3::from(*displacement)).to_array();
        }
        displacements
    }

    /// Modal displacements beyond the static ones, `q - p / k` with the modal force `p = Phi^T W f`. `Psi W f` has the static part
    /// of all modes, those left out included.
    fn modal_beyond_static(&self, model: &Model, body: usize) -> Vec<Lanes> {
        let Some(dynamics) = &model.bodies[body].dynamics else { return Vec::new() };
        let modes = &dynamics.modes;
        let (mut projection, mut modal_beyond_static) = (Projection::new(modes), self.bodies[body].modal.clone());
        for slot in self.contacts.on(body) {
            gather_rows(&mut projection, modes, self.contacts.patches[slot].patch());
            projection.take_static(modes, self.contacts.slots[slot].force, &mut modal_beyond_static);
        }
        modal_beyond_static
    }
}
