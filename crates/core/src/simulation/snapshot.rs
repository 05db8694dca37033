//! What the frame side needs to draw a tick; its memory is sized once.

use glam::DVec3;

use super::MAX_TOOLS;
use super::body::BodyModel;
use super::contacts::Contacts;
use super::model::Model;
use super::state::{State, ToolState};
use super::strike::gather;
use crate::dynamics::{Energy, Lanes, Projection};

/// What a tick left of one body.
#[derive(Clone, Debug, Default)]
struct BodySnapshot {
    energy: Option<Energy>,
    time: f64,
    stiffness_scale: f64,
    /// Modal displacements; empty for a body at rest.
    modal: Vec<Lanes>,
}

/// What is drawn of a tick.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// The contacts.
    pub contacts: Contacts,
    /// What the tools remember.
    pub tools: [ToolState; MAX_TOOLS],
    bodies: Vec<BodySnapshot>,
}

impl State {
    /// Copies what is drawn; nothing is allocated where the snapshot is one of this model's.
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
    /// Of bodies at rest.
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

    /// Where the energy of a body in motion is.
    pub fn energy(&self, body: usize) -> Option<Energy> {
        self.bodies.get(body).and_then(|body| body.energy)
    }

    /// Time that a body in motion has gone through since the start, s.
    pub fn body_time(&self, body: usize) -> f64 {
        self.bodies.get(body).map_or(0.0, |body| body.time)
    }

    /// Displacements of some surface nodes of a body, m, in its frame.
    pub fn displacements_of(&self, model: &Model, body: usize, nodes: &[u32]) -> Vec<DVec3> {
        let moving = self.moving(model, body);
        nodes.iter().map(|&node| self.displacement_of(model, body, &moving, node)).collect()
    }

    fn displacement_of(&self, model: &Model, body: usize, moving: &[Lanes], node: u32) -> DVec3 {
        let (fixed, first) = (&model.bodies[body], 3 * node as usize);
        let mut sum = DVec3::from_slice(&fixed.free[first..first + 3]);
        for slot in self.contacts.on(body) {
            let compliance = self.contacts.patches[slot].compliance_at(&fixed.green, node as usize);
            sum += compliance * self.contacts.slots[slot].force / self.bodies[body].stiffness_scale;
        }
        if let Some(dynamics) = &fixed.dynamics {
            let mut moved = [0.0; 3];
            dynamics.modes.read(moving, first.., &mut moved);
            sum += DVec3::from(moved);
        }
        sum
    }

    /// Displacements of all surface dofs (3s) of a body, m, in its frame: `u = u_free + Psi W f`, and `Phi (q - p / k)` of a
    /// body in motion.
    pub fn displacements(&self, model: &Model, body: usize) -> Vec<f64> {
        let fixed = &model.bodies[body];
        let mut displacements = fixed.free.clone();
        for slot in self.contacts.on(body) {
            let force = self.contacts.slots[slot].force / self.bodies[body].stiffness_scale;
            self.contacts.patches[slot].add_response(&fixed.green, force, &mut displacements);
        }
        if let Some(dynamics) = &fixed.dynamics {
            let mut moved = vec![0.0; displacements.len()];
            dynamics.modes.read(&self.moving(model, body), 0.., &mut moved);
            displacements.iter_mut().zip(&moved).for_each(|(u, m)| *u += m);
        }
        displacements
    }

    /// Modal displacements of what is drawn beside `Psi W f`, so that the modes left out are there too: `q - p / k`, `p`
    /// being the modal force `Phi^T W f`.
    fn moving(&self, model: &Model, body: usize) -> Vec<Lanes> {
        let Some(dynamics) = &model.bodies[body].dynamics else { return Vec::new() };
        let modes = &dynamics.modes;
        let (mut projection, mut moving) = (Projection::new(modes), self.bodies[body].modal.clone());
        for slot in self.contacts.on(body) {
            gather(&mut projection, modes, self.contacts.patches[slot].patch());
            projection.take_static(modes, self.contacts.slots[slot].force, &mut moving);
        }
        moving
    }
}
