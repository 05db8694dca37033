//! Further places of a tool: in a groove, a fold or a corner it touches a surface at several places at once.
//!
//! Each place is a contact of its own, with its foot, friction and history; they are solved together, as those of several tools
//! are. One is looked for from the few nodes that a hollow has (`contact::Hollows`), and taken up before the tool touches it:
//! it waits without a force, which then rises from zero with the approach. One that is found with the tool deeper in it than the
//! tool can have come since counts from there. So a force begins at zero whatever the surface does, and no place makes energy.
//!
//! A tool that is no sphere presses all that lies under one plane at once. Another place is a wall that stands on that plane: it is
//! found among the pieces next to the tool when that has been pressed.
//!
//! A place is on the side of the surface that the tool has come from: its normal faces the tool's middle. The far side of a thin
//! part never does.

use glam::DVec3;

use super::contacts::{Contact, Mode};
use super::law::{ASKED, LocalContact, posed};
use super::model::Model;
use super::scratch::Scratch;
use super::solve::{DEEPEST, add_contact, dent_at};
use super::state::State;
use super::tool::LawKind;
use super::{MAX_CONTACTS, MAX_PLACES};
use crate::contact::Hollows;
use crate::contact::footprint::PosedShape;
use crate::contact::smooth::FootPoint;

/// A place waits from where the tool is as near as this, over the tool's radius.
const NEAR: f64 = 0.4;
/// Least distance of two places, over the tool's radius, and largest cosine of the angle between their normals.
const LEAST_DISTANCE: f64 = 0.25;
const APART: f64 = 0.97;

/// Takes up places that a tool is near beside those it has.
pub fn find(model: &Model, state: &mut State, scratch: &mut Scratch, (tool, body): (usize, usize)) {
    let hollows = &model.hollows[tool][body];
    let mut places = [0; MAX_CONTACTS];
    let mut count = 0;
    for slot in state.contacts.of(tool, body) {
        let contact = &state.contacts.slots[slot];
        if contact.law == LawKind::Local && !contact.local.held {
            places[count] = slot;
            count += 1;
        }
    }
    scratch.covering.near.forget();
    for &slot in &places[..count] {
        find_beside(model, state, scratch, hollows, slot);
    }
}

/// Looks for places from the one in `slot`.
fn find_beside(model: &Model, state: &mut State, scratch: &mut Scratch, hollows: &Hollows, slot: usize) {
    let Contact { tool, body, local, .. } = state.contacts.slots[slot];
    let (fixed, radius) = (&model.bodies[body], model.tools[tool].radius);
    let Some(own) = &fixed.local else { return };
    let came = most_come(model, state, (tool, body), &local);
    for &start in hollows.starts(local.foot.triangle) {
        let lasting = state.contacts.of(tool, body).filter(|&slot| !state.contacts.slots[slot].local.held).count();
        if lasting >= MAX_PLACES {
            return;
        }
        let fan = &own.smooth.fans()[start as usize];
        let from = FootPoint { triangle: fan.triangle, ..FootPoint::at(fan.position, fan.normal) };
        let (drawn, near) = (fixed.drawn(), &mut scratch.covering.near);
        let mut foot_at = |at: DVec3, from: &FootPoint| {
            let foot = own.smooth.foot(drawn, at, from, near)?;
            Some((foot, radius - foot.distance))
        };
        // As if the body were carried along there as it is below the place that is known; then as it is.
        let mut at = local.relative + local.advance;
        let Some((mut foot, mut depth)) = foot_at(at, &from) else { continue };
        if !is_another(state, (tool, body), &foot, radius) {
            continue;
        }
        if !fixed.moves() {
            let weights = scratch.local.weigh(body, &own.smooth, &foot);
            at = local.tool - dent_at(model, state, body, weights);
            let Some(found) = foot_at(at, &foot) else { continue };
            (foot, depth) = found;
        }
        let touchable = !scratch.local.weigh(body, &own.smooth, &foot).is_outside();
        let near = depth > -NEAR * radius && depth < DEEPEST * radius;
        if touchable && near && is_another(state, (tool, body), &foot, radius) {
            let local = LocalContact { relative: at, foot, found: true, came, turned: local.turned, ..begun(&local) };
            add_contact(model, state, further_contact((tool, body), local), &scratch.covering);
        }
    }
}

/// Takes up a wall that stands on the planes that a tool presses on, where the tool has come near to it. The pieces are those
/// next to the tool that has been pressed last.
pub fn find_wall(model: &Model, state: &mut State, scratch: &mut Scratch, body: usize) {
    let Some(slot) = scratch.local.pressed.take() else { return };
    let Contact { mode, tool, local, .. } = state.contacts.slots[slot];
    let (Some(pressed), Some(own)) = (model.pressed[tool][body].as_deref(), &model.bodies[body].local) else { return };
    let mut planes = [local.plane(); MAX_PLACES];
    let mut count = 0;
    for place in state.contacts.of(tool, body) {
        if count == MAX_PLACES {
            return;
        }
        planes[count] = state.contacts.slots[place].local.plane();
        count += 1;
    }
    if mode == Mode::Free || count == MAX_PLACES {
        return;
    }
    let footprint = &mut scratch.local.footprint;
    let Some((plane, distance)) = footprint.wall_beside(&planes[..count]) else { return };
    let contact = posed(&model.tools[tool].shape, &local, local.relative);
    let at = PosedShape { place: local.relative, facing: plane.normal, sunk: 0.0, ..contact };
    footprint.near.gather(pressed, &model.bodies[body].query, &at);
    let weights = &mut scratch.covering.weights;
    let Some(found) = footprint.find(&pressed.fine, &own.smooth, plane, weights) else { return };
    if weights.is_outside() {
        return;
    }
    let entry = (-distance - most_come(model, state, (tool, body), &local)).max(0.0);
    let local = LocalContact { relative: local.relative, entry, foot: found.foot(local.relative), ..begun(&local) };
    add_contact(model, state, further_contact((tool, body), local), &scratch.covering);
}

/// How deep a tool can have come into a place since the tick before, m.
fn most_come(model: &Model, state: &State, (tool, body): (usize, usize), local: &LocalContact) -> f64 {
    // The first place of a tool is known from the tick after it has begun.
    let before = state.tools[tool].before.map(|before| model.bodies[body].placement.point_to_body(before.position));
    2.0 * local.tool.distance(before.unwrap_or(local.tool))
}

/// What a further place of a tool begins with.
fn begun(known: &LocalContact) -> LocalContact {
    LocalContact {
        tool: known.tool,
        orientation: known.orientation,
        turned: known.orientation,
        further: true,
        part: 1.0,
        share: 1.0,
        ..LocalContact::default()
    }
}

fn further_contact((tool, body): (usize, usize), local: LocalContact) -> Contact {
    Contact {
        mode: Mode::Press,
        law: LawKind::Local,
        tool,
        body,
        point: local.foot.position,
        normal: local.foot.normal,
        anchor: local.tool,
        bound: f64::INFINITY,
        local: LocalContact { asked: [local.foot.position; ASKED], ..local },
        ..Contact::default()
    }
}

/// Whether a foot is another place than those that a tool has: apart from each, and turned against it.
fn is_another(state: &State, (tool, body): (usize, usize), foot: &FootPoint, radius: f64) -> bool {
    if foot.on_crease {
        return false;
    }
    state.contacts.of(tool, body).map(|slot| &state.contacts.slots[slot].local).filter(|known| !known.held).all(
        |known| {
            let apart = foot.position.distance(known.foot.position);
            apart > (LEAST_DISTANCE * radius).max(known.radius) && foot.normal.dot(known.foot.normal) < APART
        },
    )
}
