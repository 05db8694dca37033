//! What contacts under the local law hold beyond what tools have put in, and how it is taken back.

use super::handover::approach;
use super::local_scratch::LocalScratch;
use crate::simulation::contacts::{Contacts, REVISIONS};
use crate::simulation::law::takes_cells;
use crate::simulation::model::Model;
use crate::simulation::passivity::Press;
use crate::simulation::state::{BodyState, State};

/// Takes back what contacts of a body at rest hold too much; whether there was anything.
pub fn take_back_surplus(model: &Model, state: &mut State, local: &LocalScratch, slots: &[usize], body: usize) -> bool {
    let State { bodies, contacts, .. } = state;
    let BodyState { motion: None, passivity, stiffness_scale, .. } = &bodies[body] else { return false };
    let held = passivity.observe(presses(contacts, local, slots), *stiffness_scale);
    match held.part_to_keep() {
        Some(part) => lessen(model, contacts, local, slots, part),
        None => return false,
    }
    true
}

/// Books what contacts of a body at rest hold.
pub fn book(state: &mut State, local: &LocalScratch, slots: &[usize], body: usize) {
    let State { bodies, contacts, .. } = state;
    let BodyState { motion: None, passivity, stiffness_scale, .. } = &mut bodies[body] else { return };
    let held = passivity.observe(presses(contacts, local, slots), *stiffness_scale);
    passivity.book(held, presses(contacts, local, slots), *stiffness_scale);
}

fn presses<'a>(
    contacts: &'a Contacts,
    local: &'a LocalScratch,
    slots: &'a [usize],
) -> impl Iterator<Item = Press> + 'a {
    slots.iter().enumerate().map(|(a, &slot)| {
        let (contact, response) = (&contacts.slots[slot], &local.responses[a]);
        let moved: glam::DVec3 = (0..slots.len()).map(|b| local.between[a][b] * local.responses[b].force).sum();
        Press {
            slot,
            number: Some(contact.serial >> REVISIONS),
            from: local.from[a],
            orientation: contact.local.orientation,
            force: response.force,
            torque: response.torque,
            stored: response.indentation.energy + response.springs().energy() + 0.5 * response.force.dot(moved),
            dissipated: response.friction.dissipated,
        }
    })
}

/// Lets contacts keep a part of their approach.
fn lessen(model: &Model, contacts: &mut Contacts, local: &LocalScratch, slots: &[usize], part: f64) {
    for (a, &slot) in slots.iter().enumerate() {
        let contact = &mut contacts.slots[slot];
        let tool = &model.tools[contact.tool];
        let mut there = *contact;
        there.local.foot = local.responses[a].foot;
        let deep = approach(tool, &there, local.from[a]) - contact.local.entry;
        if takes_cells(&tool.shape) {
            // The approach counts along the normal that has been found.
            contact.local.foot = there.local.foot;
        }
        contact.local.entry += (1.0 - part) * deep.max(0.0);
    }
}
