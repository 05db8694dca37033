//! The limit of strain: a tool's displacement counts only as far as the body stays within what linear elasticity can say.
//!
//! Beyond about 10 % strain a linear solution balloons. While contacts stick, strain follows from their forces, and forces
//! at rest are linear in the displacements `d` of the tools from their anchors. The tools count as displaced by the closest
//! displacements under which no place passes the limit (`admissible`), found from a few places
//! ([`crate::strain::StrainResponse`]) that are prepared once a set of contacts off the tick. However far a hand goes on, the
//! force stays that of these displacements.
//!
//! A contact that has just begun is not prepared for yet. Until it is, its displacement from where it met the patch stays
//! below [`provisional_displacement`], which surely keeps its own strain within the limit; from then on that bound opens tick by
//! tick.

use glam::DVec3;

use super::MAX_CONTACTS;
use super::admissible::{Contacts, Vectors, closest};
use super::contacts::Mode;
use super::model::Model;
use super::scratch::Scratch;
use super::solve::{gather, solve_with};
use super::state::{BodyState, State};
use super::strain_watch::StrainWatch;
use super::tool::LawKind;
use crate::contact::MAX_PATCH_NODES;
use crate::strain::{MAX_CONTACTS_WATCHED, provisional_displacement};

/// Growth a tick of the share of a force that is let through, and where it begins.
const GROWTH: f64 = 1.05;
const LEAST_SHARE: f64 = 1e-3;
/// Growth a tick of the bound of a contact that has been prepared for.
const OPENING: f64 = 1.3;
/// Way along the surface after which strain is asked for anew, over the mean length of its edges: of a contact within the
/// limit, and of one at it. The strain of a newton on a contact that slides changes by a third from node to node and back.
const ASKED_ANEW: [f64; 2] = [1.0, 0.1];
/// Bounds the displacement of the contact that has just begun in `slot`; one under the local law is bounded where its nodes
/// are known.
pub(super) fn begin(model: &Model, state: &mut State, slot: usize, limit: f64) {
    if limit <= 0.0 || state.contacts.slots[slot].law == LawKind::Local {
        state.contacts.slots[slot].bound = f64::INFINITY;
        return;
    }
    state.contacts.slots[slot].bound = provisional_bound(model, state, slot, limit);
}

/// Displacement of a patch under which its own strain surely keeps the limit, m.
fn provisional_bound(model: &Model, state: &State, slot: usize, limit: f64) -> f64 {
    let body = &model.bodies[state.contacts.slots[slot].body];
    let patch = state.contacts.patches[slot].patch();
    let (mut weights, mut positions) = ([0.0; MAX_PATCH_NODES], [DVec3::ZERO; MAX_PATCH_NODES]);
    for (i, (node, weight)) in patch.iter().enumerate() {
        let supported = body.green.row_is_fixed[3 * node..3 * node + 3].iter().all(|&fixed| fixed);
        (weights[i], positions[i]) = (if supported { 0.0 } else { weight }, body.green.surface.positions[node]);
    }
    let (weights, positions) = (&weights[..patch.count], &positions[..patch.count]);
    provisional_displacement(weights, positions, body.mean_edge, limit)
}

/// Lets through of the forces under the local law what the limit of strain allows: all of them by the share that is within it,
/// for they slide, and there is no anchor to hold them to. A contact that is not prepared for yet is bounded by the
/// displacement of the body under it. Where a contact has slid on by a part of an edge, its strain is asked for anew.
///
/// A share of a force is not the gradient of an energy, and what is within the limit changes from place to place: over a
/// closed path beyond it a hand would get back more than it has put in (5 % of the peak on a block). What is withheld here is
/// balanced at the port of the device, as what ramp and slew withhold is: the forces before it follow from one energy.
pub(super) fn let_through(model: &Model, state: &mut State, body: usize, limit: f64) {
    let share = share_within(state, body, limit);
    for slot in 0..MAX_CONTACTS {
        let contact = &state.contacts.slots[slot];
        if contact.mode == Mode::Free || contact.body != body || contact.law != LawKind::Local {
            continue;
        }
        let covered = StrainWatch::covers(state.bodies[body].strain.as_deref(), contact);
        let first = contact.bound == 0.0 && limit > 0.0;
        let bound = if first { provisional_bound(model, state, slot, limit) } else { contact.bound };
        let contact = &mut state.contacts.slots[slot];
        let carried = contact.local.tool.distance(contact.local.relative);
        let mut own = share;
        if limit > 0.0 {
            contact.bound = if covered { bound * OPENING } else { bound };
            own = own.min(contact.bound / carried.max(f64::MIN_POSITIVE));
        }
        // What a new response allows more is let in over some hundredths of a second.
        let own = own.min(contact.local.share * GROWTH).clamp(LEAST_SHARE, 1.0);
        contact.local.share = own;
        contact.limited = own < 1.0;
        contact.force *= own;
        contact.local.torque *= own;
        contact.ask_anew(ASKED_ANEW[usize::from(contact.limited)] * model.bodies[body].mean_edge);
    }
}

/// Share of the forces under the local law that is within the limit.
fn share_within(state: &mut State, body: usize, limit: f64) -> f64 {
    let State { bodies, contacts, .. } = state;
    let BodyState { strain, limit_share, stiffness_scale, .. } = &mut bodies[body];
    let Some(watch) = strain.as_deref().filter(|_| limit > 0.0) else { return 1.0 };
    let mut forces = [DVec3::ZERO; MAX_CONTACTS_WATCHED];
    let mut covered = contacts.on(body).filter_map(|slot| {
        let contact = &contacts.slots[slot];
        let place = watch.place_of(contact)?;
        forces[place] = contact.force / *stiffness_scale;
        Some((contact, watch.serials[place]))
    });
    let (first, second) = (covered.next(), covered.next());
    covered.for_each(drop);
    let share = watch.response.share(&forces, limit);
    // Several contacts would need to be told apart.
    let slid = first.filter(|_| second.is_none()).map(|(contact, serial)| (contact.asked_at(serial), contact.point));
    limit_share.follow(&watch.serials, share, slid)
}

/// Brings the displacements of the contacts of a body to what the limit of strain lets pass; zero is no limit.
pub(super) fn apply(model: &Model, state: &mut State, scratch: &mut Scratch, body: usize, limit: f64) {
    let mut slots = [0; MAX_CONTACTS];
    let count = gather(state, body, &mut slots);
    let slots = &slots[..count];
    let State { bodies, contacts, compliance, .. } = state;
    let (watch, scale) = (bodies[body].strain.as_deref(), bodies[body].stiffness_scale);
    for &slot in slots {
        // Where the patch was met, and what the others' forces of the tick before make of it, is not this contact's own.
        let others = slots.iter().filter(|&&other| other != slot && !model.bodies[body].moves());
        let dent: DVec3 = others.map(|&other| compliance[slot][other] * contacts.slots[other].force / scale).sum();
        let contact = &mut contacts.slots[slot];
        let found = contact.met + dent;
        contact.limited = false;
        if limit > 0.0 {
            if StrainWatch::covers(watch, contact) {
                contact.bound *= OPENING;
            }
            let own = contact.displacement - found;
            if own.length() > contact.bound {
                contact.displacement = found + own * (contact.bound / own.length());
                contact.limited = true;
            }
        }
    }
    if limit <= 0.0 || count == 0 {
        return;
    }
    let Some(watch) = state.bodies[body].strain.as_deref() else { return };
    let mut displacements = [DVec3::ZERO; MAX_CONTACTS];
    for (displacement, &slot) in displacements.iter_mut().zip(slots) {
        *displacement = state.contacts.slots[slot].displacement;
    }
    let mut at_rest = AtRest { model, state, scratch, body, slots, watch, limit };
    if let Some(admissible) = closest(&mut at_rest, &displacements) {
        for (displacement, &slot) in admissible.iter().zip(slots) {
            let contact = &mut state.contacts.slots[slot];
            // Those of contacts that have no part in it come back to the last digit.
            contact.limited |= displacement.distance(contact.displacement) > 1e-9 * contact.displacement.length();
            contact.displacement = *displacement;
        }
    }
}

/// The contacts of a body as if it came to rest under them.
struct AtRest<'a> {
    model: &'a Model,
    state: &'a State,
    scratch: &'a mut Scratch,
    body: usize,
    slots: &'a [usize],
    watch: &'a StrainWatch,
    limit: f64,
}

impl AtRest<'_> {
    /// For each contact its place in the watch.
    fn places(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.slots.iter().enumerate().filter_map(|(i, &slot)| {
            let place = self.watch.place_of(&self.state.contacts.slots[slot]);
            place.map(|place| (i, place))
        })
    }

    /// Forces at the Green's function's own stiffness, in the order of the watch.
    fn watched(&self, forces: &Vectors) -> [DVec3; MAX_CONTACTS_WATCHED] {
        let mut watched = [DVec3::ZERO; MAX_CONTACTS_WATCHED];
        for (i, place) in self.places() {
            watched[place] = forces[i] / self.state.bodies[self.body].stiffness_scale;
        }
        watched
    }
}

impl Contacts for AtRest<'_> {
    fn forces(&mut self, displacements: &Vectors) -> Vectors {
        let (state, slots, scale) = (self.state, self.slots, self.state.bodies[self.body].stiffness_scale);
        let compliance = |a: usize, b: usize| state.compliance[a][b] * (1.0 / scale);
        let displacement =
            |slot: usize| slots.iter().position(|&s| s == slot).map_or(DVec3::ZERO, |i| displacements[i]);
        solve_with(self.model, state, &mut self.scratch.system, slots, compliance, displacement);
        let mut forces = [DVec3::ZERO; MAX_CONTACTS];
        for (force, right) in forces[..slots.len()].iter_mut().zip(self.scratch.system.right.chunks_exact(3)) {
            *force = DVec3::from_slice(right);
        }
        forces
    }

    fn share(&self, forces: &Vectors) -> f64 {
        self.watch.response.share(&self.watched(forces), self.limit)
    }

    fn gradient(&self, forces: &Vectors) -> Vectors {
        let watched = self.watch.response.gradient(&self.watched(forces));
        let mut gradient = [DVec3::ZERO; MAX_CONTACTS];
        for (i, place) in self.places() {
            gradient[i] = watched[place];
        }
        gradient
    }
}
