//! Memory of the solution for contacts under the local law.

use glam::{DMat3, DVec3};

use crate::contact::local::cells::{CellScratch, PressureState};
use crate::contact::smooth::{FanWeights, FootPoint, SmoothSurface};
use crate::simulation::MAX_CONTACTS;
use crate::simulation::covering::neighbourhood;
use crate::simulation::law::{LocalBody, LocalResponse, Others};
use crate::simulation::model::Model;
use crate::simulation::state::State;

/// Memory of the method.
pub struct LocalScratch {
    /// The body that the fans in `weights` belong to.
    body: Option<usize>,
    pub(super) weights: Vec<FanWeights>,
    pub(super) responses: Vec<LocalResponse>,
    /// Compliance between contacts, and what the others do at each.
    pub(super) between: Box<[[DMat3; MAX_CONTACTS]; MAX_CONTACTS]>,
    /// Compliance of one step less that at rest, on a body in motion, with the coupling on the diagonal.
    pub(super) change: Box<[[DMat3; MAX_CONTACTS]; MAX_CONTACTS]>,
    pub(super) others: [Others; MAX_CONTACTS],
    /// What every contact counts from.
    pub(super) from: [DVec3; MAX_CONTACTS],
    pub(super) places: [DVec3; MAX_CONTACTS],
    pub(super) steps: [DVec3; MAX_CONTACTS],
    /// Largest difference of a force from what was expected, over that force.
    pub(super) changed: f64,
    /// Steps that the last body took.
    pub(in crate::simulation) taken: usize,
    pub(super) cells: Box<CellScratch>,
    /// For contacts without cells.
    pub(super) unused: PressureState,
}

impl LocalScratch {
    /// Weighs the fans around a foot that no contact has yet.
    pub fn weigh(&mut self, body: usize, smooth: &SmoothSurface, foot: &FootPoint) -> &FanWeights {
        self.turn_to(body);
        smooth.weigh(foot, &mut self.weights[0]);
        &self.weights[0]
    }

    /// Forgets the fans of another body.
    pub(super) fn turn_to(&mut self, body: usize) {
        if self.body != Some(body) {
            self.body = Some(body);
            self.weights.iter_mut().for_each(|weights| weights.near.forget());
        }
    }

    /// Takes the step. The forces are expected to follow.
    pub(super) fn go(&mut self, count: usize) {
        for a in 0..count {
            self.places[a] += self.steps[a];
            let response = &mut self.responses[a];
            response.force += response.jacobian * self.steps[a];
        }
    }

    /// For a model.
    pub fn new(model: &Model) -> Self {
        Self {
            body: None,
            weights: vec![FanWeights::new(neighbourhood(model)); MAX_CONTACTS],
            responses: vec![LocalResponse::default(); MAX_CONTACTS],
            between: Box::new([[DMat3::ZERO; MAX_CONTACTS]; MAX_CONTACTS]),
            change: Box::new([[DMat3::ZERO; MAX_CONTACTS]; MAX_CONTACTS]),
            others: [Others::default(); MAX_CONTACTS],
            from: [DVec3::ZERO; MAX_CONTACTS],
            places: [DVec3::ZERO; MAX_CONTACTS],
            steps: [DVec3::ZERO; MAX_CONTACTS],
            changed: 0.0,
            taken: 0,
            cells: Box::default(),
            unused: PressureState::default(),
        }
    }
}

/// What a tool meets of a body; `None` where the local law is not prepared.
pub fn local_body<'a>(model: &'a Model, state: &State, tool: usize, body: usize) -> Option<LocalBody<'a>> {
    let fixed = &model.bodies[body];
    let local = fixed.local.as_ref()?;
    let regular = model.regular[tool][body].as_deref()?;
    Some(LocalBody {
        drawn: fixed.drawn(),
        smooth: &local.smooth,
        fields: &regular.fields,
        scale: state.bodies[body].stiffness_scale,
    })
}
