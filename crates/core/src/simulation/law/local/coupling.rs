//! Coupling of contacts of one body under the local law: the compliance between their blended nodes.

use glam::{DMat3, DVec3};

use super::foot_jumps::merge_share;
use super::scratch::{LocalScratch, local_body};
use crate::contact::regular::compliance_of;
use crate::contact::smooth::FanWeights;
use crate::simulation::model::Model;
use crate::simulation::state::State;

/// Compliance between the contacts, and its gradient by the position of each.
pub fn couple(model: &Model, state: &mut State, local: &mut LocalScratch, slots: &[usize], body: usize) {
    let green = &model.bodies[body].green;
    let scale = state.bodies[body].stiffness_scale;
    for (a, &slot) in slots.iter().enumerate() {
        if state.bodies[body].motion.is_none() {
            blend_patch(model, state, &local.weights[a], slot, body);
        }
        (local.others[a].slope, local.others[a].turn) = (DVec3::ZERO, DVec3::ZERO);
    }
    let Some(fans) = model.bodies[body].local.as_ref().map(|own| own.smooth.fans()) else { return };
    for (a, &slot) in slots.iter().enumerate() {
        for (b, &other) in slots.iter().enumerate().filter(|&(b, _)| b != a) {
            let patches = &state.contacts.patches;
            let [tool, same] = [slot, other].map(|slot| state.contacts.slots[slot].tool);
            let distance = local.responses[a].foot.position.distance(local.responses[b].foot.position);
            let merged = if tool == same { merge_share(distance, model.tools[tool].radius) } else { 0.0 };
            let mean = (local.responses[a].compliance + local.responses[b].compliance) * 0.5;
            if state.bodies[body].motion.is_some() {
                // The slope is that of the moving surface; `follow_motion` sets it.
                let at_rest = patches[slot].compliance_with(green, &patches[other]);
                local.between[a][b] = at_rest * (1.0 - merged) + mean * merged + local.step_change[a][b];
                continue;
            }
            let (mut block, mut slope) = (DMat3::ZERO, DVec3::ZERO);
            let (own, force) = (local.responses[a].force, local.responses[b].force);
            for (fan, weight, gradient) in local.weights[a].with_gradients() {
                let of_node = patches[other].compliance_at(green, fans[fan].node as usize);
                block += of_node * (weight / scale);
                slope += gradient * (own.dot(of_node * force) / scale);
            }
            let mut turn = DVec3::ZERO;
            for (fan, by_rotation) in local.weights[a].with_turns().filter(|&(_, turn)| turn != DVec3::ZERO) {
                let of_node = patches[other].compliance_at(green, fans[fan].node as usize);
                turn += by_rotation * (own.dot(of_node * force) / scale);
            }
            local.others[a].turn += turn;
            if merged > 0.0
                && let Some(own_body) = local_body(model, &state.bodies, tool, body)
            {
                let mut shared = DVec3::ZERO;
                for (fan, _, gradient) in local.weights[a].with_gradients() {
                    shared += gradient * (0.5 * own.dot(compliance_of(&own_body.fields[fan]) * force) / scale);
                }
                slope = slope * (1.0 - merged) + shared * merged;
            }
            local.between[a][b] = block * (1.0 - merged) + mean * merged;
            local.others[a].slope += slope;
        }
    }
}

/// Sets the patch of a contact to the nodes of its fans with their blending weights.
pub fn blend_patch(model: &Model, state: &mut State, weights: &FanWeights, slot: usize, body: usize) {
    let fixed = &model.bodies[body];
    let Some(local) = &fixed.local else { return };
    let fans = local.smooth.fans();
    state.contacts.patches[slot].blend(&fixed.green, weights.iter().map(|(fan, weight)| (fans[fan].node, weight)));
}
