//! The tick, in stages.

use super::contacts::{Contact, Mode};
use super::input::{Controls, Input, Output};
use super::law::{Approach, law_of};
use super::model::Model;
use super::scratch::Scratch;
use super::slip::slip;
use super::sound::is_sound;
use super::state::{Entry, State};
use super::tool::LawKind;
use super::{MAX_CONTACTS, further, limit, solve, time};

/// Advances the contacts of all tools, and the bodies that move, by one tick; returns the wrenches on the devices.
pub fn step(model: &Model, state: &mut State, scratch: &mut Scratch, input: &Input) -> Output {
    for body in 0..model.bodies.len() {
        state.bodies[body].stiffness_scale = stiffness_scale(model, body, input);

        // 1. A body that moves makes as many time steps as have come due; one that does not answers at once.
        time::begin_strike(model, state, scratch, body, input);
        time::pass_time(model, state, body, &input.controls);
        while time::begin_step(model, state, body) {
            // 2. Contacts begin, follow their tools, and push.
            follow_tools(model, state, scratch, body, input);
            limit::apply(model, state, scratch, body, input.controls.strain_limit[body]);
            push(model, state, scratch, body, &input.controls);
            further::find_wall(model, state, scratch, body);

            // 3. Their forces go into the motion.
            if !time::end_step(model, state, body) {
                break;
            }
        }
    }

    for (tool, said) in state.tools.iter_mut().zip(&input.tools) {
        tool.has_left = (tool.has_left || (tool.before.is_some() && !said.active)) && !input.controls.reset;
        tool.before = (said.active && said.pose.is_finite()).then_some(said.pose);
    }

    // 4. The device feels minus what the bodies feel.
    answer(model, state)
}

/// Contacts of a body begin, follow their tools, or end, by geometry and buttons.
fn follow_tools(model: &Model, state: &mut State, scratch: &mut Scratch, body: usize, input: &Input) {
    for (tool, tool_model) in model.tools.iter().enumerate() {
        let said = &input.tools[tool];
        let (places, count) = gather(state, tool, body);
        let places = &places[..count];
        let law_of_contact = places.first().map(|&slot| state.contacts.slots[slot].law);
        let law = law_of(law_now(tool_model.law, law_of_contact, said.grab));
        let was_refused = state.tools[tool].refused[body].take();
        if !said.active || input.controls.reset || !said.pose.is_finite() {
            state.tools[tool].entry[body] = Entry::default();
            places.iter().for_each(|&slot| state.contacts.clear(slot));
            continue;
        }
        let known = state.tools[tool];
        let approach = Approach::new(model, state.bodies[body].motion.as_ref(), (tool, body), &known, input);
        let mut lasts = false;
        for &slot in places {
            if law.update(&approach, &mut state.contacts.slots[slot]) {
                lasts |= !state.contacts.slots[slot].local.held;
            } else {
                let depth = approach.depth();
                state.tools[tool].entry[body] = Entry { depth, reached: depth };
                state.contacts.clear(slot);
            }
        }
        if count > 0 {
            if lasts {
                // Walls beside a tool that is no sphere show when it has been pressed.
                if approach.pressed.is_none() {
                    further::find(model, state, scratch, (tool, body));
                }
                continue;
            }
            if places.iter().any(|&slot| state.contacts.slots[slot].mode == Mode::Free) {
                continue;
            }
        }
        match law.begin(&approach, &mut state.tools[tool].entry[body], &mut scratch.covering) {
            Ok(Some(begun)) => {
                if let Some(slot) = solve::add_contact(model, state, begun, &scratch.covering) {
                    limit::begin(model, state, slot, input.controls.strain_limit[body]);
                }
            }
            // It is still as deep as where it was refused, or where it has gone since.
            Ok(None) if state.tools[tool].entry[body].reached > 0.0 => state.tools[tool].refused[body] = was_refused,
            Ok(None) => {}
            Err(refusal) => state.tools[tool].refused[body] = Some(refusal),
        }
    }
}

/// Slots of a tool's contacts with a body, and how many there are. A tool that presses nowhere waits nowhere.
fn gather(state: &mut State, tool: usize, body: usize) -> ([usize; MAX_CONTACTS], usize) {
    let mut places = [0; MAX_CONTACTS];
    let mut count = 0;
    for slot in state.contacts.of(tool, body) {
        places[count] = slot;
        count += 1;
    }
    if places[..count].iter().all(|&slot| state.contacts.slots[slot].waits()) {
        places[..count].iter().for_each(|&slot| state.contacts.clear(slot));
        count = 0;
    }
    (places, count)
}

/// The law of a tool's contact: a tool that holds on does so by a patch, whatever its law.
fn law_now(of_tool: LawKind, of_contact: Option<LawKind>, grab: bool) -> LawKind {
    match of_contact {
        Some(law) => law,
        None if grab && of_tool == LawKind::Local => LawKind::Patch,
        None => of_tool,
    }
}

/// Forces of all contacts of a body together; a contact whose law ends it by its force is let go, and the rest solved
/// again.
fn push(model: &Model, state: &mut State, scratch: &mut Scratch, body: usize, controls: &Controls) {
    // Contacts that stick are pushed by those that slide, and these by them. Each kind is solved for by itself, given the other's
    // forces: first those that stick under the sliding forces of the tick before, which is off by the product of both
    // couplings, below a thousandth of what a tick changes; without that they were felt a whole tick late.
    let sticks = |slot: usize| state.contacts.slots[slot].law != LawKind::Local;
    if state.contacts.on(body).any(sticks) && !state.contacts.on(body).all(sticks) {
        solve::contact_forces(model, state, &mut scratch.system, body);
    }
    let Scratch { covering, local, system } = scratch;
    solve::local_forces(model, state, solve::Memory { covering, local, system }, body, controls);
    limit::let_through(model, state, body, controls.strain_limit[body]);
    for _ in 0..model.tools.len() {
        solve::contact_forces(model, state, &mut scratch.system, body);
        slip(model, state, &mut scratch.system, body);
        let mut ended = false;
        for slot in 0..state.contacts.slots.len() {
            let contact = &mut state.contacts.slots[slot];
            if contact.mode == Mode::Free || contact.body != body {
                continue;
            }
            if law_of(contact.law).end(contact) {
                let contact = *contact;
                state.contacts.clear(slot);
                remember(model, state, &contact);
                ended = true;
            } else {
                contact.pressed = true;
            }
        }
        if !ended {
            break;
        }
    }
}

/// What a tool remembers of a contact that its force has ended: how deep it is, so that the next one starts from zero. On a
/// body at rest a contact that has never pressed is forgotten: the tool is in a dent that others have made, and begins anew
/// until it has come through it.
fn remember(model: &Model, state: &mut State, contact: &Contact) {
    let (tool, body) = (contact.tool, contact.body);
    let moves = model.bodies[body].moves();
    let entry = &mut state.tools[tool].entry[body];
    if contact.law == LawKind::Local {
        entry.reached = contact.local.depth.max(0.0);
        return;
    }
    if !moves && !contact.pressed {
        return;
    }
    let position = contact.anchor + contact.wanted;
    let motion = state.bodies[body].motion.as_ref();
    state.tools[tool].entry[body].depth = Approach::at(model, motion, tool, body, position).depth();
}

pub(super) fn answer(model: &Model, state: &State) -> Output {
    let mut output = Output::default();
    for (contact, _) in state.contacts.iter() {
        let placement = &model.bodies[contact.body].placement;
        let (force, torque) = (contact.force, contact.local.torque);
        let whole = if contact.law == LawKind::Local { 1.0 / contact.local.share } else { 1.0 };
        for (wrench, scale) in [(&mut output.wrench_on_device, 1.0), (&mut output.unlimited, whole)] {
            wrench[contact.tool].force -= placement.vector_to_world(force * scale);
            wrench[contact.tool].torque += placement.vector_to_world(torque * scale);
        }
        output.in_contact[contact.tool] = true;
        output.limited[contact.tool] |= contact.limited;
        output.unsound[contact.tool] |= !is_sound(model, contact, state.bodies[contact.body].stiffness_scale);
    }
    for tool in (0..model.tools.len()).filter(|&tool| output.unsound[tool]) {
        (output.wrench_on_device[tool], output.unlimited[tool]) = Default::default();
    }
    output
}

/// A body in motion keeps the stiffness that its modes belong to.
fn stiffness_scale(model: &Model, body: usize, input: &Input) -> f64 {
    let scale = input.controls.stiffness_scale[body];
    if scale > 0.0 && scale.is_finite() && !model.bodies[body].moves() { scale } else { 1.0 }
}
