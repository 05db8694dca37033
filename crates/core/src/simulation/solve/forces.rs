//! `f = (C + s I)^-1 (d - d_free)`.

use glam::{DMat3, DVec3};

use crate::simulation::MAX_CONTACTS;
use crate::simulation::law::law_of;
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
            let free = moving.map_or_else(|| dent_of_sliding(model, state, body, slot), |m| m.free_displacement(slot));
            state.contacts.slots[slot].displacement - free
        },
    );
    for (i, &slot) in slots[..count].iter().enumerate() {
        state.contacts.slots[slot].force = DVec3::from_slice(&system.right[3 * i..3 * i + 3]);
    }
}

/// What contacts under the local law do at one that sticks, m, on a body at rest.
fn dent_of_sliding(model: &Model, state: &State, body: usize, slot: usize) -> DVec3 {
    let (contacts, green) = (&state.contacts, &model.bodies[body].green);
    let sliding = contacts.on(body).filter(|&other| contacts.slots[other].law == LawKind::Local);
    let dent = |other: usize| {
        contacts.patches[slot].compliance_with(green, &contacts.patches[other]) * contacts.slots[other].force
    };
    sliding.map(dent).sum::<DVec3>() / state.bodies[body].stiffness_scale
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
            let mut block = compliance(a, b);
            if a == b {
                let tool = &model.tools[contact.tool];
                let added = law_of(contact.law).respond(tool, model.bodies[contact.body].dynamics.as_ref(), &block);
                block += DMat3::from_diagonal(DVec3::splat(added));
            }
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
