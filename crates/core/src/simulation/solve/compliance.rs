//! Rows and columns of the compliance between contacts, computed once when a contact begins.

use crate::simulation::contacts::Contact;
use crate::simulation::model::Model;
use crate::simulation::state::State;
use crate::simulation::weight_scratch::WeightScratch;

/// Adds a new contact whose patch is `weight_scratch.candidate`: its slot, its compliance with every other contact of the body
/// and, on a body in motion, the displacement of the patch at the start. Returns the slot. `None` if a node is not touchable; the
/// tool then has the reason.
pub fn add_contact(
    model: &Model,
    state: &mut State,
    new_contact: Contact,
    weight_scratch: &WeightScratch,
) -> Option<usize> {
    let (tool, body) = (new_contact.tool, new_contact.body);
    let green = &model.bodies[body].green;
    let State { bodies, contacts, compliance, tools, .. } = &mut *state;
    let slot = contacts.empty(new_contact.additional)?;
    if let Err(refusal) = contacts.patches[slot].set_patch(green, &weight_scratch.candidate) {
        tools[tool].refused[body] = Some(refusal);
        return None;
    }
    let serial = contacts.next_serial();
    contacts.put(slot, Contact { serial, ..new_contact });
    compliance[slot][slot] = contacts.patches[slot].own_compliance(green);
    for other in contacts.on(body).filter(|&other| other != slot) {
        let block = contacts.patches[slot].compliance_with(green, &contacts.patches[other]);
        compliance[slot][other] = block;
        compliance[other][slot] = block.transpose();
    }
    if let (Some(motion), Some(dynamics)) = (&mut bodies[body].motion, &model.bodies[body].dynamics) {
        motion.add_contact(&dynamics.modes, contacts, compliance, slot);
        // The tool's displacement counts from the patch as displaced now, and the free motion is subtracted in every step.
        let start_displacement = motion.free_displacement(slot) + motion.residual_displacement(contacts, slot);
        contacts.slots[slot].anchor -= start_displacement;
        contacts.slots[slot].displacement += start_displacement;
        contacts.slots[slot].tool_displacement += start_displacement;
        contacts.slots[slot].start_displacement = start_displacement;
    }
    Some(slot)
}
