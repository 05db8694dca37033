//! `f = (C + s I)^-1 (d - d_free)`.

use glam::{DMat3, DVec3};

use crate::contact::smallest_eigenvalue;
use crate::contact::smooth::FanWeights;
use crate::simulation::body::BodyDynamics;
use crate::simulation::contacts::{Contact, SlotList};
use crate::simulation::model::Model;
use crate::simulation::state::State;
use crate::simulation::system::System;
use crate::simulation::tool::ToolModel;

/// Forces of the contacts of a body, `d` being the displacement of each tool from its anchor, `d_free` its patch's free
/// motion, `C` the static compliance or that of one step, and `s` what is in series with it.
pub fn contact_forces(model: &Model, state: &mut State, system: &mut System, body: usize) {
    let moving = state.bodies[body].motion.as_ref();
    let slots = SlotList::of(state.contacts.linear_on(body));
    solve_with(
        model,
        state,
        system,
        &slots,
        |a, b| match moving {
            Some(motion) => motion.compliance(a, b),
            None => state.compliance[a][b] * (1.0 / state.bodies[body].stiffness_scale),
        },
        |slot| {
            let sliding = || contact_displacement(model, state, slot, |other| other.nonlinear);
            let free = moving.map_or_else(sliding, |motion| motion.free_displacement(slot));
            state.contacts.slots[slot].displacement - free
        },
    );
    for (i, &slot) in slots.iter().enumerate() {
        state.contacts.slots[slot].force = DVec3::from_slice(&system.right[3 * i..3 * i + 3]);
    }
}

/// Compliance of a contact, with what is in series, while the forces of all others stay as they are, m/N.
pub fn own_compliance(model: &Model, state: &State, slot: usize) -> DMat3 {
    let contact = &state.contacts.slots[slot];
    let body = &state.bodies[contact.body];
    let own = match &body.motion {
        Some(motion) => motion.compliance(slot, slot),
        None => state.compliance[slot][slot] * (1.0 / body.stiffness_scale),
    };
    in_series(model, contact, own)
}

/// Compliance in series with the body's own at a contact that sticks, the same in all directions, m/N.
///
/// A body in motion is coupled by a spring. Near a support, where a body at rest is stiffer than any device can render, its
/// compliance is raised evenly so that no direction exceeds the tool's maximum stiffness.
fn series_compliance(tool: &ToolModel, dynamics: Option<&BodyDynamics>, own: &DMat3) -> f64 {
    match dynamics {
        Some(dynamics) => 1.0 / dynamics.coupling,
        None => (1.0 / tool.max_stiffness - smallest_eigenvalue(own)).max(0.0),
    }
}

fn in_series(model: &Model, contact: &Contact, own: DMat3) -> DMat3 {
    let (tool, dynamics) = (&model.tools[contact.tool], model.bodies[contact.body].dynamics.as_ref());
    own + DMat3::from_diagonal(DVec3::splat(series_compliance(tool, dynamics, &own)))
}

/// Displacement of a body at rest at the contact in a slot by the present forces of some contacts, m.
pub fn contact_displacement(model: &Model, state: &State, slot: usize, which: impl Fn(&Contact) -> bool) -> DVec3 {
    let (contacts, body) = (&state.contacts, state.contacts.slots[slot].body);
    let green = &model.bodies[body].green;
    let others = contacts.on(body).filter(|&other| which(&contacts.slots[other]));
    let dent = |other: usize| {
        contacts.patches[slot].compliance_with(green, &contacts.patches[other]) * contacts.slots[other].force
    };
    others.map(dent).sum::<DVec3>() / state.bodies[body].stiffness_scale
}

/// Displacement of a body at rest by the contacts of the previous tick at a point of its smooth surface with given weights, m.
pub fn contact_displacement_at(model: &Model, state: &State, body: usize, weights: &FanWeights) -> DVec3 {
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

/// Assembles and solves for some contacts of one body; `system.right` has the forces afterwards.
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
