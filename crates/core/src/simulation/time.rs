//! Time steps of a body in motion, and the start of its strikes. A body at rest has none.

use super::body::TIME_STEPS;
use super::input::{Controls, Input};
use super::model::Model;
use super::scratch::Scratch;
use super::state::State;
use super::weight_scratch::WeightScratch;
use crate::contact::patch_weights;

/// Begins a strike that the input requests, if there is room for it (`State::has_room_for_strike`).
pub(super) fn begin_strike(model: &Model, state: &mut State, scratch: &mut Scratch, body: usize, input: &Input) {
    let (Some(strike), fixed) = (&input.controls.strike, &model.bodies[body]) else { return };
    let (Some(dynamics), Some(motion)) = (&fixed.dynamics, &mut state.bodies[body].motion) else { return };
    if strike.body != body || !(strike.point.is_finite() && strike.impulse.is_finite()) {
        return;
    }
    let Some(closest) = fixed.closest(fixed.placement.point_to_body(strike.point)) else { return };
    let centre = fixed.material_point(&closest);
    let WeightScratch { patches, candidate, .. } = &mut scratch.weight_scratch;
    let surface = &fixed.green.surface;
    let weighed = patch_weights(surface, &fixed.geometry, &centre, strike.radius, &mut patches[body], candidate);
    if weighed.is_ok() {
        let impulse = fixed.placement.vector_to_body(strike.impulse);
        motion.begin_strike(&dynamics.modes, candidate, impulse, strike.duration);
    }
}

/// Adds the time of a tick to that due; a reset brings the body to rest.
pub(super) fn pass_time(model: &Model, state: &mut State, body: usize, controls: &Controls) {
    if let (Some(dynamics), Some(motion)) = (&model.bodies[body].dynamics, &mut state.bodies[body].motion) {
        motion.due += if controls.advance > 0.0 { controls.advance.min(*TIME_STEPS.end()) } else { 0.0 };
        if controls.reset {
            motion.bring_to_rest(&dynamics.modes);
        }
    }
}

/// Begins a step of a body in motion if one is due, and returns whether it is; true for a body at rest.
pub(super) fn begin_step(model: &Model, state: &mut State, body: usize) -> bool {
    let (Some(dynamics), Some(motion)) = (&model.bodies[body].dynamics, &mut state.bodies[body].motion) else {
        return true;
    };
    // The tolerance of a thousandth of a step covers the rounding of many small advances.
    let due = motion.due > 0.999 * dynamics.modes.dt;
    if due {
        motion.due -= dynamics.modes.dt;
        motion.time += dynamics.modes.dt;
    }
    due
}

/// Ends a step of a body in motion. False for a body at rest, which has a single solve in a tick.
pub(super) fn end_step(model: &Model, state: &mut State, body: usize) -> bool {
    let State { bodies, contacts, .. } = state;
    let (Some(dynamics), Some(motion)) = (&model.bodies[body].dynamics, &mut bodies[body].motion) else { return false };
    motion.advance(&dynamics.modes, dynamics.coupling, contacts, body);
    true
}
