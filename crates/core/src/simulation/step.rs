//! The tick, in stages.

use super::contact_forces::{solve_forces, update_compliance};
use super::{Input, MAX_TOOLS, Mode, Model, Output, Scratch, State};
use super::{motion, stick};

/// Advances the contacts of all tools, and the body where it moves, by one tick; returns the forces on the devices.
pub fn step(model: &Model, state: &mut State, scratch: &mut Scratch, input: &Input) -> Output {
    let scale = input.stiffness_scale;
    state.stiffness_scale = if scale > 0.0 && scale.is_finite() && model.dynamics.is_none() { scale } else { 1.0 };

    // 1. A body that moves makes as many time steps as have come due; one that does not answers at once.
    motion::strike(model, state, scratch, input);
    motion::pass_time(model, state, input);
    while motion::begin_step(model, state) {
        // 2. Contacts begin and end, and push.
        begin_and_end(model, state, scratch, input);
        push(model, state);

        // 3. Their forces go into the motion.
        if !motion::end_step(model, state) {
            break;
        }
    }

    // 4. The device feels minus what the body feels.
    let mut output = Output::default();
    for (tool, contact) in state.tools.iter().enumerate() {
        output.force_on_device[tool] = -contact.force;
        output.in_contact[tool] = contact.mode != Mode::Free;
    }
    output
}

/// Begins and ends contacts by geometry and buttons.
fn begin_and_end(model: &Model, state: &mut State, scratch: &mut Scratch, input: &Input) {
    for tool in 0..MAX_TOOLS {
        let (contacts, moving) = (&mut state.tools, state.motion.as_ref());
        if stick::advance(model, moving, &mut contacts[tool], scratch, &input.tools[tool], input) {
            update_compliance(model, state, tool);
        }
    }
}

/// Forces of all contacts together; a press that would pull is let go, and the rest solved again.
fn push(model: &Model, state: &mut State) {
    for _ in 0..MAX_TOOLS {
        solve_forces(model, state);
        let mut released = false;
        for contact in &mut state.tools {
            released |= stick::release_if_pulling(model, state.motion.as_ref(), contact);
        }
        if !released {
            break;
        }
    }
}
