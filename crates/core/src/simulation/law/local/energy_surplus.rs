//! Energy surplus of contacts under the local law over the work of the tools, and its removal.

use glam::DVec3;

use super::foot_jumps::contact_depth;
use super::scratch::LocalScratch;
use crate::simulation::contacts::{Contacts, REVISIONS};
use crate::simulation::model::Model;
use crate::simulation::passivity::{ContactEnergy, ObservedContact};
use crate::simulation::state::{BodyState, State, ToolState};
use crate::tensor::rotation_vector;

/// Energy of the contacts of a body at rest, by its passivity observer.
pub fn observe_energy(
    model: &Model,
    state: &mut State,
    local: &LocalScratch,
    slots: &[usize],
    body: usize,
) -> ContactEnergy {
    let State { bodies, tools, contacts, .. } = state;
    let BodyState { motion: None, passivity, stiffness_scale, .. } = &mut bodies[body] else {
        return ContactEnergy::default();
    };
    passivity.observe(observed_contacts(model, tools, contacts, local, slots), *stiffness_scale)
}

/// Removes too large a surplus by reducing the approach; returns whether there was one.
pub fn remove_energy_surplus(
    model: &Model,
    state: &mut State,
    local: &LocalScratch,
    slots: &[usize],
    energy: ContactEnergy,
) -> bool {
    let share = energy.share_to_keep();
    if let Some(share) = share {
        reduce_approach(model, &mut state.contacts, local, slots, share);
    }
    share.is_some()
}

/// Makes the observed energies the previous ones of the next tick.
pub fn commit_energy(state: &mut State, body: usize) {
    let BodyState { motion, passivity, stiffness_scale, .. } = &mut state.bodies[body];
    if motion.is_none() {
        passivity.commit(*stiffness_scale);
    }
}

fn observed_contacts<'a>(
    model: &'a Model,
    tools: &'a [ToolState],
    contacts: &'a Contacts,
    local: &'a LocalScratch,
    slots: &'a [usize],
) -> impl Iterator<Item = ObservedContact> + 'a {
    slots.iter().enumerate().map(|(a, &slot)| {
        let (contact, response) = (&contacts.slots[slot], &local.responses[a]);
        let higher = &response.higher;
        let displacement: DVec3 = (0..slots.len()).map(|b| local.between[a][b] * local.responses[b].force).sum();
        let before = tools[contact.tool].previous_pose.map_or(
            (contact.local.tool_position, contact.local.orientation),
            |before| {
                let placement = &model.bodies[contact.body].placement;
                let orientation = model.frames[contact.body] * before.orientation;
                (placement.point_to_body(before.position), orientation)
            },
        );
        let angle = rotation_vector(before.1, contact.local.orientation).length();
        let tool = &model.tools[contact.tool];
        ObservedContact {
            slot,
            number: contact.serial >> REVISIONS,
            position: local.free_positions[a],
            orientation: contact.local.orientation,
            largest_motion: contact.local.tool_position.distance(before.0) + 2.0 * tool.shape.bounding_radius() * angle,
            radius: tool.radius,
            force: response.force,
            torque: response.torque,
            stored: response.local_energy()
                + 0.5 * response.force.dot(displacement)
                + response.force.dot(higher.displacement)
                - higher.energy,
            dissipated: response.friction.dissipated,
        }
    })
}

/// Reduces the approach of contacts to a share.
fn reduce_approach(model: &Model, contacts: &mut Contacts, local: &LocalScratch, slots: &[usize], share: f64) {
    for (a, &slot) in slots.iter().enumerate() {
        let contact = &mut contacts.slots[slot];
        let tool = &model.tools[contact.tool];
        let mut moved = *contact;
        moved.local.foot = local.responses[a].foot;
        let depth = contact_depth(tool, &moved, local.free_positions[a]) - contact.local.entry_depth;
        if tool.shape.needs_cells() {
            // The approach counts along the normal that has been found.
            contact.local.foot = moved.local.foot;
        }
        contact.local.entry_depth += (1.0 - share) * depth.max(0.0);
    }
}
