//! The tick, in stages.

use super::contact_forces::{solve_forces, update_compliance};
use super::stick;
use super::{Input, MAX_TOOLS, Mode, Model, Output, Scratch, State};

/// Advances the contacts of all tools by one tick and returns the forces on the devices.
pub fn step(model: &Model, state: &mut State, scratch: &mut Scratch, input: &Input) -> Output {
    let scale = input.stiffness_scale;
    state.stiffness_scale = if scale > 0.0 && scale.is_finite() { scale } else { 1.0 };

    // 1. Begin and end contacts by geometry and buttons.
    for tool in 0..MAX_TOOLS {
        if stick::advance(model, &mut state.tools[tool], scratch, &input.tools[tool], input) {
            update_compliance(model, state, tool);
        }
    }

    // 2. Forces of all contacts together; a press that would pull is let go, and the rest solved again.
    for _ in 0..MAX_TOOLS {
        solve_forces(model, state);
        let mut released = false;
        for contact in &mut state.tools {
            released |= stick::release_if_pulling(model, contact);
        }
        if !released {
            break;
        }
    }

    // 3. The device feels minus what the body feels.
    let mut output = Output::default();
    for (tool, contact) in state.tools.iter().enumerate() {
        output.force_on_device[tool] = -contact.force;
        output.in_contact[tool] = contact.mode != Mode::Free;
    }
    output
}
