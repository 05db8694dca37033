//! The tick, in stages.

use super::contacts::{Mode, SlotList};
use super::input::{Controls, Input, Output};
use super::law::{Approach, LAWS, is_sound, law_of};
use super::linear_error::estimate_linear_errors;
use super::model::Model;
use super::scratch::Scratch;
use super::slip::slip;
use super::state::{EntryDepth, State};
use super::tool::LawKind;
use super::{limit, solve, time};

/// Advances the contacts of all tools, and the bodies that move, by one tick; returns the wrenches on the devices.
pub fn step(model: &Model, state: &mut State, scratch: &mut Scratch, input: &Input) -> Output {
    for body in 0..model.bodies.len() {
        state.bodies[body].stiffness_scale = stiffness_scale(model, body, input);

        // 1. A body in motion makes as many time steps as are due; a body at rest makes one static solve.
        time::begin_strike(model, state, scratch, body, input);
        time::pass_time(model, state, body, &input.controls);
        while time::begin_step(model, state, body) {
            // 2. Contacts begin and follow their tools; their forces are found.
            follow_tools(model, state, scratch, body, input);
            limit::apply(model, state, scratch, body, input.controls.strain_limit[body]);
            find_forces(model, state, scratch, body, &input.controls);
            for law in LAWS {
                law.find_additional_by_force(model, state, scratch.memory(), body);
            }

            // 3. The forces act on the motion.
            if !time::end_step(model, state, body) {
                break;
            }
        }
    }

    for (tool, tool_input) in state.tools.iter_mut().zip(&input.tools) {
        tool.has_left =
            (tool.has_left || (tool.previous_pose.is_some() && !tool_input.active)) && !input.controls.reset;
        tool.previous_pose = (tool_input.active && tool_input.pose.is_finite()).then_some(tool_input.pose);
    }

    // 4. The wrench on a device is minus that on the bodies.
    output_wrenches(model, state)
}

/// Contacts of a body begin, follow their tools, or end, by geometry and buttons.
fn follow_tools(model: &Model, state: &mut State, scratch: &mut Scratch, body: usize, input: &Input) {
    for (tool, tool_model) in model.tools.iter().enumerate() {
        let tool_input = &input.tools[tool];
        let list = SlotList::of(state.contacts.of(tool, body));
        let slots = end_pending(state, &list);
        let law_of_contact = slots.first().map(|&slot| state.contacts.slots[slot].law);
        let law = law_of(contact_law(tool_model.law, law_of_contact, tool_input.grab));
        let was_refused = state.tools[tool].refused[body].take();
        if !tool_input.active || input.controls.reset || !tool_input.pose.is_finite() {
            state.tools[tool].entry[body] = EntryDepth::default();
            slots.iter().for_each(|&slot| state.contacts.clear(slot));
            continue;
        }
        let motion = state.bodies[body].motion.as_ref();
        let approach = Approach::new(model, motion, (tool, body), &state.tools[tool], input);
        let mut lasts = false;
        for &slot in slots {
            if law.update(&approach, &mut state.contacts.slots[slot]) {
                lasts |= law.persists(&state.contacts.slots[slot]);
            } else {
                let depth = approach.depth();
                state.tools[tool].entry[body] = EntryDepth { threshold: depth, previous: depth };
                state.contacts.clear(slot);
            }
        }
        if !slots.is_empty() {
            if lasts {
                law.find_additional(model, state, scratch.memory(), (tool, body));
                continue;
            }
            if slots.iter().any(|&slot| state.contacts.slots[slot].mode == Mode::Free) {
                continue;
            }
        }
        match law.begin(&approach, &mut state.tools[tool].entry[body], &mut scratch.weight_scratch) {
            Ok(Some(new_contact)) => {
                if let Some(slot) = law.add(model, state, new_contact, &scratch.weight_scratch) {
                    limit::begin(model, state, slot, input.controls.strain_limit[body]);
                }
            }
            // The tool is still in the body: the reason of the last refusal stays.
            Ok(None) if state.tools[tool].entry[body].previous > 0.0 => state.tools[tool].refused[body] = was_refused,
            Ok(None) => {}
            Err(refusal) => state.tools[tool].refused[body] = Some(refusal),
        }
    }
}

/// Ends the contacts of a tool with a body if all are pending, none presses; returns those that go on.
fn end_pending<'a>(state: &mut State, slots: &'a [usize]) -> &'a [usize] {
    if slots.iter().all(|&slot| state.contacts.slots[slot].is_pending()) {
        slots.iter().for_each(|&slot| state.contacts.clear(slot));
        return &[];
    }
    slots
}

/// The law of a tool's contact.
fn contact_law(of_tool: LawKind, of_contact: Option<LawKind>, grab: bool) -> LawKind {
    match of_contact {
        Some(law) => law,
        None if grab => law_of(of_tool).grab_law(),
        None => of_tool,
    }
}

/// Forces of all contacts of a body together. A contact that its law ends by its force is removed, and the others are solved
/// again.
fn find_forces(model: &Model, state: &mut State, scratch: &mut Scratch, body: usize, controls: &Controls) {
    // Linear and nonlinear contacts displace each other. Each kind is solved given the forces of the other: first the linear ones
    // under the nonlinear forces of the previous tick. The error is the product of both couplings, below a thousandth of the change
    // in a tick. Without this first solve the nonlinear contacts would respond to the linear ones one tick late.
    let linear = |slot: usize| !state.contacts.slots[slot].nonlinear;
    if state.contacts.on(body).any(linear) && !state.contacts.on(body).all(linear) {
        solve::contact_forces(model, state, &mut scratch.system, body);
    }
    for law in LAWS {
        law.find_forces(model, state, scratch.memory(), body, controls);
    }
    // The limit is that of linear elasticity.
    let limit = if model.bodies[body].is_hyperelastic() { 0.0 } else { controls.strain_limit[body] };
    limit::limit_sliding_forces(model, state, body, limit);
    for _ in 0..model.tools.len() {
        solve::contact_forces(model, state, &mut scratch.system, body);
        slip(model, state, &mut scratch.system, body);
        let mut ended = false;
        for slot in state.contacts.occupied() {
            let contact = &mut state.contacts.slots[slot];
            if contact.body != body {
                continue;
            }
            let law = law_of(contact.law);
            if law.ends(contact) {
                let contact = *contact;
                state.contacts.clear(slot);
                law.store_entry_depth(model, state, &contact);
                ended = true;
            } else {
                contact.has_pressed = true;
            }
        }
        if !ended {
            break;
        }
    }
    estimate_linear_errors(model, state, body, controls);
}

pub(super) fn output_wrenches(model: &Model, state: &State) -> Output {
    let mut output = Output::default();
    for (contact, _) in state.contacts.iter() {
        let placement = &model.bodies[contact.body].placement;
        let (force, torque) = (contact.force, contact.torque);
        let whole = 1.0 / contact.share;
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

/// Stiffness scale of a body; a body in motion keeps the stiffness of its modes.
fn stiffness_scale(model: &Model, body: usize, input: &Input) -> f64 {
    let scale = input.controls.stiffness_scale[body];
    if scale > 0.0 && scale.is_finite() && !model.bodies[body].moves() { scale } else { 1.0 }
}
