//! Estimated error of the forces of linear contacts on a body whose material has a law beyond small strain.
//!
//! A patch of radius `b` that carries the force `F` displaces a neo-Hookean half-space by (`series::half_space`)
//!
//! ```text
//! q = h_1 F/(E b) (1 + h_2/h_1 x + h_3/h_1 x^2),    x = F/(E b^2)
//! ```
//!
//! of which a linear contact has the first term. The ratios are largest at a Poisson's ratio near 0.45.

use super::input::Controls;
use super::model::Model;
use super::state::State;

/// Error of the elements.
const CONSTANT: f64 = 0.015;
/// `h_2/h_1` and `h_3/h_1`.
const SQUARE: f64 = 0.14;
const CUBE: f64 = 0.24;
/// Error of the rest of the body over the square of the displacement over the smallest side of its box.
const BY_DEPTH: f64 = 0.2;

/// Estimates the errors of the contacts of a body that are linear in the displacement of their tools.
pub fn estimate_linear_errors(model: &Model, state: &mut State, body: usize, controls: &Controls) {
    let fixed = &model.bodies[body];
    let Some(local) = fixed.local.as_ref().filter(|local| local.is_hyperelastic) else { return };
    let scale = state.bodies[body].stiffness_scale;
    let smallest = (local.bounds[1] - local.bounds[0]).min_element();
    for slot in state.contacts.occupied() {
        let contact = &state.contacts.slots[slot];
        if contact.body != body || contact.nonlinear {
            continue;
        }
        let Some(&node) = state.contacts.patches[slot].patch().nodes().first() else { continue };
        let width = controls.contact_radius[contact.tool].max(0.5 * fixed.mean_edge);
        let x = contact.force.length() / (scale * local.moduli.youngs[node as usize] * width * width);
        let depth = contact.displacement.length() / smallest;
        state.contacts.slots[slot].error = CONSTANT + x * (SQUARE + x * CUBE) + BY_DEPTH * depth * depth;
    }
}
