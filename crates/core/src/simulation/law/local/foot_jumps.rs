//! Contacts whose closest point has jumped: fading of the old contact and start of the new one.
//!
//! Where a surface is concave with about the tool's radius or less, a minimum of the distance ends in a fold, and the next one lies
//! elsewhere; beyond a ridge too. The contact then stays on its plane and fades within [`FADE_TICKS`] ticks. A new contact at the
//! next minimum, if there is one on the same side, grows by the same part. Where it is deeper, its approach counts from that of the
//! old one. So the force does not jump, and both together store no more energy than the old one did.
//!
//! Two contacts whose closest points coincide have merged: the later one fades. One without a force that comes to another ends.
//!
//! Where Newton's method diverges, as under a tool that is pressed deep between two walls of a hollow, the contacts that it has lost
//! stay on their planes too, with the compliance of their places: there is an equilibrium at any depth. They fade with the way of the
//! tool along their planes only, so that a deeper press has more force, and one that ends gives back no more than was put in.

use glam::{DMat3, DVec3};

use super::add_contact;
use super::depth_below;
use super::near_corner::share_of_contact;
use super::response::LocalResponse;
use crate::contact::ConvexEdges;
use crate::contact::shape::ToolShape;
use crate::contact::smooth::FootPoint;
use crate::simulation::contacts::{Contact, LocalContact, Mode};
use crate::simulation::model::Model;
use crate::simulation::state::State;
use crate::simulation::tool::ToolModel;

/// Distance of the tool, over its radius, beyond which a pending contact ends; and depth beyond which a new one is rejected, for
/// the tool did not come from its side.
const PENDING_REACH: f64 = 0.6;
pub const DEEPEST_START: f64 = 0.4;
/// Ticks in which a contact fades.
const FADE_TICKS: f64 = 100.0;
/// Part down to which a contact on its plane holds off the next contact of its tool.
const LASTING_PART: f64 = 0.9;
/// Least part of the half-space that a contact has.
const LEAST_PART: f64 = 1e-6;
/// A foot has jumped if its travel in a tick exceeds this many times that of the tool plus this distance, over the tool's radius.
const JUMP_RATIO: f64 = 4.0;
const JUMP_DISTANCE: f64 = 0.02;
/// Largest distance of a replacement from the old foot, over the tool's radius, and least cosine between their normals.
const REPLACEMENT_DISTANCE: f64 = 0.25;
const SAME_SIDE: f64 = 0.3;
/// Longest snap of a tool over the surface at rest, over its radius. At the next place the force may be twice as large.
const LONGEST_SNAP: f64 = 0.25;
/// Feet closer than this, over the tool's radius, have merged.
const MERGED_DISTANCE: f64 = 0.02;
/// Planes of a tool that is not a sphere have merged if the cosine between their normals is larger than this.
const MERGED_COSINE: f64 = 0.7;
/// Distance of two contacts of a tool, over its radius, below which their compliance goes over to that of one contact: the nodes do
/// not resolve them.
const SHARED_DISTANCE: f64 = 0.5;

/// Solution for the contacts of a body: responses, and positions of the tools over the surface at rest.
#[derive(Clone, Copy)]
pub struct SolvedContacts<'a> {
    pub responses: &'a [LocalResponse],
    pub positions: &'a [DVec3],
}

/// Whether the foot of a contact follows a sphere from tick to tick.
fn foot_is_followed(model: &Model, contact: &Contact) -> bool {
    let (local, tool) = (&contact.local, &model.tools[contact.tool]);
    !(local.is_fading || local.is_new || tool.shape.needs_cells() || share_of_contact(model, contact) == 1.0)
}

/// Whether a foot has gone round a sharp edge, as that of a tool does that snaps over one.
fn has_rounded_edge(model: &Model, contact: &Contact, foot: &FootPoint) -> bool {
    let edges = model.convex_edges[contact.tool][contact.body].as_deref();
    edges.is_some_and(|edges| edges.are_beside_one(&contact.local.foot, foot, contact.depth))
}

/// Whether a sharp edge may slip past one of the spheres.
pub fn any_may_slip(model: &Model, state: &State, slots: &[usize]) -> bool {
    slots.iter().map(|&slot| &state.contacts.slots[slot]).any(|contact| {
        let edges = model.convex_edges[contact.tool][contact.body].as_deref();
        let may_slip = |edges: &ConvexEdges| edges.may_slip(&contact.local.foot, contact.depth);
        foot_is_followed(model, contact) && edges.is_some_and(may_slip)
    })
}

/// Whether a foot has moved much farther than its tool, or to another side.
pub fn foot_has_jumped(model: &Model, contact: &Contact, response: &LocalResponse, place: DVec3) -> bool {
    let (local, tool) = (&contact.local, &model.tools[contact.tool]);
    let travel = place.distance(local.relative_position);
    let has_jumped = response.foot.position.distance(local.foot.position)
        > JUMP_RATIO * travel + JUMP_DISTANCE * tool.radius
        || response.foot.normal.dot(local.foot.normal) < SAME_SIDE;
    has_jumped && foot_is_followed(model, contact) && !has_rounded_edge(model, contact, &response.foot)
}

/// Starts the fading of contacts whose feet have jumped, and begins their replacements. Returns whether there were any.
pub fn replace_jumped_contacts(model: &Model, state: &mut State, solved: SolvedContacts<'_>, slots: &[usize]) -> bool {
    let mut any = false;
    for (a, &slot) in slots.iter().enumerate() {
        let (response, place) = (&solved.responses[a], solved.positions[a]);
        let contact = &state.contacts.slots[slot];
        // One without a force whose foot comes to that of another would be the other once more.
        let is_double = contact.additional
            && contact.local.force == DVec3::ZERO
            && contact_at_same_foot(model, state, solved, slots, a).is_some();
        if !is_double && !foot_has_jumped(model, contact, response, place) {
            continue;
        }
        any = true;
        let contact = *contact;
        if contact.local.force == DVec3::ZERO {
            match contact.additional {
                true => state.contacts.clear(slot),
                false => {
                    move_foot(&model.tools[contact.tool], &mut state.contacts.slots[slot], &response.foot, place);
                }
            }
            continue;
        }
        begin_fading(model, &mut state.contacts.slots[slot]);
        if foot_is_taken(model, state, solved, slots, a) {
            continue;
        }
        let radius = model.tools[contact.tool].radius;
        let near = response.foot.position.distance(contact.local.foot.position) < REPLACEMENT_DISTANCE * radius;
        if near && response.foot.normal.dot(contact.local.foot.normal) > SAME_SIDE {
            begin_replacement(model, state, &contact, (response, place));
        } else {
            // The force of the next contact starts from zero.
            state.tools[contact.tool].entry[contact.body].threshold = f64::INFINITY;
        }
    }
    any
}

/// Starts the fading of a contact, with its foot fixed.
fn begin_fading(model: &Model, contact: &mut Contact) {
    contact.additional = true;
    fix_on_plane(&model.tools[contact.tool], contact, -1.0 / FADE_TICKS);
}

/// Fixes a contact on a plane. Under a sphere this is normal to the force, and the approach to it is the contact's own: the energy stays
/// the same, and the force keeps its direction and becomes that of the half-space alone. With an approach that keeps the whole force
/// too, the energy would rise by up to nine tenths, and passivity would take it back at once.
fn fix_on_plane(tool: &ToolModel, contact: &mut Contact, part_rate: f64) {
    let local = &mut contact.local;
    let push = -(local.force - local.friction.force());
    let straight = push.dot(local.foot.normal);
    (local.is_fading, local.part_rate, local.plane_normal) = (true, part_rate, local.foot.normal);
    local.foot = local.foot.frozen(local.relative_position);
    if straight > 0.0 && !tool.shape.needs_cells() {
        (local.plane_normal, local.offset) = (push.normalize(), DVec3::ZERO);
        let depth = contact_depth(tool, contact, contact.local.relative_position);
        contact.local.entry_depth = depth - contact.local.penetration;
    }
}

/// Fixes contacts for which Newton's method has diverged on their planes: those with the longest last steps. The force of the next
/// contact starts from zero.
pub fn fix_lost_contacts(model: &Model, state: &mut State, steps: &[DVec3], slots: &[usize]) {
    let longest = steps.iter().map(|step| step.length()).fold(0.0, f64::max);
    for (&slot, step) in slots.iter().zip(steps) {
        let contact = &mut state.contacts.slots[slot];
        if step.length() < 0.5 * longest || contact.local.is_fading {
            continue;
        }
        state.tools[contact.tool].entry[contact.body].threshold = f64::INFINITY;
        match contact.local.force == DVec3::ZERO {
            true => state.contacts.clear(slot),
            false => fix_on_plane(&model.tools[contact.tool], contact, 0.0),
        }
    }
}

/// Fixes contacts on their planes whose tools would snap farther over the surface at rest, away from sharp edges, than
/// [`LONGEST_SNAP`]. Returns whether there were any.
pub fn fix_snapping_contacts(model: &Model, state: &mut State, solved: SolvedContacts<'_>, slots: &[usize]) -> bool {
    let mut any = false;
    for (a, &slot) in slots.iter().enumerate() {
        let contact = &state.contacts.slots[slot];
        let (local, tool) = (&contact.local, &model.tools[contact.tool]);
        let snap = solved.positions[a].distance(local.relative_position) - local.way.length();
        let is_long = snap > LONGEST_SNAP * tool.radius && local.force != DVec3::ZERO;
        if is_long && foot_is_followed(model, contact) && !has_rounded_edge(model, contact, &solved.responses[a].foot) {
            fix_on_plane(tool, &mut state.contacts.slots[slot], 0.0);
            any = true;
        }
    }
    any
}

/// Whether a contact on its plane has faded so little that its tool begins no other one.
pub fn lasts_on_its_plane(contact: &Contact) -> bool {
    !contact.additional && contact.local.part_rate == 0.0 && contact.local.part > LASTING_PART
}

/// Part by which the compliance of two contacts of one tool at a distance is that of one contact.
pub fn merge_share(distance: f64, radius: f64) -> f64 {
    let t = (distance / (SHARED_DISTANCE * radius)).min(1.0);
    1.0 - t * t * (3.0 - 2.0 * t)
}

/// Another contact of the same tool whose foot is that of this one, by its rank in `slots`.
fn contact_at_same_foot(
    model: &Model,
    state: &State,
    solved: SolvedContacts<'_>,
    slots: &[usize],
    a: usize,
) -> Option<usize> {
    let (contact, foot) = (&state.contacts.slots[slots[a]], &solved.responses[a].foot);
    let merged = MERGED_DISTANCE * model.tools[contact.tool].radius;
    (0..slots.len()).filter(|&b| b != a).find(|&b| {
        let other = &state.contacts.slots[slots[b]];
        let near = solved.responses[b].foot.position.distance(foot.position) < merged;
        near && (other.tool, other.body) == (contact.tool, contact.body)
    })
}

/// Whether another contact of the same tool has the foot that this one has jumped to. A fading contact there grows again.
fn foot_is_taken(model: &Model, state: &mut State, solved: SolvedContacts<'_>, slots: &[usize], a: usize) -> bool {
    let Some(b) = contact_at_same_foot(model, state, solved, slots, a) else { return false };
    let other = &mut state.contacts.slots[slots[b]];
    if other.local.is_fading {
        other.local.part_rate = 1.0 / FADE_TICKS;
        move_foot(&model.tools[other.tool], other, &solved.responses[a].foot, solved.positions[b]);
    }
    true
}

/// Begins a contact at the foot that another one has jumped to, with at most the same approach.
fn begin_replacement(model: &Model, state: &mut State, before: &Contact, (response, place): (&LocalResponse, DVec3)) {
    let tool = &model.tools[before.tool];
    let mut next = *before;
    move_foot(tool, &mut next, &response.foot, place);
    next.additional = true;
    let local = &mut next.local;
    (local.relative_position, local.last_step, local.last_changes) = (place, DVec3::ZERO, Default::default());
    (local.part, local.part_rate) = (LEAST_PART, 1.0 / FADE_TICKS);
    (local.friction, local.force) = Default::default();
    next.force = DVec3::ZERO;
    add_contact(state, next);
}

/// Moves the foot of a contact, which fades no more. Where the tool is deeper, the approach is reduced to what it was.
fn move_foot(tool: &ToolModel, contact: &mut Contact, foot: &FootPoint, place: DVec3) {
    let approach = contact_depth(tool, contact, place) - contact.local.entry_depth;
    (contact.local.foot, contact.local.is_fading) = (*foot, false);
    let deepest = contact_depth(tool, contact, place) - approach;
    contact.local.entry_depth = deepest.max(contact.local.entry_depth).max(0.0);
}

/// Depth of a tool below the plane through its contact's foot, m.
pub fn contact_depth(tool: &ToolModel, contact: &Contact, place: DVec3) -> f64 {
    let LocalContact { foot, orientation, .. } = &contact.local;
    match tool.shape {
        ToolShape::Sphere { radius } => radius - (place - foot.position).dot(contact.local.normal()),
        ref shape => depth_below(shape, (place, DMat3::from_quat(*orientation)), foot),
    }
}

/// Advances the parts of fading and growing contacts by a tick. The energy that growing contacts of a tool gain is at most that
/// which its fading ones lose: with an energy `part * Phi` at constant positions the stationary value is concave in the part, so
/// that a gain is at most, and a loss at least, the change of the part times `Phi`.
pub fn update_parts(model: &Model, state: &mut State, responses: &[LocalResponse], slots: &[usize]) {
    for grows in [false, true] {
        for (a, &slot) in slots.iter().enumerate() {
            let Contact { mode, tool, local, .. } = &state.contacts.slots[slot];
            if *mode == Mode::Free || (local.part_rate == 0.0 && !local.is_fading) || (local.part_rate > 0.0) != grows {
                continue;
            }
            let (tool, local) = (*tool, *local);
            let whole = responses[a].indentation.energy / local.part;
            let bound = if whole > 0.0 { state.tools[tool].released_energy / whole } else { f64::INFINITY };
            // The plane of a fading contact has no end, but the body has: the contact fades faster, the faster its tool moves.
            let along = || local.way.reject_from_normalized(local.foot.normal);
            let way = if local.part_rate == 0.0 { along() } else { local.way };
            let left_behind = if local.is_fading { way.length() / model.tools[tool].radius } else { 0.0 };
            let part = (local.part + (local.part_rate - left_behind).min(bound)).clamp(LEAST_PART, 1.0);
            state.tools[tool].released_energy += (local.part - part) * whole;
            let local = &mut state.contacts.slots[slot].local;
            local.part = part;
            local.part_rate = if local.part < 1.0 { local.part_rate } else { 0.0 };
        }
    }
    for &slot in slots {
        let tool = state.contacts.slots[slot].tool;
        state.tools[tool].released_energy = 0.0;
    }
}

/// Updates a contact at the end of a tick; false if it ends.
pub fn continue_contact(tool: &ToolModel, contact: &mut Contact) -> bool {
    let contact_depth = contact_depth(tool, contact, contact.local.relative_position);
    let local = &mut contact.local;
    if local.is_new {
        (local.is_new, local.entry_depth) = (false, (contact_depth - local.reachable_depth).max(0.0));
        return contact_depth < DEEPEST_START * tool.radius;
    }
    let touches = contact.force != DVec3::ZERO;
    let fades = local.is_fading && (local.part <= LEAST_PART || !touches);
    let far = contact.additional && !touches && contact_depth < -PENDING_REACH * tool.radius;
    !(fades || far)
}

/// Whether planes with these normals are one contact of a tool that is not a sphere.
pub fn are_merged_planes(first: DVec3, second: DVec3) -> bool {
    first.dot(second) > MERGED_COSINE
}

/// Whether two contacts of a tool have merged. One contact of a tool that is not a sphere covers a whole plane.
fn have_merged(tool: &ToolModel, first: &FootPoint, second: &FootPoint) -> bool {
    match tool.shape.needs_cells() {
        true => are_merged_planes(first.normal, second.normal),
        false => first.position.distance(second.position) < MERGED_DISTANCE * tool.radius,
    }
}

/// Starts the fading of the later of two merged contacts.
pub fn fade_merged_contacts(model: &Model, state: &mut State, slots: &[usize]) {
    for (a, &slot) in slots.iter().enumerate() {
        for &other in &slots[..a] {
            let [first, second] = [other, slot].map(|slot| &state.contacts.slots[slot]);
            let touch = first.mode != Mode::Free && second.mode != Mode::Free;
            let same = touch && (first.tool, first.body) == (second.tool, second.body);
            let last = same && !first.local.is_fading && !second.local.is_fading && first.law == second.law;
            if last && have_merged(&model.tools[second.tool], &first.local.foot, &second.local.foot) {
                match second.force == DVec3::ZERO {
                    true => state.contacts.clear(slot),
                    false => begin_fading(model, &mut state.contacts.slots[slot]),
                }
            }
        }
    }
}
