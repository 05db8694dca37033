//! Further places of a tool: in a groove, a fold or a corner it touches a surface at several places at once.
//!
//! Each place is a contact of its own, with its foot, friction and history; they are solved together, as those of several tools
//! are. One is looked for from the few nodes that a hollow has (`contact::Hollows`), and taken up before the tool touches it:
//! it waits without a force, which then rises from zero with the approach. One that is found with the tool deeper in it than the
//! tool can have come since counts from there. So a force begins at zero whatever the surface does, and no place makes energy.
//!
//! A tool that is no sphere presses all that lies under one plane at once. Another place is a wall that stands on that plane: it is
//! found among the pieces next to the tool.
//!
//! A place is on the side of the surface that the tool has come from: its normal faces the tool's middle. The far side of a thin
//! part never does.

use glam::{DMat3, DVec3};

use super::contacts::{Contact, Mode};
use super::covering::Covering;
use super::law::{ASKED, LocalContact};
use super::model::Model;
use super::scratch::Scratch;
use super::solve::{DEEPEST, add_contact, dent_at};
use super::state::State;
use super::tool::LawKind;
use super::{MAX_CONTACTS, MAX_PLACES};
use crate::contact::Hollows;
use crate::contact::footprint::{PosedShape, PressedSurface};
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
    if let (Some(pressed), Some(&slot)) = (model.pressed[tool][body].as_deref(), places[..count].first()) {
        return find_wall(model, state, scratch, pressed, (slot, &places[..count]));
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
    // The first place of a tool is known from the tick after it has begun.
    let before = state.tools[tool].before.map(|before| fixed.placement.point_to_body(before.position));
    let before = before.unwrap_or(local.tool);
    let came = 2.0 * local.tool.distance(before);
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

/// Looks for a wall that stands on the planes that a tool presses on, which it has come near to.
fn find_wall(
    model: &Model,
    state: &mut State,
    scratch: &mut Scratch,
    pressed: &PressedSurface,
    (slot, places): (usize, &[usize]),
) {
    let Contact { tool, body, local, .. } = state.contacts.slots[slot];
    let (fixed, shape) = (&model.bodies[body], &model.tools[tool].shape);
    let Some(own) = &fixed.local else { return };
    if places.len() >= MAX_PLACES {
        return;
    }
    let mut planes = [local.plane(); MAX_CONTACTS];
    for (plane, &slot) in planes.iter_mut().zip(places) {
        *plane = state.contacts.slots[slot].local.plane();
    }
    let Covering { footprint, weights, .. } = &mut scratch.covering;
    let at = PosedShape {
        shape,
        place: local.relative + local.advance,
        rotation: DMat3::from_quat(local.orientation),
        facing: DVec3::ZERO,
        sunk: 0.0,
    };
    footprint.near.gather(pressed, &fixed.query, &at);
    let Some((plane, distance)) = footprint.wall_beside(&planes[..places.len()]) else { return };
    let Some(found) = footprint.find(&pressed.fine, &own.smooth, plane, weights) else { return };
    if weights.is_outside() {
        return;
    }
    let before = state.tools[tool].before.map(|before| fixed.placement.point_to_body(before.position));
    let came = 2.0 * local.tool.distance(before.unwrap_or(local.tool));
    let local = LocalContact {
        relative: at.place,
        entry: (-distance - came).max(0.0),
        foot: found.foot(at.place),
        ..begun(&local)
    };
    let begun = further_contact((tool, body), local);
    add_contact(model, state, begun, &scratch.covering);
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
