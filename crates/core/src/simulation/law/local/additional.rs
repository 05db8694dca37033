//! Additional contacts of a tool: in a groove, a fold or a corner it touches a surface at several places at once.
//!
//! Each place is a contact of its own, with its foot, friction and history; they are solved together, as those of several tools
//! are. The search starts from the few nodes listed for a concavity (`contact::Concavities`). A contact begins before the tool
//! touches: it is pending without a force, which then rises from zero with the approach. If the tool is deeper there than it can
//! have moved since the last search, the approach counts from that depth. So a force starts from zero whatever the surface, and
//! an additional contact releases no energy.
//!
//! A contact of a tool that is not a sphere covers all that lies under one plane. An additional one is a wall that stands on that
//! plane: it is found among the pieces next to the tool after the plane has been pressed.
//!
//! A contact lies on the side of the surface that the tool came from: its normal faces the tool's middle. The far side of a thin
//! part never does.

use glam::DVec3;

use super::add_contact;
use super::foot_jumps::{DEEPEST_START, are_merged_planes};
use super::wrench::{largest_overlap, placed_shape};
use crate::contact::Concavities;
use crate::contact::footprint::{OtherPlanes, PlacedShape, Plane};
use crate::contact::smooth::FootPoint;
use crate::simulation::MAX_PLACES;
use crate::simulation::contacts::{Contact, Contacts, LocalContact, Mode, STRAIN_REQUESTS, SlotList};
use crate::simulation::law::TickMemory;
use crate::simulation::model::Model;
use crate::simulation::solve::contact_displacement_at;
use crate::simulation::state::State;
use crate::simulation::tool::LawKind;

/// Distance of the tool, over its radius, within which a contact is added as pending.
const PENDING_DISTANCE: f64 = 0.4;
/// Least distance of two contacts, over the tool's radius, and largest cosine of the angle between their normals.
const LEAST_DISTANCE: f64 = 0.25;
const PARALLEL: f64 = 0.97;
/// Most steps in which the plane of a wall is found, and the cosine of its turn from which on it is settled.
const WALL_STEPS: usize = 4;
const SETTLED: f64 = 0.999;

/// Adds contacts of a sphere at further places that it is near to.
pub fn find_additional_contacts(
    model: &Model,
    state: &mut State,
    mut memory: TickMemory<'_>,
    (tool, body): (usize, usize),
) {
    let concavities = &model.concavities[tool][body];
    let lasts = |contact: &Contact| contact.law == LawKind::LOCAL && !contact.local.is_fading;
    let lasting = state.contacts.of(tool, body).filter(|&slot| lasts(&state.contacts.slots[slot]));
    let slots = SlotList::of(lasting);
    memory.weight_scratch.near.invalidate();
    for &slot in slots.iter() {
        find_beside(model, state, &mut memory, concavities, slot);
    }
}

/// Searches for contacts beside the one in `slot`.
fn find_beside(model: &Model, state: &mut State, memory: &mut TickMemory<'_>, concavities: &Concavities, slot: usize) {
    if concavities.starts(state.contacts.slots[slot].local.foot.triangle).is_empty() {
        return;
    }
    let Contact { tool, body, local, .. } = state.contacts.slots[slot];
    let (fixed, radius) = (&model.bodies[body], model.tools[tool].radius);
    let Some(own) = &fixed.local else { return };
    let reachable_depth = depth_reachable_in_tick(model, state, (tool, body), &local);
    for &start in concavities.starts(local.foot.triangle) {
        let lasting = state.contacts.of(tool, body).filter(|&slot| !state.contacts.slots[slot].local.is_fading).count();
        if lasting >= MAX_PLACES {
            return;
        }
        let fan = &own.smooth.fans()[start as usize];
        let from = FootPoint { triangle: fan.triangle, ..FootPoint::at(fan.position, fan.normal) };
        let (drawn, near) = (fixed.drawn(), &mut memory.weight_scratch.near);
        let mut foot_at = |at: DVec3, from: &FootPoint| {
            let foot = own.smooth.foot(drawn, at, from, near)?;
            Some((foot, radius - foot.distance))
        };
        // First with the displacement of the body at the known contact, then with that at the new one.
        let mut at = local.relative_position + local.last_step;
        let Some((mut foot, mut depth)) = foot_at(at, &from) else { continue };
        if !is_separate(state, (tool, body), &foot, radius) {
            continue;
        }
        if !fixed.moves() {
            let weights = memory.local.weigh(body, &own.smooth, &foot);
            at = local.tool_position - contact_displacement_at(model, state, body, weights);
            let Some(updated) = foot_at(at, &foot) else { continue };
            (foot, depth) = updated;
        }
        let touchable = !memory.local.weigh(body, &own.smooth, &foot).is_outside();
        let near = depth > -PENDING_DISTANCE * radius && depth < DEEPEST_START * radius;
        if touchable && near && is_separate(state, (tool, body), &foot, radius) {
            let local = LocalContact {
                relative_position: at,
                foot,
                is_new: true,
                reachable_depth,
                previous_orientation: local.previous_orientation,
                ..local_state(&local)
            };
            add_contact(state, additional_contact((tool, body), local));
        }
    }
}

/// Adds a contact with a wall that stands on the planes that a tool presses on, if the tool is near to it. The pieces are those
/// next to the tool that was pressed last.
pub fn find_wall_contact(model: &Model, state: &mut State, memory: TickMemory<'_>, body: usize) {
    let Some(slot) = memory.local.pressed_slot.take() else { return };
    let Contact { mode, tool, local, .. } = state.contacts.slots[slot];
    let (Some(pressed_surface), Some(own)) = (model.pressed_surfaces[tool][body].as_deref(), &model.bodies[body].local)
    else {
        return;
    };
    if mode == Mode::Free || state.contacts.of(tool, body).count() >= MAX_PLACES {
        return;
    }
    let footprint = &mut memory.local.footprint;
    footprint.others = other_planes(&state.contacts, slot);
    let Some(plane) = footprint.wall_beside(&local.plane(), model.tools[tool].shape.thickness()) else { return };
    if let Some(own) = footprint.others.iter_mut().find(|other| other.is_none()) {
        *own = Some(local.plane());
    }
    let placed = placed_shape(&model.tools[tool].shape, &local, local.relative_position);
    let weights = &mut memory.weight_scratch.weights;
    let mut wall_on = |plane: Plane| {
        let at = PlacedShape { contact_normal: plane.normal, penetration: 0.0, ..placed };
        footprint.near.find(pressed_surface, &model.bodies[body].query, &at);
        footprint.find(&at, (&pressed_surface.fine, &own.smooth), plane, weights)
    };
    // The plane of a single piece turns to that of all those around it.
    let Some(mut wall) = wall_on(plane) else { return };
    for _ in 1..WALL_STEPS {
        let Some(turned) = wall_on(Plane { point: wall.origin, normal: wall.normal }) else { return };
        let is_settled = turned.normal.dot(wall.normal) > SETTLED;
        wall = turned;
        if is_settled {
            break;
        }
    }
    let is_parallel = |other: &Plane| are_merged_planes(other.normal, wall.normal);
    if weights.is_outside() || footprint.others.iter().flatten().any(is_parallel) {
        return;
    }
    // The force starts from zero: overlap beyond the depth that the tool can have reached does not count.
    let (shape, cells) = (&model.tools[tool].shape, &mut memory.local.cells);
    let pose = (shape, local.relative_position, local.orientation);
    let overlap = largest_overlap(&pressed_surface.fine, pose, &wall, &footprint.near, cells);
    let entry_depth = (overlap - depth_reachable_in_tick(model, state, (tool, body), &local)).max(0.0);
    let local = LocalContact {
        relative_position: local.relative_position,
        entry_depth,
        foot: wall.foot(local.relative_position),
        ..local_state(&local)
    };
    add_contact(state, additional_contact((tool, body), local));
}

/// Planes of the other contacts of a contact's tool on its body.
pub fn other_planes(contacts: &Contacts, slot: usize) -> OtherPlanes {
    let Contact { tool, body, .. } = contacts.slots[slot];
    let mut planes = OtherPlanes::default();
    let lasting = |&other: &usize| other != slot && !contacts.slots[other].local.is_fading;
    for (plane, other) in planes.iter_mut().zip(contacts.of(tool, body).filter(lasting)) {
        *plane = Some(contacts.slots[other].local.plane());
    }
    planes
}

/// Depth that a tool can have reached since the previous tick, m.
fn depth_reachable_in_tick(model: &Model, state: &State, (tool, body): (usize, usize), local: &LocalContact) -> f64 {
    // The previous pose is known from the second tick of the tool on.
    let before =
        state.tools[tool].previous_pose.map(|before| model.bodies[body].placement.point_to_body(before.position));
    2.0 * local.tool_position.distance(before.unwrap_or(local.tool_position))
}

/// Initial state of an additional contact, from a known one of the same tool.
fn local_state(known: &LocalContact) -> LocalContact {
    LocalContact {
        tool_position: known.tool_position,
        orientation: known.orientation,
        previous_orientation: known.orientation,
        part: 1.0,
        ..LocalContact::default()
    }
}

fn additional_contact(pair: (usize, usize), local: LocalContact) -> Contact {
    Contact {
        nonlinear: true,
        additional: true,
        point: local.foot.position,
        normal: local.foot.normal,
        anchor: local.tool_position,
        bound: f64::INFINITY,
        strain_requests: [local.foot.position; STRAIN_REQUESTS],
        local,
        ..Contact::new(LawKind::LOCAL, pair)
    }
}

/// Whether a foot is separate from those of all contacts of a tool: at a distance, and with another normal.
fn is_separate(state: &State, (tool, body): (usize, usize), foot: &FootPoint, radius: f64) -> bool {
    if foot.on_crease {
        return false;
    }
    state.contacts.of(tool, body).map(|slot| &state.contacts.slots[slot]).filter(|known| !known.local.is_fading).all(
        |known| {
            let distance = foot.position.distance(known.local.foot.position);
            let cosine = foot.normal.dot(known.local.foot.normal);
            distance > (LEAST_DISTANCE * radius).max(known.radius) && cosine < PARALLEL
        },
    )
}
