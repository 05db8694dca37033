//! What acts at a contact beside the tool and the half-space: sizes of the body, loads, other contacts, friction.

use glam::DVec3;

use super::scratch::LocalScratch;
use crate::mesh::Faces;
use crate::simulation::input::Controls;
use crate::simulation::model::Model;
use crate::simulation::state::State;

/// What else acts at a contact.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings {
    /// One over the thickness of the body below, 1/m.
    pub inverse_thickness: f64,
    /// One over its breadth there, the distance through it along lines inclined by 60 degrees, 1/m.
    pub inverse_breadth: f64,
    /// Displacement by the other contacts and by loads, m.
    pub by_others: DVec3,
    pub by_loads: DVec3,
    /// Coefficient of friction.
    pub friction: f64,
    /// Whether the elements of the body have 4 nodes.
    pub has_linear_elements: bool,
}

/// What else acts at one of the contacts of a body.
pub fn surroundings(
    model: &Model,
    state: &State,
    local: &LocalScratch,
    (slots, a): (&[usize], usize),
    body: usize,
    controls: &Controls,
) -> Surroundings {
    let slot = slots[a];
    let [inverse_thickness, inverse_breadth] =
        local.weights[a].iter().fold([0.0; 2], |[thickness, breadth], (fan, weight)| {
            let own = model.bodies[body].local.as_ref().map_or([0.0; 2], |own| own.inverse_sizes[fan]);
            [thickness + weight * own[0], breadth + weight * own[1]]
        });
    let others = (0..slots.len()).filter(|&b| b != a);
    let by_others: DVec3 = others.map(|b| local.between[a][b] * local.responses[b].force).sum();
    let by_linear = local.free_positions[a].distance(state.contacts.slots[slot].local.tool_position);
    let by_loads = local.weights[a].iter().map(|(fan, weight)| load_displacement(model, body, fan) * weight).sum();
    let friction = controls.friction[state.contacts.slots[slot].tool];
    Surroundings {
        inverse_thickness,
        inverse_breadth,
        by_others: by_others + DVec3::X * by_linear,
        by_loads,
        friction,
        has_linear_elements: matches!(model.bodies[body].green.surface.faces, Faces::Linear(_)),
    }
}

/// Displacement of the surface at a fan by the loads of a body, m.
fn load_displacement(model: &Model, body: usize, fan: usize) -> DVec3 {
    let fixed = &model.bodies[body];
    fixed.load_displacement(fixed.local.as_ref().map_or(0, |own| own.smooth.fans()[fan].node as usize))
}
