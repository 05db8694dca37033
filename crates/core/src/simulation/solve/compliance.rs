//! Rows and columns of the compliance between contacts: worked out once, when a contact begins.

use crate::contact::local::cells::PressureState;
use crate::simulation::contacts::Contact;
use crate::simulation::covering::Covering;
use crate::simulation::model::Model;
use crate::simulation::state::State;
use crate::simulation::tool::LawKind;

/// Takes up a contact that begins, whose patch is `covering.candidate`: a slot, its compliance with every other contact of
/// the body, and of a body in motion where the moving patch is met. Returns the slot; `None`, with the reason left with the
/// tool, where a node may not be touched.
pub fn add_contact(model: &Model, state: &mut State, begun: Contact, covering: &Covering) -> Option<usize> {
    let (tool, body) = (begun.tool, begun.body);
    let green = &model.bodies[body].green;
    let State { bodies, contacts, compliance, tools, pressures } = &mut *state;
    let slot = contacts.empty(begun.local.further)?;
    if begun.law == LawKind::Local {
        let serial = contacts.next_serial();
        contacts.put(slot, Contact { serial, ..begun });
        if let Some(pressures) = pressures.get_mut(slot) {
            *pressures = PressureState::default();
        }
        return Some(slot);
    }
    if let Err(refusal) = contacts.patches[slot].admit(green, &covering.candidate) {
        tools[tool].refused[body] = Some(refusal);
        return None;
    }
    let serial = contacts.next_serial();
    contacts.put(slot, Contact { serial, ..begun });
    compliance[slot][slot] = contacts.patches[slot].own_compliance(green);
    for other in contacts.on(body).filter(|&other| other != slot) {
        let block = contacts.patches[slot].compliance_with(green, &contacts.patches[other]);
        compliance[slot][other] = block;
        compliance[other][slot] = block.transpose();
    }
    if let (Some(motion), Some(dynamics)) = (&mut bodies[body].motion, &model.bodies[body].dynamics) {
        motion.add_contact(&dynamics.modes, contacts, compliance, slot);
        // The tool's displacement counts from where the moving patch is met, and its free motion is taken off every step.
        let met = motion.free_displacement(slot) + motion.residual_displacement(contacts, slot);
        contacts.slots[slot].anchor -= met;
        contacts.slots[slot].displacement += met;
        contacts.slots[slot].wanted += met;
        contacts.slots[slot].met = met;
    }
    Some(slot)
}
