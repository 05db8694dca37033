//! What becomes of a contact whose closest point is no longer there.
//!
//! Where a surface is hollow with about the tool's radius, or sharper, a minimum of the distance ends in a fold, and the next one
//! is elsewhere; so it does beyond a ridge. The contact then stays on the plane where it was and fades within [`FADING`] ticks,
//! while the next place, if there is one on the same side, comes up by the same part. The approach of the new one counts from
//! that of the old one where it is deeper. So the force has no jump, and both hold no more energy than the one had.
//!
//! Two places whose closest points come together have become one: the further one fades.

use glam::{DMat3, DVec3};

use super::compliance::add_contact;
use crate::contact::shape::ToolShape;
use crate::contact::smooth::FootPoint;
use crate::simulation::contacts::{Contact, Mode};
use crate::simulation::covering::Covering;
use crate::simulation::law::{LocalResponse, depth_below, takes_cells};
use crate::simulation::model::Model;
use crate::simulation::state::State;
use crate::simulation::tool::ToolModel;

/// A place that waits goes where the tool is farther than this, over the tool's radius; one in which the tool is deeper than this
/// when it is found is none: the tool did not come that way.
const FAR: f64 = 0.6;
pub const DEEPEST: f64 = 0.4;
/// Ticks in which a contact fades.
const FADING: f64 = 100.0;
/// Least part of the half-space that a contact has.
const LEAST_PART: f64 = 1e-6;
/// A foot that goes farther in a tick than this many times as far as its tool, and this beyond, over its radius, has jumped.
const STRETCH: f64 = 4.0;
const JUMP: f64 = 0.02;
/// The next place is no farther than this, over the tool's radius, and its normal is turned by no more than this cosine.
const NEXT: f64 = 0.25;
const SAME_SIDE: f64 = 0.3;
/// Feet closer than this, over the tool's radius, are one.
const ONE: f64 = 0.02;
/// Planes of a tool that is no sphere whose normals have a larger cosine than this are one.
const ALIKE: f64 = 0.7;
/// Two places of a tool closer than this, over its radius, are carried along as one the closer they are: nodes do not tell
/// them apart.
const JOINED: f64 = 0.5;

/// What has been found for the contacts of a body.
#[derive(Clone, Copy)]
pub struct Found<'a> {
    pub responses: &'a [LocalResponse],
    pub places: &'a [DVec3],
    pub covering: &'a Covering,
}

/// Whether a foot has come elsewhere than where the tool has gone.
pub fn has_jumped(model: &Model, contact: &Contact, response: &LocalResponse, place: DVec3) -> bool {
    let (own, tool) = (&contact.local, &model.tools[contact.tool]);
    if own.held || own.found || takes_cells(&tool.shape) {
        return false;
    }
    let gone = place.distance(own.relative);
    response.foot.position.distance(own.foot.position) > STRETCH * gone + JUMP * tool.radius
        || response.foot.normal.dot(own.foot.normal) < SAME_SIDE
}

/// Holds the contacts whose feet have jumped, and begins those that take their place; whether there were any.
pub fn hand_over(model: &Model, state: &mut State, found: Found<'_>, slots: &[usize]) -> bool {
    let mut any = false;
    for (a, &slot) in slots.iter().enumerate() {
        let (response, place) = (&found.responses[a], found.places[a]);
        if !has_jumped(model, &state.contacts.slots[slot], response, place) {
            continue;
        }
        any = true;
        let contact = state.contacts.slots[slot];
        if contact.local.force == DVec3::ZERO {
            match contact.local.further {
                true => state.contacts.clear(slot),
                false => {
                    put_elsewhere(&model.tools[contact.tool], &mut state.contacts.slots[slot], &response.foot, place);
                }
            }
            continue;
        }
        hold(&mut state.contacts.slots[slot]);
        if is_known(model, state, found, slots, a) {
            continue;
        }
        let radius = model.tools[contact.tool].radius;
        let near = response.foot.position.distance(contact.local.foot.position) < NEXT * radius;
        if near && response.foot.normal.dot(contact.local.foot.normal) > SAME_SIDE {
            begin_next(model, state, found, &contact, (response, place));
        } else {
            // Another one begins from no force.
            state.tools[contact.tool].entry[contact.body].depth = f64::INFINITY;
        }
    }
    any
}

/// Lets a contact fade where it is.
fn hold(contact: &mut Contact) {
    let own = &mut contact.local;
    (own.held, own.further, own.change) = (true, true, -1.0 / FADING);
}

/// Lets contacts fade for which no place has been found: those with the longest last steps. What takes their place begins from
/// no force.
pub fn hold_lost(state: &mut State, steps: &[DVec3], slots: &[usize]) {
    let longest = steps.iter().map(|step| step.length()).fold(0.0, f64::max);
    for (&slot, step) in slots.iter().zip(steps) {
        let Contact { tool, body, local, .. } = state.contacts.slots[slot];
        if step.length() < 0.5 * longest || local.held {
            continue;
        }
        state.tools[tool].entry[body].depth = f64::INFINITY;
        match local.force == DVec3::ZERO {
            true => state.contacts.clear(slot),
            false => hold(&mut state.contacts.slots[slot]),
        }
    }
}

/// Part by which two places of one tool, so far apart, are carried along as one.
pub fn joined(apart: f64, radius: f64) -> f64 {
    let t = (apart / (JOINED * radius)).min(1.0);
    1.0 - t * t * (3.0 - 2.0 * t)
}

/// Whether another contact of the same tool has the foot that this one has jumped to. One that fades there comes up again.
fn is_known(model: &Model, state: &mut State, found: Found<'_>, slots: &[usize], a: usize) -> bool {
    let (own, foot) = (state.contacts.slots[slots[a]], &found.responses[a].foot);
    let one = ONE * model.tools[own.tool].radius;
    for (b, &slot) in slots.iter().enumerate().filter(|&(b, _)| b != a) {
        let other = &mut state.contacts.slots[slot];
        let near = found.responses[b].foot.position.distance(foot.position) < one;
        if near && (other.tool, other.body) == (own.tool, own.body) {
            if other.local.held {
                (other.local.held, other.local.change) = (false, 1.0 / FADING);
                put_elsewhere(&model.tools[own.tool], other, foot, found.places[b]);
            }
            return true;
        }
    }
    false
}

/// The contact at the place that another one has jumped to, with as much approach at most.
fn begin_next(
    model: &Model,
    state: &mut State,
    found: Found<'_>,
    before: &Contact,
    (response, place): (&LocalResponse, DVec3),
) {
    let tool = &model.tools[before.tool];
    let mut next = *before;
    put_elsewhere(tool, &mut next, &response.foot, place);
    let own = &mut next.local;
    (own.relative, own.advance, own.further) = (place, DVec3::ZERO, true);
    (own.part, own.change) = (LEAST_PART, 1.0 / FADING);
    (own.friction, own.force) = Default::default();
    next.force = DVec3::ZERO;
    add_contact(model, state, next, found.covering);
}

/// Gives a contact another foot. Its approach counts from where it was, if it is deeper there.
fn put_elsewhere(tool: &ToolModel, contact: &mut Contact, foot: &FootPoint, place: DVec3) {
    let before = approach(tool, contact, place);
    contact.local.foot = *foot;
    contact.local.entry += (approach(tool, contact, place) - before).max(0.0);
}

/// How far a tool at a place reaches below the plane through its contact's foot, m.
pub fn approach(tool: &ToolModel, contact: &Contact, place: DVec3) -> f64 {
    let foot = &contact.local.foot;
    match tool.shape {
        ToolShape::Sphere { radius } => radius - (place - foot.position).dot(foot.normal),
        ref shape => depth_below(shape, (place, DMat3::from_quat(contact.local.orientation)), foot),
    }
}

/// Changes the parts of the contacts that fade or come up by a tick. What a tool's contacts gain in energy by coming up is no more
/// than what its others lose by fading: with an energy `part * Phi` at constant places, the stationary value is concave in the
/// part, so that a gain is at most, and a loss at least, the change of the part times `Phi`.
pub fn change_parts(state: &mut State, responses: &[LocalResponse], slots: &[usize]) {
    for comes_up in [false, true] {
        for (a, &slot) in slots.iter().enumerate() {
            let Contact { mode, tool, local, .. } = state.contacts.slots[slot];
            if mode == Mode::Free || local.change == 0.0 || (local.change > 0.0) != comes_up {
                continue;
            }
            let whole = responses[a].indentation.energy / local.part;
            let bound = if whole > 0.0 { state.tools[tool].freed / whole } else { f64::INFINITY };
            let part = (local.part + local.change.min(bound)).clamp(LEAST_PART, 1.0);
            state.tools[tool].freed += (local.part - part) * whole;
            let own = &mut state.contacts.slots[slot].local;
            own.part = part;
            own.change = if own.part < 1.0 { own.change } else { 0.0 };
        }
    }
    for &slot in slots {
        let tool = state.contacts.slots[slot].tool;
        state.tools[tool].freed = 0.0;
    }
}

/// Takes a contact on by a tick; false where it is none any more.
pub fn go_on(tool: &ToolModel, contact: &mut Contact) -> bool {
    let approach = approach(tool, contact, contact.local.relative);
    let own = &mut contact.local;
    if own.found {
        (own.found, own.entry) = (false, (approach - own.came).max(0.0));
        return approach < DEEPEST * tool.radius;
    }
    let touches = contact.force != DVec3::ZERO;
    let fades = own.held && (own.part <= LEAST_PART || !touches);
    let far = own.further && !touches && approach < -FAR * tool.radius;
    !(fades || far)
}

/// Whether two places of a tool have become one: a tool that is no sphere presses all on a plane at once.
fn are_one(tool: &ToolModel, first: &FootPoint, second: &FootPoint) -> bool {
    match takes_cells(&tool.shape) {
        true => first.normal.dot(second.normal) > ALIKE,
        false => first.position.distance(second.position) < ONE * tool.radius,
    }
}

/// Lets the later of two places fade that have become one.
pub fn join(model: &Model, state: &mut State, slots: &[usize]) {
    for (a, &slot) in slots.iter().enumerate() {
        for &other in &slots[..a] {
            let [first, second] = [other, slot].map(|slot| &state.contacts.slots[slot]);
            let touch = first.mode != Mode::Free && second.mode != Mode::Free;
            let same = touch && (first.tool, first.body) == (second.tool, second.body);
            let last = same && !first.local.held && !second.local.held && first.law == second.law;
            if last && are_one(&model.tools[second.tool], &first.local.foot, &second.local.foot) {
                match second.force == DVec3::ZERO {
                    true => state.contacts.clear(slot),
                    false => hold(&mut state.contacts.slots[slot]),
                }
            }
        }
    }
}
