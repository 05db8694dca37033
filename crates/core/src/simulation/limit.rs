//! The limit of strain: a tool's displacement counts only as far as the body stays within what linear elasticity can say.
//!
//! Beyond about 10 % strain a linear solution balloons. While contacts stick, strain follows from their forces, and forces
//! at rest are linear in the displacements `d` of the tools from their anchors: the largest common share `s <= 1` of all
//! `d` of a body at which no place passes the limit is found from a few places ([`crate::strain::StrainResponse`]), prepared once a set of
//! contacts off the tick. The force then stays that of `s d` however far a hand goes on.
//!
//! A contact that has just begun is not prepared for yet. Until it is, its displacement is held below
//! [`provisional_displacement`], which surely keeps strain within the limit; from then on that bound opens by a tenth a tick.

use glam::DVec3;

use super::MAX_CONTACTS;
use super::contacts::Contact;
use super::model::Model;
use super::scratch::Scratch;
use super::solve::{gather, solve_with};
use super::state::State;
use super::strain_watch::StrainWatch;
use crate::contact::MAX_PATCH_NODES;
use crate::strain::{MAX_CONTACTS_WATCHED, provisional_displacement};

/// Growth a tick of the bound of a contact that has been prepared for.
const OPENING: f64 = 1.1;

/// Bounds the displacement of the contact that has just begun in `slot`.
pub(super) fn begin(model: &Model, state: &mut State, slot: usize, limit: f64) {
    if limit <= 0.0 {
        state.contacts.slots[slot].bound = f64::INFINITY;
        return;
    }
    let body = &model.bodies[state.contacts.slots[slot].body];
    let patch = state.contacts.patches[slot].patch();
    let (mut weights, mut positions) = ([0.0; MAX_PATCH_NODES], [DVec3::ZERO; MAX_PATCH_NODES]);
    for (i, (node, weight)) in patch.iter().enumerate() {
        let supported = body.green.row_is_fixed[3 * node..3 * node + 3].iter().all(|&fixed| fixed);
        (weights[i], positions[i]) = (if supported { 0.0 } else { weight }, body.green.surface.positions[node]);
    }
    let (weights, positions) = (&weights[..patch.count], &positions[..patch.count]);
    state.contacts.slots[slot].bound = provisional_displacement(weights, positions, body.mean_edge, limit);
}

/// Shortens the displacements of the contacts of a body to what the limit of strain lets pass; zero is no limit.
pub(super) fn apply(model: &Model, state: &mut State, scratch: &mut Scratch, body: usize, limit: f64) {
    let mut slots = [0; MAX_CONTACTS];
    let count = gather(state, body, &mut slots);
    let slots = &slots[..count];
    let State { bodies, contacts, .. } = state;
    let watch = bodies[body].strain.as_deref();
    for &slot in slots {
        let contact = &mut contacts.slots[slot];
        contact.share = 1.0;
        if limit > 0.0 {
            if StrainWatch::covers(watch, contact) {
                contact.bound *= OPENING;
            }
            let length = contact.displacement.length();
            shorten(contact, if length > contact.bound { contact.bound / length } else { 1.0 });
        }
    }
    if limit > 0.0 && count > 0 && bodies[body].strain.is_some() {
        let share = common_share(model, state, scratch, body, slots, limit);
        slots.iter().for_each(|&slot| shorten(&mut state.contacts.slots[slot], share));
    }
}

fn shorten(contact: &mut Contact, share: f64) {
    if share < 1.0 {
        contact.displacement *= share;
        contact.share *= share;
    }
}

/// Share of the forces of a body at rest under the contacts' displacements that keeps it within the limit.
fn common_share(model: &Model, state: &State, scratch: &mut Scratch, body: usize, slots: &[usize], limit: f64) -> f64 {
    let scale = state.bodies[body].stiffness_scale;
    let compliance = |a: usize, b: usize| state.compliance[a][b] * (1.0 / scale);
    let displacement = |slot: usize| state.contacts.slots[slot].displacement;
    solve_with(model, state, &mut scratch.system, slots, compliance, displacement);
    let Some(watch) = &state.bodies[body].strain else { return 1.0 };
    let mut forces = [DVec3::ZERO; MAX_CONTACTS_WATCHED];
    for (i, &slot) in slots.iter().enumerate() {
        let serial = state.contacts.slots[slot].serial;
        if let Some(place) = watch.serials.iter().position(|&known| known == serial) {
            forces[place] = DVec3::from_slice(&scratch.system.right[3 * i..3 * i + 3]) / scale;
        }
    }
    watch.response.share(&forces, limit)
}
