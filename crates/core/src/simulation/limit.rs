//! Strain limit: a tool's displacement counts only as far as strain stays in the range of linear elasticity.
//!
//! Beyond about 10 % strain a linear solution overestimates volumes: bodies balloon. While contacts stick, strain follows from
//! their forces, and forces at rest are linear in the displacements `d` of the tools from their anchors. The tools count as
//! displaced by the closest displacements under which no place passes the limit (`strain_projection`), found from a few places
//! ([`crate::strain::StrainResponse`]) that another thread prepares once for each set of contacts. However far a tool moves on, the
//! force stays that of these displacements.
//!
//! A new contact has no prepared response. Until it has one, its displacement since it began stays below
//! [`provisional_displacement`], which surely keeps its own strain within the limit; from then on that bound grows tick by tick.

use glam::DVec3;

use super::MAX_CONTACTS;
use super::contacts::SlotList;
use super::law::law_of;
use super::model::Model;
use super::scratch::Scratch;
use super::solve::{contact_displacement, own_compliance, solve_with};
use super::state::{BodyState, State};
use super::strain_projection::{StrainConstraint, Vectors, project};
use super::strain_watch::StrainWatch;
use super::system::System;
use crate::contact::MAX_PATCH_NODES;
use crate::strain::{MAX_CONTACTS_WATCHED, provisional_displacement};

/// Growth in a tick of the share of a force, and its least value.
const SHARE_GROWTH: f64 = 1.05;
const LEAST_SHARE: f64 = 1e-3;
/// Growth in a tick of the bound of a contact with a prepared response.
const BOUND_GROWTH: f64 = 1.3;
/// Distance of sliding after which strain is requested again, over the mean length of edges: for a contact far within the limit, and
/// for one near it, whose force would pass it if it were `NEAR` times as large. The strain per newton of a sliding contact changes by
/// a third from node to node and back.
const NEW_REQUEST: [f64; 2] = [1.0, 0.1];
const NEAR: f64 = 1.5;

/// Bounds the displacement of the new contact in `slot`. A nonlinear one is bounded later, when its nodes are known.
pub(super) fn begin(model: &Model, state: &mut State, slot: usize, limit: f64) {
    if limit <= 0.0 || state.contacts.slots[slot].nonlinear {
        state.contacts.slots[slot].bound = f64::INFINITY;
        return;
    }
    state.contacts.slots[slot].bound = provisional_bound(model, state, slot, limit);
}

/// Displacement of a patch up to which its own strain surely stays within the limit, m.
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

/// Reduces nonlinear forces to the strain limit: all of them by the share that is within it, for these contacts slide and have no
/// anchor whose displacement could be limited. A contact without a prepared response is bounded by the displacement of the body
/// under it. A contact that has slid by a part of an edge requests its strain again.
///
/// A share of a force is not the gradient of an energy, and the share changes from place to place: a closed path beyond the limit
/// would release more energy than was put in (5 % of the peak on a block). The difference is balanced at the device's port, as
/// that of ramp and slew limit is: the forces before the reduction follow from one energy.
pub(super) fn limit_sliding_forces(model: &Model, state: &mut State, body: usize, limit: f64) {
    let (share, near) = share_within(state, body, limit);
    for slot in state.contacts.occupied() {
        let contact = &state.contacts.slots[slot];
        if contact.body != body || !contact.nonlinear {
            continue;
        }
        let covered = StrainWatch::covers(state.bodies[body].strain.as_deref(), contact);
        let first = contact.bound == 0.0 && limit > 0.0;
        let bound = if first { provisional_bound(model, state, slot, limit) } else { contact.bound };
        let contact = &mut state.contacts.slots[slot];
        let displacement = law_of(contact.law).body_displacement(contact);
        let mut own = share;
        // Beyond the range of its law.
        own = own.min(contact.held);
        if limit > 0.0 {
            contact.bound = if covered { bound * BOUND_GROWTH } else { bound };
            own = own.min(contact.bound / displacement.max(f64::MIN_POSITIVE));
        }
        // A larger share by a new response is approached over some hundredths of a second.
        let own = own.min(contact.share * SHARE_GROWTH).clamp(LEAST_SHARE, 1.0);
        contact.share = own;
        contact.limited = own < 1.0;
        contact.force *= own;
        contact.torque *= own;
        let distance = NEW_REQUEST[usize::from(contact.limited || near)] * model.bodies[body].mean_edge;
        contact.request_strain_after(distance);
    }
}

/// Share of these forces that is within the limit, and whether they are near it.
fn share_within(state: &mut State, body: usize, limit: f64) -> (f64, bool) {
    let State { bodies, contacts, .. } = state;
    let BodyState { strain, limit_share, stiffness_scale, .. } = &mut bodies[body];
    let Some(watch) = strain.as_deref().filter(|_| limit > 0.0) else { return (1.0, false) };
    let mut forces = [DVec3::ZERO; MAX_CONTACTS_WATCHED];
    let mut covered = contacts.on(body).filter_map(|slot| {
        let contact = &contacts.slots[slot];
        let rank = watch.rank_of(contact)?;
        forces[rank] = contact.force / *stiffness_scale;
        Some((contact, watch.serials[rank]))
    });
    let (first, second) = (covered.next(), covered.next());
    covered.for_each(drop);
    let share = watch.response.share(&forces, limit);
    let near = share < 1.0 || watch.response.share(&forces.map(|force| force * NEAR), limit) < 1.0;
    // With several contacts it is unknown which of them changes the share.
    let path = first
        .filter(|_| second.is_none())
        .map(|(contact, serial)| (contact.strain_requested_at(serial), contact.point));
    (limit_share.update(&watch.serials, share, path), near)
}

/// Reduces the displacements of the contacts of a body to the strain limit; zero is no limit.
pub(super) fn apply(model: &Model, state: &mut State, scratch: &mut Scratch, body: usize, limit: f64) {
    let list = SlotList::of(state.contacts.linear_on(body));
    let slots = &*list;
    let State { bodies, contacts, .. } = state;
    let together = slots.len() > 1 && !model.bodies[body].moves();
    for &slot in slots {
        let contact = &mut contacts.slots[slot];
        contact.limited = false;
        if limit > 0.0 {
            if StrainWatch::covers(bodies[body].strain.as_deref(), contact) {
                contact.bound *= BOUND_GROWTH;
            }
            // The displacement of the patch when the contact began is not its own.
            let own = contact.displacement - contact.start_displacement;
            if !together && own.length() > contact.bound {
                contact.displacement = contact.start_displacement + own * (contact.bound / own.length());
                contact.limited = true;
            }
        }
    }
    if together && limit > 0.0 {
        bound_displacements(model, state, &mut scratch.system, slots);
    }
    if limit <= 0.0 || slots.is_empty() {
        return;
    }
    let Some(watch) = state.bodies[body].strain.as_deref() else { return };
    let mut displacements = [DVec3::ZERO; MAX_CONTACTS];
    for (displacement, &slot) in displacements.iter_mut().zip(slots) {
        *displacement = state.contacts.slots[slot].displacement;
    }
    let mut at_rest = StaticContacts { model, state, scratch, body, slots, watch, limit };
    if let Some(projected) = project(&mut at_rest, &displacements) {
        for (displacement, &slot) in projected.iter().zip(slots) {
            let contact = &mut state.contacts.slots[slot];
            // Displacements of contacts that the limit does not concern come back up to rounding.
            contact.limited |= displacement.distance(contact.displacement) > 1e-9 * contact.displacement.length();
            contact.displacement = *displacement;
        }
    }
}

/// Keeps the displacement of the patch under each of several contacts by its own force (force times own compliance) within its
/// bound. Displacements by the other contacts do not count.
///
/// The forces are found together, those beyond their bounds shortened, and the rest found again under these. The forces of the
/// previous tick must not be used here: contacts close to each other would grow from tick to tick without end.
fn bound_displacements(model: &Model, state: &mut State, system: &mut System, slots: &[usize]) {
    let current = &*state;
    let scale = current.bodies[current.contacts.slots[slots[0]].body].stiffness_scale;
    let compliance = |a: usize, b: usize| current.compliance[a][b] * (1.0 / scale);
    let sliding = |slot: usize| contact_displacement(model, current, slot, |other| other.nonlinear);
    let (mut forces, mut short) = ([DVec3::ZERO; MAX_CONTACTS], [false; MAX_CONTACTS]);
    for _ in slots {
        let rest = SlotList::of(slots.iter().copied().filter(|&slot| !short[slot]));
        solve_with(model, current, system, &rest, compliance, |slot| {
            let shortened = slots.iter().filter(|&&other| short[other]);
            let displacement_by_others: DVec3 = shortened.map(|&other| compliance(slot, other) * forces[other]).sum();
            current.contacts.slots[slot].displacement - sliding(slot) - displacement_by_others
        });
        for (&slot, force) in rest.iter().zip(system.right.chunks_exact(3)) {
            let (force, bound) = (DVec3::from_slice(force), current.contacts.slots[slot].bound);
            let own = (own_compliance(model, current, slot) * force).length();
            short[slot] = own > bound;
            forces[slot] = if short[slot] { force * (bound / own) } else { force };
        }
        if !rest.iter().any(|&slot| short[slot]) {
            break;
        }
    }
    let displaced = |slot: usize| {
        let others = slots.iter().filter(|&&other| other != slot);
        let displacement_by_others: DVec3 = others.map(|&other| compliance(slot, other) * forces[other]).sum();
        own_compliance(model, current, slot) * forces[slot] + displacement_by_others + sliding(slot)
    };
    let mut displacements = [DVec3::ZERO; MAX_CONTACTS];
    slots.iter().filter(|&&slot| short[slot]).for_each(|&slot| displacements[slot] = displaced(slot));
    for &slot in slots.iter().filter(|&&slot| short[slot]) {
        let contact = &mut state.contacts.slots[slot];
        (contact.displacement, contact.limited) = (displacements[slot], true);
    }
}

/// The contacts of a body as if it came to rest under them.
struct StaticContacts<'a> {
    model: &'a Model,
    state: &'a State,
    scratch: &'a mut Scratch,
    body: usize,
    slots: &'a [usize],
    watch: &'a StrainWatch,
    limit: f64,
}

impl StaticContacts<'_> {
    /// For each contact its rank in the strain response.
    fn ranks(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.slots.iter().enumerate().filter_map(|(i, &slot)| {
            let rank = self.watch.rank_of(&self.state.contacts.slots[slot]);
            rank.map(|rank| (i, rank))
        })
    }

    /// Forces at the Green's function's own stiffness, in the order of the strain response.
    fn in_watch_order(&self, forces: &Vectors) -> [DVec3; MAX_CONTACTS_WATCHED] {
        let mut watched = [DVec3::ZERO; MAX_CONTACTS_WATCHED];
        for (i, rank) in self.ranks() {
            watched[rank] = forces[i] / self.state.bodies[self.body].stiffness_scale;
        }
        watched
    }
}

impl StrainConstraint for StaticContacts<'_> {
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
        self.watch.response.share(&self.in_watch_order(forces), self.limit)
    }

    fn gradient(&self, forces: &Vectors) -> Vectors {
        let watched = self.watch.response.gradient(&self.in_watch_order(forces));
        let mut gradient = [DVec3::ZERO; MAX_CONTACTS];
        for (i, rank) in self.ranks() {
            gradient[i] = watched[rank];
        }
        gradient
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::contact::shape::ToolShape;
    use crate::green::{Precision, precompute};
    use crate::simulation::law::bodies;
    use crate::simulation::{
        BodyModel, Input, LawKind, MAX_TOOLS, Placement, Pose, Scratch, ToolInput, ToolModel, step,
    };

    const RADIUS: f64 = 0.01;

    /// Largest force of a tick, N, of tools side by side that are pressed to 3 mm and held there.
    fn most(limit: f64, places: &[f64]) -> f64 {
        let green = precompute(&bodies::cube(4), Precision::F64, &|_, _| true).expect("a solvable cube");
        let body = BodyModel::new(Arc::new(green), Placement::default()).expect("a body");
        let shape = ToolShape::sphere(RADIUS).expect("a sphere");
        let tool =
            ToolModel { shape, radius: RADIUS, law: LawKind::PATCH, pad_youngs_modulus: None, max_stiffness: 5000.0 };
        let model = Model::new(vec![body], vec![tool; places.len()]).expect("a scene");
        let (mut state, mut scratch, mut input) = (State::new(&model), Scratch::new(&model), Input::default());
        input.controls.contact_radius = [0.02; MAX_TOOLS];
        input.controls.strain_limit.fill(limit);
        let mut most = 0.0f64;
        for tick in 0..400 {
            let depth = 3e-3 * (f64::from(tick) / 100.0).min(1.0);
            for (tool, &x) in places.iter().enumerate() {
                let pose = Pose::at(DVec3::new(x, 0.05, 0.1 + RADIUS - depth));
                input.tools[tool] = ToolInput { pose, active: true, ..ToolInput::default() };
            }
            let output = step(&model, &mut state, &mut scratch, &input);
            most = (0..places.len()).map(|tool| output.wrench_on_device[tool].force.length()).fold(most, f64::max);
        }
        most
    }

    /// Before their strain is known contacts are bounded by what they do to the body by themselves. Side by side each has no more
    /// force than alone under the limit, and less than without one.
    #[test]
    fn contacts_side_by_side_have_no_more_force_under_the_limit_than_one_alone() {
        let alone = most(0.01, &[0.05]);
        assert!(alone > 0.0 && alone < 0.5 * most(0.0, &[0.05]));
        for apart in [0.002, 0.01, 0.03] {
            let together = most(0.01, &[0.05 - 0.5 * apart, 0.05 + 0.5 * apart]);
            assert!(together > 0.0 && together < 1.2 * alone, "{apart}: {together} N, {alone} N alone");
        }
    }
}
