//! Memory of the solution for contacts under the local law.

use glam::{DMat3, DVec3};

use crate::contact::footprint::FootprintScratch;
use crate::contact::local::cells::{CellScratch, PressureState};
use crate::contact::smooth::{FanWeights, FootPoint, SmoothSurface};
use crate::simulation::MAX_CONTACTS;
use crate::simulation::covering::neighbourhood;
use crate::simulation::law::{LocalBody, LocalResponse, Others};
use crate::simulation::model::Model;
use crate::simulation::state::State;
use crate::tensor::outer;

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
    /// The best places and answers so far, of tools that take cells.
    best: Vec<(DVec3, LocalResponse)>,
    /// Whether one is known.
    pub(super) stepped: bool,
    /// Largest difference of a force from what was expected, over that force.
    pub(super) changed: f64,
    /// Steps that the last body took.
    pub(in crate::simulation) taken: usize,
    pub(super) cells: Box<CellScratch>,
    /// The pieces next to the tool that was asked for last, and the slot of its contact.
    pub(in crate::simulation) footprint: FootprintScratch,
    pub(in crate::simulation) pressed: Option<usize>,
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

    /// What is left of the equation for the places, m.
    pub(super) fn miss(&self, count: usize) -> f64 {
        let of = |a: usize| {
            let moved: DVec3 = (0..count).map(|b| self.between[a][b] * self.responses[b].force).sum();
            (self.places[a] - self.from[a] + moved).length()
        };
        (0..count).map(of).fold(0.0, |most: f64, miss| if miss.is_nan() { miss } else { most.max(miss) })
    }

    /// Whether tools touch that did not at the places that are remembered.
    pub(super) fn untouched(&self, count: usize) -> bool {
        (0..count).any(|a| self.best[a].1.force == DVec3::ZERO && self.responses[a].force != DVec3::ZERO)
    }

    /// Lengthens steps out of the surface: where much more force is there than can be, the straight line of Newton's method takes
    /// back a third of the depth at most, for a force like `d^(3/2)`. With `x = d/d_0`, `c = C F_0/d_0` and what is left of the
    /// equation, `r`, the next depth is that of `x + c x^(3/2) = 1 + c - r/d_0`. Returns the longest step, m.
    pub(super) fn go_by_power(&mut self, count: usize) -> f64 {
        let mut longest = 0.0f64;
        for a in 0..count {
            let response = &self.responses[a];
            let (normal, indentation) = (response.foot.normal, &response.indentation);
            let depth = 1.5 * indentation.force / indentation.stiffness;
            let out = self.steps[a].dot(normal);
            if depth > 0.0 && depth.is_finite() && out > 0.0 {
                let c = (normal.dot(self.between[a][a] * normal) * indentation.force / depth).max(0.0);
                // What is left of the equation follows from Newton's own step.
                let right = (1.0 + c - out * (1.0 + 1.5 * c) / depth).max(0.0);
                let mut x = 1.0f64;
                for _ in 0..6 {
                    x = (x - (x + c * x.powf(1.5) - right) / (1.0 + 1.5 * c * x.sqrt())).max(0.0);
                }
                self.steps[a] += normal * ((1.0 - x) * depth - out);
            }
            longest = longest.max(self.steps[a].length());
        }
        longest
    }

    /// Remembers places and answers. What the force has changed by since the ones before replaces what it was expected to.
    pub(super) fn keep(&mut self, count: usize) {
        for a in 0..count {
            let (place, before) = self.best[a];
            let (response, way) = (&mut self.responses[a], self.places[a] - place);
            let squared = way.length_squared();
            if self.stepped && squared > 0.0 {
                let missed = response.force - before.force - response.jacobian * way;
                response.jacobian += outer(missed, way) * (1.0 / squared);
            }
            self.best[a] = (self.places[a], self.responses[a]);
        }
        self.stepped = true;
    }

    /// Goes back to the places that are remembered, but for a part of the way from there.
    pub(super) fn take_back(&mut self, count: usize, part: f64) {
        for a in 0..count {
            let (place, before) = self.best[a];
            let way = self.places[a] - place;
            self.places[a] = if part > 0.0 && way.is_finite() { place + way * part } else { place };
            self.responses[a] = before;
            self.responses[a].force += before.jacobian * (self.places[a] - place);
            if part == 0.0 {
                self.responses[a] = before;
            }
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
            best: vec![(DVec3::ZERO, LocalResponse::default()); MAX_CONTACTS],
            stepped: false,
            changed: 0.0,
            taken: 0,
            cells: Box::default(),
            footprint: FootprintScratch::default(),
            pressed: None,
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
        pressed: model.pressed[tool][body].as_deref(),
        scale: state.bodies[body].stiffness_scale,
    })
}
