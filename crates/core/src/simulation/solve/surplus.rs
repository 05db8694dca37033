//! What contacts under the local law hold beyond what tools have put in, and how it is taken back.

use glam::{DQuat, DVec3};

use super::handover::approach;
use super::local_scratch::LocalScratch;
use crate::simulation::contacts::{Contacts, REVISIONS};
use crate::simulation::law::takes_cells;
use crate::simulation::model::Model;
use crate::simulation::passivity::Press;
use crate::simulation::rotation::rotation_vector;
use crate::simulation::state::{BodyState, State, ToolState};

/// Takes back what contacts of a body at rest hold too much; whether there was anything.
pub fn take_back_surplus(model: &Model, state: &mut State, local: &LocalScratch, slots: &[usize], body: usize) -> bool {
    let State { bodies, tools, contacts, .. } = state;
    let BodyState { motion: None, passivity, stiffness_scale, .. } = &bodies[body] else { return false };
    let held = passivity.observe(presses(model, tools, contacts, local, slots), *stiffness_scale);
    match held.part_to_keep() {
        Some(part) => lessen(model, contacts, local, slots, part),
        None => return false,
    }
    true
}

/// Books what contacts of a body at rest hold.
pub fn book(model: &Model, state: &mut State, local: &LocalScratch, slots: &[usize], body: usize) {
    let State { bodies, tools, contacts, .. } = state;
    let BodyState { motion: None, passivity, stiffness_scale, .. } = &mut bodies[body] else { return };
    let held = passivity.observe(presses(model, tools, contacts, local, slots), *stiffness_scale);
    passivity.book(held, presses(model, tools, contacts, local, slots), *stiffness_scale);
}

fn presses<'a>(
    model: &'a Model,
    tools: &'a [ToolState],
    contacts: &'a Contacts,
    local: &'a LocalScratch,
    slots: &'a [usize],
) -> impl Iterator<Item = Press> + 'a {
    slots.iter().enumerate().map(|(a, &slot)| {
        let (contact, response) = (&contacts.slots[slot], &local.responses[a]);
        let moved: DVec3 = (0..slots.len()).map(|b| local.between[a][b] * local.responses[b].force).sum();
        let before = tools[contact.tool].before.map_or((contact.local.tool, contact.local.orientation), |before| {
            let placement = &model.bodies[contact.body].placement;
            let turned = DQuat::from_mat3(&placement.rotation.transpose()) * before.orientation;
            (placement.point_to_body(before.position), turned)
        });
        let turned = rotation_vector(before.1, contact.local.orientation).length();
        let tool = &model.tools[contact.tool];
        Press {
            slot,
            number: Some(contact.serial >> REVISIONS),
            from: local.from[a],
            orientation: contact.local.orientation,
            way: contact.local.tool.distance(before.0) + 2.0 * tool.shape.bounding_radius() * turned,
            radius: tool.radius,
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
