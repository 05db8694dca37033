//! `f = (C + s I)^-1 (d - d_free)`.

use glam::{DMat3, DVec3};

use crate::contact::smooth::FanWeights;
use crate::simulation::MAX_CONTACTS;
use crate::simulation::contacts::Contact;
use crate::simulation::law::series_compliance;
use crate::simulation::model::Model;
use crate::simulation::state::State;
use crate::simulation::system::System;
use crate::simulation::tool::LawKind;

/// Forces of the contacts of a body, `d` being the displacement of each tool from its anchor, `d_free` its patch's free
/// motion, `C` the static compliance or that of one step, and `s` what each contact law adds.
pub fn contact_forces(model: &Model, state: &mut State, system: &mut System, body: usize) {
    let moving = state.bodies[body].motion.as_ref();
    let mut slots = [0; MAX_CONTACTS];
    let count = gather(state, body, &mut slots);
    solve_with(
        model,
        state,
        system,
        &slots[..count],
        |a, b| match moving {
            Some(motion) => motion.compliance(a, b),
            None => state.compliance[a][b] * (1.0 / state.bodies[body].stiffness_scale),
        },
        |slot| {
            let sliding = || dent_of(model, state, slot, |law| law == LawKind::Local);
            let free = moving.map_or_else(sliding, |motion| motion.free_displacement(slot));
            state.contacts.slots[slot].displacement - free
        },
    );
    for (i, &slot) in slots[..count].iter().enumerate() {
        state.contacts.slots[slot].force = DVec3::from_slice(&system.right[3 * i..3 * i + 3]);
    }
}

/// Compliance of a contact, its law's with it, while the forces of all others stay as they are, m/N.
pub fn own_compliance(model: &Model, state: &State, slot: usize) -> DMat3 {
    let contact = &state.contacts.slots[slot];
    let body = &state.bodies[contact.body];
    let own = match &body.motion {
        Some(motion) => motion.compliance(slot, slot),
        None => state.compliance[slot][slot] * (1.0 / body.stiffness_scale),
    };
    in_series(model, contact, own)
}

fn in_series(model: &Model, contact: &Contact, own: DMat3) -> DMat3 {
    let (tool, dynamics) = (&model.tools[contact.tool], model.bodies[contact.body].dynamics.as_ref());
    own + DMat3::from_diagonal(DVec3::splat(series_compliance(tool, dynamics, &own)))
}

/// What the contacts of some laws do, by their forces as far as they are known, at the contact in a slot, m, on a body at rest.
pub fn dent_of(model: &Model, state: &State, slot: usize, laws: impl Fn(LawKind) -> bool) -> DVec3 {
    let (contacts, body) = (&state.contacts, state.contacts.slots[slot].body);
    let green = &model.bodies[body].green;
    let others = contacts.on(body).filter(|&other| laws(contacts.slots[other].law));
    let dent = |other: usize| {
        contacts.patches[slot].compliance_with(green, &contacts.patches[other]) * contacts.slots[other].force
    };
    others.map(dent).sum::<DVec3>() / state.bodies[body].stiffness_scale
}

/// Displacement of a body at rest by the contacts that it had a tick ago, at a weighed place of its smooth surface, m.
pub fn dent_at(model: &Model, state: &State, body: usize, weights: &FanWeights) -> DVec3 {
    let (fixed, contacts) = (&model.bodies[body], &state.contacts);
    let Some(local) = &fixed.local else { return DVec3::ZERO };
    let mut dent = DVec3::ZERO;
    for slot in contacts.on(body).filter(|&slot| contacts.slots[slot].force != DVec3::ZERO) {
        for (fan, weight) in weights.iter() {
            let node = local.smooth.fans()[fan].node as usize;
            dent += contacts.patches[slot].compliance_at(&fixed.green, node) * contacts.slots[slot].force * weight;
        }
    }
    dent / state.bodies[body].stiffness_scale
}

/// Slots of the contacts of a body that stick, in order; returns how many there are.
pub fn gather(state: &State, body: usize, slots: &mut [usize; MAX_CONTACTS]) -> usize {
    let mut count = 0;
    for slot in state.contacts.on(body).filter(|&slot| state.contacts.slots[slot].law != LawKind::Local) {
        slots[count] = slot;
        count += 1;
    }
    count
}

/// Assembles and solves for some contacts of one body; the forces are left in `system.right`.
pub fn solve_with(
    model: &Model,
    state: &State,
    system: &mut System,
    slots: &[usize],
    compliance: impl Fn(usize, usize) -> DMat3,
    displacement: impl Fn(usize) -> DVec3,
) {
    for (i, &a) in slots.iter().enumerate() {
        let contact = &state.contacts.slots[a];
        for (j, &b) in slots.iter().enumerate() {
            let block = if a == b { in_series(model, contact, compliance(a, a)) } else { compliance(a, b) };
            for row in 0..3 {
                for column in 0..3 {
                    system.matrix[3 * i + row][3 * j + column] = block.col(column)[row];
                }
            }
        }
        system.right[3 * i..3 * i + 3].copy_from_slice(&displacement(a).to_array());
    }
    system.solve(3 * slots.len());
}
