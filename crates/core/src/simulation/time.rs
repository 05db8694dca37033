//! Time of a body in motion: strikes begin, steps come due, begin and end. A body at rest answers at once.

use super::body::TIME_STEPS;
use super::covering::Covering;
use super::input::{Controls, Input};
use super::model::Model;
use super::scratch::Scratch;
use super::state::State;
use crate::contact::patch_weights;

/// Begins a strike where the input asks for one; one that finds no room (`State::has_room_for_strike`) is left out.
pub(super) fn begin_strike(model: &Model, state: &mut State, scratch: &mut Scratch, body: usize, input: &Input) {
    let (Some(strike), fixed) = (&input.controls.strike, &model.bodies[body]) else { return };
    let (Some(dynamics), Some(motion)) = (&fixed.dynamics, &mut state.bodies[body].motion) else { return };
    if strike.body != body || !(strike.point.is_finite() && strike.impulse.is_finite()) {
        return;
    }
    let Some(closest) = fixed.closest(fixed.placement.point_to_body(strike.point)) else { return };
    let centre = fixed.material_point(&closest);
    let Covering { patches, candidate, .. } = &mut scratch.covering;
    let surface = &fixed.green.surface;
    let weighed = patch_weights(surface, &fixed.geometry, &centre, strike.radius, &mut patches[body], candidate);
    if weighed.is_ok() {
        let impulse = fixed.placement.vector_to_body(strike.impulse);
        motion.begin_strike(&dynamics.modes, candidate, impulse, strike.duration);
    }
}

/// Lets body time pass; a reset brings the body to rest.
pub(super) fn pass_time(model: &Model, state: &mut State, body: usize, controls: &Controls) {
    if let (Some(dynamics), Some(motion)) = (&model.bodies[body].dynamics, &mut state.bodies[body].motion) {
        motion.due += if controls.advance > 0.0 { controls.advance.min(*TIME_STEPS.end()) } else { 0.0 };
        if controls.reset {
            motion.rest(&dynamics.modes);
        }
    }
}

/// Whether a step of a body in motion has come due, and begins; true for one that does not move.
pub(super) fn begin_step(model: &Model, state: &mut State, body: usize) -> bool {
    let (Some(dynamics), Some(motion)) = (&model.bodies[body].dynamics, &mut state.bodies[body].motion) else {
        return true;
    };
    // A thousandth of a step forgives the rounding of many small advances.
    let due = motion.due > 0.999 * dynamics.modes.dt;
    if due {
        motion.due -= dynamics.modes.dt;
        motion.time += dynamics.modes.dt;
    }
    due
}

/// Ends a step of a body in motion. False for one that does not move: a single answer is all there is.
pub(super) fn end_step(model: &Model, state: &mut State, body: usize) -> bool {
    let State { bodies, contacts, .. } = state;
    let (Some(dynamics), Some(motion)) = (&model.bodies[body].dynamics, &mut bodies[body].motion) else { return false };
    motion.advance(&dynamics.modes, dynamics.coupling, contacts, body);
    true
}
