//! Scratch memory of Newton's method for contacts under the local law, and the control of its steps.

use glam::{DMat3, DVec3};

use super::acceleration::{Acceleration, Iterate};
use super::half_space::LocalBody;
use super::inclination::OtherContacts;
use super::pace::Pace;
use super::response::LocalResponse;
use crate::contact::footprint::FootprintScratch;
use crate::contact::local::cells::{CellScratch, PressureState, Resolution};
use crate::contact::smooth::{FanWeights, FootPoint, SmoothSurface};
use crate::math::pow;
use crate::simulation::MAX_CONTACTS;
use crate::simulation::model::Model;
use crate::simulation::state::BodyState;
use crate::simulation::weight_scratch::neighbourhood;
use crate::tensor::outer;

/// After a step that increases the residual, for tools with pressure cells, the next one from the same position is no longer than
/// this part of it.
const RETRACTION: f64 = 0.5;

/// Trust region of the steps.
pub struct TrustRegion {
    /// The least residual so far, m.
    pub least_residual: f64,
    /// Longest next step, m.
    pub longest_step: f64,
}

impl Default for TrustRegion {
    fn default() -> Self {
        Self { least_residual: f64::INFINITY, longest_step: f64::INFINITY }
    }
}

/// Memory of Newton's method.
pub struct LocalScratch {
    /// The body that the fans in `weights` belong to.
    body: Option<usize>,
    pub(super) weights: Vec<FanWeights>,
    pub(super) responses: Vec<LocalResponse>,
    /// Compliance between contacts, m/N.
    pub(super) between: Box<[[DMat3; MAX_CONTACTS]; MAX_CONTACTS]>,
    /// Compliance of one step less the static one, on a body in motion, with the coupling on the diagonal, m/N.
    pub(super) step_change: Box<[[DMat3; MAX_CONTACTS]; MAX_CONTACTS]>,
    pub(super) others: [OtherContacts; MAX_CONTACTS],
    /// Positions of the tools over the surface at rest if no contact had a force, m; the present ones; Newton's steps.
    pub(super) free_positions: [DVec3; MAX_CONTACTS],
    pub(super) positions: [DVec3; MAX_CONTACTS],
    pub(super) steps: [DVec3; MAX_CONTACTS],
    /// Forces from which responses are evaluated, N, and the derivatives of these by the positions, N/m.
    pub(super) guessed: [DVec3; MAX_CONTACTS],
    pub(super) jacobians: [DMat3; MAX_CONTACTS],
    pub(super) pace: Pace,
    pub(super) acceleration: Acceleration,
    /// The positions and responses with the least residual so far, for tools with pressure cells.
    best: Vec<(DVec3, LocalResponse)>,
    /// Whether there is one.
    pub(super) has_best: bool,
    /// Largest difference of a force from its linear extrapolation, over that force.
    pub(super) force_change: f64,
    /// Steps of Newton's method for the latest body.
    pub newton_steps: usize,
    pub(super) cells: Box<CellScratch>,
    /// Resolution of cells; none where no contact of the body needs them.
    pub(super) cell_resolution: Option<Resolution>,
    /// The pieces next to the latest tool, and the slot of its contact.
    pub footprint: FootprintScratch,
    pub pressed_slot: Option<usize>,
    /// Weights of the share of a sphere's contact that is on cells.
    pub(super) corner_weights: FanWeights,
    /// Placeholder for contacts without cells.
    pub(super) no_pressures: PressureState,
}

impl LocalScratch {
    /// Weights of the fans around a foot that no contact has.
    pub fn weigh(&mut self, body: usize, smooth: &SmoothSurface, foot: &FootPoint) -> &FanWeights {
        self.select_body(body);
        smooth.weigh(foot, &mut self.weights[0]);
        &self.weights[0]
    }

    /// Selects a body; stored fans of another one become invalid.
    pub(super) fn select_body(&mut self, body: usize) {
        if self.body != Some(body) {
            self.body = Some(body);
            self.weights.iter_mut().for_each(|weights| weights.near.invalidate());
        }
    }

    /// Takes the step, and extrapolates forces and offsets linearly. A whole step with higher orders of a body's displacement is
    /// accelerated.
    pub(super) fn take_step(&mut self, count: usize, is_whole: bool) {
        let accelerates = is_whole && self.responses[..count].iter().any(LocalResponse::has_higher_orders);
        if !accelerates {
            self.acceleration.reset();
        }
        let has_previous = accelerates && self.acceleration.begin(count);
        let mut previous = [Iterate::default(); MAX_CONTACTS];
        for a in 0..count {
            let before = self.responses[a].guessed(self.positions[a]);
            self.positions[a] += self.steps[a];
            let response = &mut self.responses[a];
            response.force += response.jacobian * self.steps[a];
            response.friction.force += response.friction_by_position * self.steps[a];
            response.offset += response.offset_by_position * self.steps[a];
            if accelerates {
                let compliance = 1.0 / response.indentation.stiffness.max(f64::MIN_POSITIVE);
                let result = response.iterate(self.positions[a]);
                previous[a] = self.acceleration.take(a, &before, &result, compliance);
            }
        }
        if has_previous {
            let share = self.acceleration.share();
            for a in 0..count {
                let [position, ..] = self.responses[a].extrapolate(self.positions[a], &previous[a], -share);
                self.positions[a] = position;
            }
        }
    }

    /// Accepts or rejects a step of tools with pressure cells by its residual. After a rejected one the next starts from the same
    /// positions with updated Jacobians. Returns whether another step follows: not after the last, nor after one that is not
    /// finite.
    pub(super) fn accept_step(&mut self, count: usize, last: bool, trust: &mut TrustRegion) -> bool {
        let residual = self.largest_residual(count);
        // Where nothing touches there is no Jacobian to return with, so that a first touch is always accepted, but for the last
        // step.
        let newly_touching = !last && self.newly_touching(count);
        let worse = residual > trust.least_residual && !newly_touching;
        if !residual.is_finite() || (worse && last) {
            self.retract_step(count, if last { 0.0 } else { RETRACTION });
            return false;
        }
        if worse {
            trust.longest_step = RETRACTION * self.return_to_best(count);
        } else {
            *trust = TrustRegion { least_residual: residual, longest_step: f64::INFINITY };
            self.store_best(count);
        }
        true
    }

    /// Residual of a contact's equation at the present positions, m.
    pub(super) fn residual(&self, a: usize, count: usize) -> DVec3 {
        let moved: DVec3 = (0..count).map(|b| self.between[a][b] * self.responses[b].force).sum();
        self.positions[a] - self.free_positions[a] + moved + self.responses[a].higher.displacement
    }

    /// Largest of these, m.
    fn largest_residual(&self, count: usize) -> f64 {
        (0..count)
            .map(|a| self.residual(a, count).length())
            .fold(0.0, |most: f64, residual| if residual.is_nan() { residual } else { most.max(residual) })
    }

    /// Whether a tool touches that did not at the best positions.
    fn newly_touching(&self, count: usize) -> bool {
        (0..count).any(|a| self.best[a].1.force == DVec3::ZERO && self.responses[a].force != DVec3::ZERO)
    }

    /// Lengthens steps out of the surface. Where the force is much too large, the linear step of Newton's method removes only a
    /// part of the depth, for the force grows as `d^m`. The depth `d_0` is that of `m = 3/2`, or that of the tool if it is less, as
    /// for a flat one. With `x = d/d_0`, `c = C F_0/d_0` and the residual `r`, the next depth is that of `x + c x^m = 1 + c -
    /// r/d_0`. Returns the longest step, m.
    pub(super) fn lengthen_by_power_law(&mut self, count: usize) -> f64 {
        let mut longest_step = 0.0f64;
        for a in 0..count {
            let response = &self.responses[a];
            let (normal, indentation) = (response.normal, &response.indentation);
            let of_power = 1.5 * indentation.force / indentation.stiffness;
            let depth = of_power.min(indentation.depth);
            let outward = self.steps[a].dot(normal);
            if depth > 0.0 && depth.is_finite() && outward > 0.0 {
                let power = (indentation.stiffness * depth / indentation.force).max(1.0);
                let c = (normal.dot(self.between[a][a] * normal) * indentation.force / depth).max(0.0);
                // The residual follows from Newton's own step.
                let right = (1.0 + c - outward * (1.0 + power * c) / depth).max(0.0);
                let mut x = 1.0f64;
                for _ in 0..6 {
                    let rise = c * pow(x, power - 1.0);
                    x = (x - (x + rise * x - right) / (1.0 + power * rise)).max(0.0);
                }
                self.steps[a] += normal * ((1.0 - x) * depth - outward);
            }
            longest_step = longest_step.max(self.steps[a].length());
        }
        longest_step
    }

    /// Stores positions and responses as the best ones, with Broyden's update of the Jacobian along the last step.
    fn store_best(&mut self, count: usize) {
        for a in 0..count {
            let (place, before) = self.best[a];
            let (response, step) = (&mut self.responses[a], self.positions[a] - place);
            let squared = step.length_squared();
            if self.has_best && response.force == DVec3::ZERO && before.force == DVec3::ZERO {
                // No force at either position: the Jacobian stays.
                response.jacobian = before.jacobian;
            } else if self.has_best && squared > 0.0 {
                let deviation = response.force - before.force - response.jacobian * step;
                response.jacobian += outer(deviation, step) * (1.0 / squared);
            }
            self.best[a] = (self.positions[a], self.responses[a]);
        }
        self.has_best = true;
    }

    /// Returns to the best positions, with Broyden's update of their Jacobians. Returns the longest step, m.
    fn return_to_best(&mut self, count: usize) -> f64 {
        let mut longest_step = 0.0f64;
        for a in 0..count {
            let (place, before) = &mut self.best[a];
            let step = self.positions[a] - *place;
            if step.length_squared() > 0.0 {
                let deviation = self.responses[a].force - before.force - before.jacobian * step;
                before.jacobian += outer(deviation, step) * (1.0 / step.length_squared());
            }
            longest_step = longest_step.max(step.length());
            (self.positions[a], self.responses[a]) = (*place, *before);
        }
        longest_step
    }

    /// Returns to the best positions plus a part of the step from there.
    fn retract_step(&mut self, count: usize, part: f64) {
        for a in 0..count {
            let (place, before) = self.best[a];
            let step = self.positions[a] - place;
            self.positions[a] = if part > 0.0 && step.is_finite() { place + step * part } else { place };
            self.responses[a] = before;
            self.responses[a].force += before.jacobian * (self.positions[a] - place);
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
            step_change: Box::new([[DMat3::ZERO; MAX_CONTACTS]; MAX_CONTACTS]),
            others: [OtherContacts::default(); MAX_CONTACTS],
            free_positions: [DVec3::ZERO; MAX_CONTACTS],
            positions: [DVec3::ZERO; MAX_CONTACTS],
            steps: [DVec3::ZERO; MAX_CONTACTS],
            guessed: [DVec3::ZERO; MAX_CONTACTS],
            jacobians: [DMat3::ZERO; MAX_CONTACTS],
            pace: Pace::default(),
            acceleration: Acceleration::default(),
            best: vec![(DVec3::ZERO, LocalResponse::default()); MAX_CONTACTS],
            has_best: false,
            force_change: 0.0,
            newton_steps: 0,
            cells: Box::default(),
            cell_resolution: None,
            footprint: FootprintScratch::default(),
            pressed_slot: None,
            corner_weights: FanWeights::new(neighbourhood(model)),
            no_pressures: PressureState::default(),
        }
    }
}

/// Data of a body for a tool; `None` if the local law is not prepared.
pub fn local_body<'a>(model: &'a Model, bodies: &'a [BodyState], tool: usize, body: usize) -> Option<LocalBody<'a>> {
    let (fixed, state, tool_model) = (&model.bodies[body], &bodies[body], &model.tools[tool]);
    let local = fixed.local.as_ref()?;
    let regular = model.regular_compliances[tool][body].as_deref()?;
    // A body in motion is displaced by its modes, which are linear.
    let has_series = !fixed.moves() && !tool_model.shape.needs_cells();
    let series = has_series.then(|| state.series(tool_model.radius)).flatten();
    Some(LocalBody {
        drawn: fixed.drawn(),
        smooth: &local.smooth,
        fields: &regular.fields,
        series: series.map(|series| &series.fields[..]),
        pressed_surface: model.pressed_surfaces[tool][body].as_deref(),
        corners: model.corner_surfaces[tool][body].as_deref(),
        edges: model.convex_edges[tool][body].as_deref(),
        scale: state.stiffness_scale,
        is_hyperelastic: local.is_hyperelastic,
    })
}
