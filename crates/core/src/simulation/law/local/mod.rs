//! Contact below the size of elements: a local law in series with finite elements.
//!
//! The body displaces the surface below the tool by `u = C_reg(x) f` (`contact::regular`). What remains between the tool, at
//! `p' = p - u`, and the smooth surface at rest is contact with a half-space: Sneddon's sphere, and friction. With the
//! energy `Phi(p')` of the one and `f^T C_reg f / 2` of the other, all of it is the stationary value over `u` of
//!
//! ```text
//! E(p) = min_u  u^T C_reg(x)^-1 u / 2 + Phi(p - u)        x = x(p - u)
//! ```
//!
//! so that `dE/dp = C_reg^-1 u = f`, and with `d(C^-1) = -C^-1 dC C^-1`
//!
//! ```text
//! f = dPhi/dp' - (1/2) f^T (dC_reg/dp') f
//! ```
//!
//! The last term inclines the force as the surface under load is inclined. Whatever forces friction adds to `dPhi/dp'`, the
//! work of the tool less that of friction is the change of one energy: `f . dp = d(f^T C f / 2) + f_local . dp'`.

mod acceleration;
mod additional;
mod contact_check;
mod coupling;
mod energy_surplus;
mod foot_jumps;
mod force_error;
mod half_space;
mod inclination;
mod near_corner;
mod near_edge;
mod newton;
mod pace;
mod response;
mod scratch;
mod secant;
mod shape_strain;
mod snap;
mod solve;
mod surroundings;
mod wrench;

pub use scratch::LocalScratch;

use glam::{DMat3, DVec3};

use super::{Approach, Law, TickMemory};
use crate::contact::Refusal;
use crate::contact::footprint::{NearPiece, PlacedShape, PressedSurface};
use crate::contact::local::cells::PressureState;
use crate::contact::shape::ToolShape;
use crate::contact::smooth::{FootPoint, Neighbourhood};
use crate::simulation::body::LocalSurface;
use crate::simulation::contacts::{Contact, LocalContact, STRAIN_REQUESTS};
use crate::simulation::input::Controls;
use crate::simulation::model::Model;
use crate::simulation::state::{EntryDepth, State};
use crate::simulation::tool::LawKind;
use crate::simulation::weight_scratch::WeightScratch;

/// Longest motion of a tool in a tick, over its radius: beyond it the tool has jumped, and its contact ends.
const JUMP: f64 = 2.0;

/// Largest change of a tool's depth in a tick, over its motion: smoothed surfaces are not quite level sets of a distance.
const ENTRY_PER_MOTION: f64 = 2.0;

/// Longest extrapolated step of a position over the surface at rest, over the motion of its tool.
const STEP_PER_MOTION: f64 = 1.5;

impl LawKind {
    /// Contact with a half-space in series with the finite element body: slides, with friction, and rolls off edges.
    pub const LOCAL: Self = Self { name: "local", needs_moduli: true };
}

/// The law.
pub struct Local;

/// Longest substep in which an approaching tool is followed from its previous position, over its radius: within one of them it does
/// not pass the middle of a part that is thicker than its radius.
const SUBSTEP: f64 = 0.25;
/// Most substeps for a tool that is not a sphere.
const MOST_SUBSTEPS: f64 = 8.0;

/// Where a contact may begin.
struct Start {
    foot: FootPoint,
    /// Depth of the tool in the surface, m.
    depth: f64,
    /// Depth of the tool below the plane of the contact, m. For a tool that is no sphere the plane is as high as the highest piece
    /// next to the tool.
    plane_depth: f64,
}

impl Start {
    /// Of a sphere.
    fn of((foot, depth): (FootPoint, f64)) -> Self {
        Self { foot, depth, plane_depth: depth }
    }
}

/// The foot of a sphere that arrives at a position over the surface at rest, and its depth below the plane through the foot, m.
/// Once the sphere touches on its way, the foot is followed, so that it lies on the side that the sphere came from. `None` if it is
/// too far away to touch.
fn starting_foot(
    approach: &Approach<'_>,
    local: &LocalSurface,
    place: DVec3,
    near: &mut Neighbourhood,
) -> Option<(FootPoint, f64)> {
    let (displacement, radius) = (approach.displacement, approach.tool.radius);
    let substeps = (displacement.length() / (SUBSTEP * radius)).ceil();
    if substeps > JUMP / SUBSTEP {
        return first_foot(approach, local, place, near);
    }
    let mut touching: Option<FootPoint> = None;
    for left in (1..substeps.max(1.0) as u32).rev() {
        let at = place - displacement * (f64::from(left) / substeps);
        touching = match touching {
            Some(foot) => Some(follow(approach, local, at, &foot, near)?.0),
            None => first_foot(approach, local, at, near).filter(|(_, depth)| *depth > 0.0).map(|(foot, _)| foot),
        };
    }
    match touching {
        Some(foot) => follow(approach, local, place, &foot, near),
        None => first_foot(approach, local, place, near),
    }
}

/// The foot followed from an earlier one, and the depth, m.
fn follow(
    approach: &Approach<'_>,
    local: &LocalSurface,
    place: DVec3,
    from: &FootPoint,
    near: &mut Neighbourhood,
) -> Option<(FootPoint, f64)> {
    let foot = local.smooth.foot(approach.body.drawn(), place, from, near)?;
    Some((foot, approach.tool.radius - foot.distance))
}

/// The foot of a sphere at a position over the surface at rest, and its depth below the plane through the foot, m. `None` if it is
/// too far away to touch.
fn first_foot(
    approach: &Approach<'_>,
    local: &LocalSurface,
    place: DVec3,
    near: &mut Neighbourhood,
) -> Option<(FootPoint, f64)> {
    let (body, tool) = (approach.body, approach.tool);
    let closest = body.closest(place)?;
    if local.smooth.is_beyond(tool.radius, &closest) {
        return None;
    }
    let foot = local.smooth.foot_from(body.drawn(), place, &closest, near);
    Some((foot, tool.radius - foot.distance))
}

/// The footprint, as a foot, of a tool that is not a sphere, and its depth in the pieces below. Where no piece is near, what the next
/// contact begins from: a tool far inside the body, as one may start, has not come in through the surface.
///
/// The contact lies on the side that the tool came from: at the first piece that it was near to on its way.
fn starting_footprint(
    approach: &Approach<'_>,
    local: &LocalSurface,
    pressed: &PressedSurface,
    place: DVec3,
    weight_scratch: &mut WeightScratch,
) -> Result<Start, EntryDepth> {
    let (body, shape) = (approach.body, &approach.tool.shape);
    let (drawn, rotation, thickness) = (body.drawn(), DMat3::from_quat(approach.orientation), shape.thickness());
    let Some(closest) = body.closest(place + rotation * shape.centre()) else { return Err(EntryDepth::default()) };
    if closest.signed_distance > shape.bounding_radius() + pressed.margin + approach.displacement.length() {
        return Err(EntryDepth::default());
    }
    let nowhere = if closest.signed_distance < 0.0 { EntryDepth::INSIDE } else { EntryDepth::default() };
    let WeightScratch { footprint, weights, .. } = weight_scratch;
    let has_jumped = approach.displacement.length() > JUMP * approach.tool.radius;
    let displacement = if has_jumped { DVec3::ZERO } else { approach.displacement };
    let substeps = (displacement.length() / (SUBSTEP * thickness)).ceil().clamp(1.0, MOST_SUBSTEPS);
    let mut at = PlacedShape { shape, position: place, rotation, contact_normal: DVec3::ZERO, penetration: 0.0 };
    footprint.near.invalidate();
    let mut first_plane = None;
    for left in (0..substeps as u32).rev() {
        at.position = place - displacement * (f64::from(left) / substeps);
        footprint.near.find(pressed, drawn.query, &at);
        first_plane = footprint.first_touched(if approach.motion.is_some() { DVec3::ZERO } else { displacement });
        if first_plane.is_some() {
            break;
        }
    }
    let first_plane = first_plane.ok_or(nowhere)?;
    let at =
        PlacedShape { position: place, penetration: displacement.length(), contact_normal: first_plane.normal, ..at };
    footprint.near.find(pressed, drawn.query, &at);
    let found = footprint.find(&at, (&pressed.fine, &local.smooth), first_plane, weights);
    let contact_footprint = found.ok_or(nowhere)?;
    let faces = |near: &&NearPiece| near.normal.dot(contact_footprint.normal) > 0.0;
    let depth = footprint.near.pieces.iter().filter(faces).map(|near| -near.distance).fold(0.0, f64::max);
    let foot = contact_footprint.foot(place);
    let highest = FootPoint { position: contact_footprint.origin, ..foot };
    Ok(Start { foot, depth, plane_depth: depth_below(shape, (place, rotation), &highest) })
}

/// Depth of a tool at `place` below the plane through a foot, m; negative above it.
pub fn depth_below(shape: &ToolShape, (place, rotation): (DVec3, DMat3), foot: &FootPoint) -> f64 {
    let deepest = place + rotation * shape.support(-(rotation.transpose() * foot.normal));
    (foot.position - deepest).dot(foot.normal)
}

/// Puts a contact into an empty slot.
fn add_contact(state: &mut State, new_contact: Contact) -> Option<usize> {
    let State { contacts, pressures, .. } = &mut *state;
    let slot = contacts.empty(new_contact.additional)?;
    let serial = contacts.next_serial();
    contacts.put(slot, Contact { serial, ..new_contact });
    contacts.patches[slot].clear();
    if let Some(pressures) = pressures.get_mut(slot) {
        *pressures = PressureState::default();
    }
    Some(slot)
}

impl Law for Local {
    fn kind(&self) -> LawKind {
        LawKind::LOCAL
    }

    /// A grab is that of a patch.
    fn grab_law(&self) -> LawKind {
        LawKind::PATCH
    }

    fn begin(
        &self,
        approach: &Approach<'_>,
        entry: &mut EntryDepth,
        weight_scratch: &mut WeightScratch,
    ) -> Result<Option<Contact>, Refusal> {
        let (body, relative_position) = (approach.body, approach.position - approach.surface_displacement());
        let Some(local) = &body.local else { return Ok(None) };
        weight_scratch.near.invalidate();
        let start = match approach.pressed_surface {
            Some(pressed) => starting_footprint(approach, local, pressed, relative_position, weight_scratch),
            None => starting_foot(approach, local, relative_position, &mut weight_scratch.near)
                .map(Start::of)
                .ok_or_else(EntryDepth::default),
        };
        let Start { foot, depth, plane_depth } = match start {
            Ok(start) => start,
            Err(nowhere) => {
                *entry = nowhere;
                return Ok(None);
            }
        };
        let before = std::mem::replace(&mut entry.previous, depth.max(0.0));
        entry.threshold = entry.threshold.min(entry.previous);
        if approach.has_returned {
            entry.threshold = entry.previous;
        }
        if approach.motion.is_none() && approach.largest_motion() > 0.0 {
            // A distance changes by no more than the motion. A larger change means another foot than a tick ago.
            entry.threshold = entry.threshold.max(depth - before - ENTRY_PER_MOTION * approach.largest_motion());
        }
        // A tool may first touch between the middles of pieces: one from outside begins a contact as soon as it is near.
        let starts_near = approach.pressed_surface.is_some() && entry.threshold == 0.0;
        if depth <= entry.threshold && !starts_near {
            return Ok(None);
        }
        let entry_depth = if entry.threshold > 0.0 { plane_depth - (depth - entry.threshold) } else { 0.0 };
        let local = LocalContact {
            tool_position: approach.position,
            orientation: approach.orientation,
            relative_position,
            previous_orientation: approach.orientation,
            entry_depth,
            foot,
            part: 1.0,
            ..LocalContact::default()
        };
        Ok(Some(Contact {
            nonlinear: true,
            point: foot.position,
            normal: foot.normal,
            anchor: approach.position,
            strain_requests: [foot.position; STRAIN_REQUESTS],
            local,
            ..Contact::new(LawKind::LOCAL, (approach.tool_index, approach.body_index))
        }))
    }

    /// Its patch is set when its force is known.
    fn add(
        &self,
        _model: &Model,
        state: &mut State,
        new_contact: Contact,
        _weight_scratch: &WeightScratch,
    ) -> Option<usize> {
        add_contact(state, new_contact)
    }

    fn update(&self, approach: &Approach<'_>, contact: &mut Contact) -> bool {
        let local = &mut contact.local;
        let way = approach.position - local.tool_position;
        let travel = way.length();
        let has_jumped = travel > JUMP * approach.tool.radius;
        // A position over the surface at rest moves about as far as its tool, or less. Any excess is the residual of the method,
        // below its tolerance in a tick: extrapolated, it would repeat until it exceeds the tolerance, and then be undone at once.
        if approach.motion.is_none() {
            let longest = STEP_PER_MOTION * travel;
            let length = local.last_step.length();
            if length > longest {
                local.last_step *= longest / length;
                local.last_changes = local.last_changes.map(|change| change * (longest / length));
            }
        }
        (local.tool_position, local.orientation, local.way) = (approach.position, approach.orientation, way);
        // After a jump a new contact starts from the depth stored in the tool's state.
        !approach.grab && !has_jumped
    }

    fn persists(&self, contact: &Contact) -> bool {
        !contact.local.is_fading || foot_jumps::lasts_on_its_plane(contact)
    }

    /// Walls beside a tool that is not a sphere are found after it has been pressed.
    fn find_additional(&self, model: &Model, state: &mut State, memory: TickMemory<'_>, (tool, body): (usize, usize)) {
        if model.pressed_surfaces[tool][body].is_none() {
            additional::find_additional_contacts(model, state, memory, (tool, body));
        }
    }

    fn find_forces(&self, model: &Model, state: &mut State, memory: TickMemory<'_>, body: usize, controls: &Controls) {
        solve::local_forces(model, state, memory, body, controls);
    }

    fn body_displacement(&self, contact: &Contact) -> f64 {
        contact.local.tool_position.distance(contact.local.relative_position)
    }

    fn ends(&self, contact: &Contact) -> bool {
        contact.force == DVec3::ZERO && !contact.additional
    }

    fn store_entry_depth(&self, model: &Model, state: &mut State, contact: &Contact) {
        let entry = &mut state.tools[contact.tool].entry[contact.body];
        // The next contact begins no higher than this one: its approach may have been reduced.
        entry.previous = near_corner::last_depth(model, contact).max(0.0);
        entry.threshold = entry.threshold.max(contact.local.entry_depth);
    }

    fn find_additional_by_force(&self, model: &Model, state: &mut State, memory: TickMemory<'_>, body: usize) {
        additional::find_wall_contact(model, state, memory, body);
    }

    fn is_sound(&self, model: &Model, contact: &Contact, stiffness_scale: f64) -> bool {
        contact_check::is_sound(model, contact, stiffness_scale)
    }
}
