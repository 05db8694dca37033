//! Positions of all tools over the surface at rest under the local law, by Newton's method on all contacts of a body together.
//!
//! ```text
//! p'_a + sum_b C_ab f_b(p'_b) = p_a - u_free,a
//! ```
//!
//! Sneddon's force is convex in the approach: from a position that is too deep the method converges from that side, and one step
//! brings any other position there.

use glam::{DMat3, DVec3};

use super::additional::other_planes;
use super::coupling::{blend_patch, couple};
use super::energy_surplus::{commit_energy, observe_energy, remove_energy_surplus};
use super::foot_jumps::{
    SolvedContacts, any_may_slip, contact_depth, continue_contact, fade_merged_contacts, fix_lost_contacts,
    fix_snapping_contacts, foot_has_jumped, replace_jumped_contacts, update_parts,
};
use super::force_error::{ForceError, estimate};
use super::half_space::LocalTool;
use super::inclination::OtherContacts;
use super::near_corner::{contact_needs_cells, evaluate};
use super::newton::newton_step;
use super::pace::MOST_CELL_STEPS;
use super::response::{Guess, LocalResponse};
use super::scratch::{LocalScratch, TrustRegion, local_body};
use super::snap::SNAP_STEPS;
use super::surroundings::surroundings;
use super::wrench::{CellMemory, placed_shape};
use crate::contact::local::FrictionResponse;
use crate::contact::local::cells::Resolution;
use crate::contact::regular::{WIDTH, blend_fields};
use crate::contact::{Refusal, patch_weights};
use crate::simulation::MAX_CONTACTS;
use crate::simulation::contacts::{Contact, Mode, SlotList};
use crate::simulation::input::Controls;
use crate::simulation::law::TickMemory;
use crate::simulation::model::Model;
use crate::simulation::solve::contact_displacement;
use crate::simulation::state::{EntryDepth, State};
use crate::simulation::tool::LawKind;
use crate::simulation::weight_scratch::WeightScratch;
use crate::tensor::outer;

/// Residual, over the tool's thickness, beyond which the tool may have left the body: the last evaluation is at the position
/// without forces.
const AWAY_RESIDUAL: f64 = 1e-2;
/// Final residual, over the tool's thickness, beyond which the result is rejected: the force would be that of another position.
const LARGEST_RESIDUAL: f64 = 0.5;
/// Cosine of the angle to the inward normal beyond which a tool has passed through the body, not beside it.
const INSIDE_COSINE: f64 = 0.5;
/// Length of a converged step, over the tool's radius.
const STEP_TOLERANCE: f64 = 1e-7;
/// Relative difference of a converged force from its extrapolation.
const FORCE_TOLERANCE: f64 = 1e-7;
/// The same where the slope follows the force by its derivative: what is left was 3e-4 of the difference under a sliding sphere, whose
/// ticks need no second evaluation so.
const FOLLOWED_FORCE_TOLERANCE: f64 = 3e-5;
/// Factors of both with pressure cells. These are solved to 1e-6 of the depth, and the last step, below 1e-5 of the radius, bounds
/// the error of the force; the difference from the extrapolation only shows whether steps still oscillate.
const CELL_TOLERANCES: [f64; 2] = [1e2, 1e4];
/// Steps in which the compliance between contacts is updated.
const COUPLING_STEPS: usize = 3;

fn local_tool<'a>(model: &'a Model, controls: &Controls, tool: usize) -> LocalTool<'a> {
    let fixed = &model.tools[tool];
    LocalTool {
        shape: &fixed.shape,
        radius: fixed.radius,
        pad: fixed.pad_youngs_modulus,
        coefficient: controls.friction[tool],
    }
}

/// Resolution of cells: the more contacts need them, the coarser, so that a tick stays within its time.
fn resolution(model: &Model, state: &State) -> Resolution {
    let slots = &state.contacts.slots;
    let local = |slot: usize| slots[slot].mode != Mode::Free && slots[slot].law == LawKind::LOCAL;
    match (0..MAX_CONTACTS).filter(|&slot| local(slot) && contact_needs_cells(model, &slots[slot])).count() {
        0 | 1 => Resolution::Fine,
        2..=4 => Resolution::Medium,
        _ => Resolution::Coarse,
    }
}

/// Outcome of Newton's method.
enum Outcome {
    Converged,
    Diverged,
    /// The residual of tools with pressure cells is too large.
    Unsolved,
    /// A contact has ended.
    ContactEnded,
}

/// Forces of the contacts of a body under the local law. If a foot has jumped, or the method has diverged, they are solved once
/// more with the replacements. If that fails too, the forces of the previous tick stay.
pub fn local_forces(model: &Model, state: &mut State, mut memory: TickMemory<'_>, body: usize, controls: &Controls) {
    let mut last = false;
    memory.local.pressed_slot = None;
    memory.local.footprint.near.invalidate();
    loop {
        let is_local = |&slot: &usize| state.contacts.slots[slot].law == LawKind::LOCAL;
        let list = SlotList::of(state.contacts.on(body).filter(is_local));
        let slots = &*list;
        if slots.is_empty() {
            return state.bodies[body].passivity.reset();
        }
        match solve_equations(model, state, &mut memory, slots, body, controls) {
            Outcome::Converged => {}
            // Solved again without it.
            Outcome::ContactEnded => continue,
            Outcome::Unsolved => return keep_previous_forces(state, slots),
            Outcome::Diverged if last => return keep_previous_forces(state, slots),
            Outcome::Diverged => {
                fix_lost_contacts(model, state, &memory.local.steps[..slots.len()], slots);
                last = true;
                continue;
            }
        }
        let (responses, positions) = (&memory.local.responses, &memory.local.positions);
        let solved = SolvedContacts { responses, positions };
        let changed = !last
            && (fix_snapping_contacts(model, state, solved, slots)
                || replace_jumped_contacts(model, state, solved, slots));
        if !changed {
            let energy = observe_energy(model, state, memory.local, slots, body);
            if last || !remove_energy_surplus(model, state, memory.local, slots, energy) {
                commit_energy(state, body);
                return store_results(model, state, memory.local, slots, body, controls);
            }
        }
        last = true;
    }
}

/// Keeps the forces of the previous tick.
fn keep_previous_forces(state: &mut State, slots: &[usize]) {
    for &slot in slots {
        let contact = &mut state.contacts.slots[slot];
        contact.force = contact.local.force;
        (contact.local.last_step, contact.local.last_changes) = Default::default();
    }
}

/// Newton's method.
fn solve_equations(
    model: &Model,
    state: &mut State,
    memory: &mut TickMemory<'_>,
    slots: &[usize],
    body: usize,
    controls: &Controls,
) -> Outcome {
    let TickMemory { weight_scratch, local, system } = memory;
    local.select_body(body);
    local.others[..slots.len()].iter_mut().for_each(OtherContacts::reset);
    follow_motion(model, state, weight_scratch, local, slots, body);
    start_from_last_tick(model, state, local, slots, body);
    let cells = slots.iter().any(|&slot| contact_needs_cells(model, &state.contacts.slots[slot]));
    local.cell_resolution = cells.then(|| resolution(model, state));
    let [step_factor, force_factor] = if cells { CELL_TOLERANCES } else { [1.0; 2] };
    let tool = &model.tools[state.contacts.slots[slots[0]].tool];
    let radius = if cells { tool.shape.thickness() } else { tool.radius };
    let mut trust = TrustRegion::default();
    local.has_best = false;
    local.pace.begin(cells, radius, slots.len());
    local.acceleration.reset();
    for step in 0..SNAP_STEPS[0] {
        if cells && step == MOST_CELL_STEPS {
            break;
        }
        local.newton_steps = step + 1;
        if !evaluate_contacts(model, state, local, slots, body, controls, step) {
            return Outcome::ContactEnded;
        }
        if cells {
            let accepted = local.accept_step(slots.len(), step + 1 == MOST_CELL_STEPS, &mut trust);
            if step + 2 == MOST_CELL_STEPS
                && trust.least_residual > AWAY_RESIDUAL * radius
                && all_away(model, state, local, slots)
            {
                let from = local.free_positions;
                local.positions[..slots.len()].copy_from_slice(&from[..slots.len()]);
                continue;
            }
            if !accepted {
                continue;
            }
        }
        let (longest, unstable) = newton_step(local, system, slots.len());
        let (whole, responses) = (&local.steps[..slots.len()], &local.responses[..slots.len()]);
        local.pace.observe(step, whole, unstable, responses);
        let longest = if cells { local.lengthen_by_power_law(slots.len()) } else { longest };
        let share = local.pace.share(step, longest, trust.longest_step);
        if share < 1.0 {
            local.steps[..slots.len()].iter_mut().for_each(|step| *step *= share);
        }
        local.pace.secant.take(&local.steps[..slots.len()], share);
        // The coupling of contacts is known after the first step.
        let is_coupled = step > 0 || slots.len() == 1;
        let follows = local.responses[..slots.len()].iter().all(|response| response.slope_follows);
        let force_tolerance = if follows { FOLLOWED_FORCE_TOLERANCE } else { FORCE_TOLERANCE };
        if is_coupled
            && longest < step_factor * STEP_TOLERANCE * radius
            && local.force_change < force_factor * force_tolerance
        {
            break;
        }
        if local.pace.goes_on(step, longest, || any_may_slip(model, state, slots)) {
            local.take_step(slots.len(), share == 1.0);
        } else if local.pace.has_diverged(longest) {
            return Outcome::Diverged;
        } else {
            // One that would go on to and fro is not extrapolated.
            local.steps[..slots.len()].fill(DVec3::ZERO);
            break;
        }
    }
    // Where the force has been followed, the step that was not taken counts in that of the tick: its error would grow from tick to tick.
    if cells || local.force_change < FORCE_TOLERANCE {
        local.steps[..slots.len()].fill(DVec3::ZERO);
    }
    if cells && trust.least_residual > LARGEST_RESIDUAL * radius { Outcome::Unsolved } else { Outcome::Converged }
}

/// Begins with the results of the last tick, extrapolated by its steps.
fn start_from_last_tick(model: &Model, state: &State, local: &mut LocalScratch, slots: &[usize], body: usize) {
    for (a, &slot) in slots.iter().enumerate() {
        let contact = &state.contacts.slots[slot];
        local.positions[a] = contact.local.relative_position + contact.local.last_step;
        local.free_positions[a] = contact.local.tool_position - free_displacement(model, state, body, slot);
        local.responses[a].force = contact.local.force + contact.local.last_changes[0];
        local.responses[a].foot = contact.local.foot;
        local.responses[a].offset = contact.local.offset + contact.local.last_changes[1];
        local.responses[a].friction =
            FrictionResponse { force: contact.local.friction.force(), ..FrictionResponse::default() };
    }
}

/// Whether all tools would be outside of the body, in front of or beside their feet, if no contact had a force.
fn all_away(model: &Model, state: &State, local: &LocalScratch, slots: &[usize]) -> bool {
    slots.iter().zip(&local.free_positions).all(|(&slot, &from)| {
        let contact = &state.contacts.slots[slot];
        let (tool, foot) = (&model.tools[contact.tool], &contact.local.foot);
        let centre = from + contact.local.orientation * tool.shape.centre();
        let outside = model.bodies[contact.body].closest(centre).is_some_and(|closest| closest.signed_distance > 0.0);
        let offset = centre - foot.position;
        outside && offset.dot(foot.normal) > -INSIDE_COSINE * offset.length()
    })
}

/// Displacement at a contact that is not caused by contacts under the local law, m: the free motion of the body or, on a body at
/// rest, the displacement by sticking contacts.
fn free_displacement(model: &Model, state: &State, body: usize, slot: usize) -> DVec3 {
    match &state.bodies[body].motion {
        Some(motion) => motion.free_displacement(slot),
        None => contact_displacement(model, state, slot, |other| other.law != LawKind::LOCAL),
    }
}

/// Updates the patches and modal data of contacts of a body in motion, at the feet of the previous step. The patch is so wide that
/// the local law less the patch stays monotonic even where the body is rigid within a step ([`WIDTH`]).
fn follow_motion(
    model: &Model,
    state: &mut State,
    weight_scratch: &mut WeightScratch,
    local: &mut LocalScratch,
    slots: &[usize],
    body: usize,
) {
    let fixed = &model.bodies[body];
    let State { bodies, contacts, .. } = state;
    let (Some(motion), Some(dynamics), Some(own)) = (&mut bodies[body].motion, &fixed.dynamics, &fixed.local) else {
        return;
    };
    for (a, &slot) in slots.iter().enumerate() {
        let Some(regular) = model.regular_compliances[contacts.slots[slot].tool][body].as_deref() else { return };
        let (contact, weights) = (&contacts.slots[slot].local, &mut local.weights[a]);
        let (foot, tool) = (&contact.foot, &model.tools[contacts.slots[slot].tool]);
        match model.pressed_surfaces[contacts.slots[slot].tool][body].as_deref() {
            // With the same weights as its compliance.
            Some(pressed) => {
                let at = placed_shape(&tool.shape, contact, contact.relative_position);
                local.footprint.others = other_planes(contacts, slot);
                let near = &mut local.footprint.near;
                near.find(pressed, &fixed.query, &at);
                if local.footprint.find(&at, (&pressed.fine, &own.smooth), contact.plane(), weights).is_none() {
                    own.smooth.weigh(foot, weights);
                }
            }
            None => own.smooth.weigh(foot, weights),
        }
        let wide = blend_fields(weights, &regular.fields, false).values[WIDTH];
        let centre = fixed.material_point(&fixed.surface_point(foot));
        let (surface, patches) = (&fixed.green.surface, &mut weight_scratch.patches[body]);
        // Its nodes fit, for those at the fans around do.
        if patch_weights(surface, &fixed.geometry, &centre, wide, patches, &mut weight_scratch.candidate).is_ok() {
            contacts.patches[slot].set_touchable_part(&fixed.green, &weight_scratch.candidate);
        }
        motion.follow_contact(&dynamics.modes, contacts, slot);
        motion.subtract_static(&dynamics.modes, contacts, slot);
        let (mut motion_slope, mut turning) = (DMat3::ZERO, DMat3::ZERO);
        let turns = weights.with_turns().map(|(_, turn)| turn);
        for ((fan, _, gradient), turn) in weights.with_gradients().zip(turns) {
            let moved = motion.remaining_displacement(&dynamics.modes, own.smooth.fans()[fan].node);
            motion_slope += outer(gradient, moved);
            turning += outer(turn, moved);
        }
        (local.others[a].motion_slope, local.others[a].motion_turn) = (Some(motion_slope), Some(turning));
    }
    for (a, &slot) in slots.iter().enumerate() {
        for (b, &other) in slots.iter().enumerate() {
            let mut change = motion.step_compliance_change(&dynamics.modes, slot, other);
            if a == b {
                change += DMat3::IDENTITY * (1.0 / dynamics.coupling);
            }
            local.step_change[a][b] = change;
        }
    }
}

/// Evaluates all contacts at their positions. False if one has reached a part that is not touchable: it ends.
fn evaluate_contacts(
    model: &Model,
    state: &mut State,
    local: &mut LocalScratch,
    slots: &[usize],
    body: usize,
    controls: &Controls,
    step: usize,
) -> bool {
    for (a, &slot) in slots.iter().enumerate() {
        local.guessed[a] = local.responses[a].force;
        if local.cell_resolution.is_some() && contact_needs_cells(model, &state.contacts.slots[slot]) {
            local.footprint.others = other_planes(&state.contacts, slot);
        }
        let tool = state.contacts.slots[slot].tool;
        let response = local_body(model, &state.bodies, tool, body).and_then(|surface| {
            let LocalScratch {
                positions,
                responses,
                others,
                weights,
                cells,
                footprint,
                no_pressures,
                corner_weights,
                cell_resolution,
                ..
            } = &mut *local;
            let contact = &state.contacts.slots[slot].local;
            let pressures = state.pressures.get_mut(slot).unwrap_or(no_pressures);
            let resolution = cell_resolution.unwrap_or_default();
            let cells = CellMemory { state: pressures, scratch: cells, footprint, resolution, corner_weights };
            let tool = local_tool(model, controls, tool);
            let LocalResponse { force, foot, offset, friction, .. } = &responses[a];
            let (foot, friction) = (*foot, friction.force);
            let guess = Guess { place: positions[a], force: *force, friction, foot: &foot, offset: *offset };
            evaluate(surface, tool, contact, guess, &others[a], cells, (&mut weights[a], &mut responses[a]))
        });
        match response {
            Some(()) => {
                local.pressed_slot = model.tools[tool].shape.needs_cells().then_some(slot);
            }
            None => {
                if local.weights[a].is_outside() {
                    let [node, ..] = model.bodies[body].loaded.triangles[local.responses[a].foot.triangle as usize];
                    state.tools[tool].refused[body] = Some(Refusal::NotTouchable(node));
                    // Where it becomes touchable again its force starts from zero, however deep the tool is.
                    state.tools[tool].entry[body] = EntryDepth::INSIDE;
                }
                state.contacts.clear(slot);
                return false;
            }
        }
        local.between[a][a] = local.responses[a].compliance;
        if state.bodies[body].motion.is_some() {
            local.between[a][a] += local.step_change[a][a];
        }
    }
    if slots.len() > 1 && step < COUPLING_STEPS {
        couple(model, state, local, slots, body);
        // Otherwise the first step, which is without other contacts, would be that of another equation.
        for (a, &slot) in slots.iter().enumerate() {
            let Contact { tool, local: contact, .. } = &state.contacts.slots[slot];
            let tool = local_tool(model, controls, *tool);
            local.responses[a].find_force(tool, contact, local.positions[a], &local.others[a]);
        }
    }
    local.force_change = slots.iter().enumerate().fold(0.0, |most: f64, (a, _)| {
        let force = local.responses[a].force;
        most.max((force - local.guessed[a]).length() / force.length().max(f64::MIN_POSITIVE))
    });
    true
}

/// Stores the responses in the contacts.
fn store_results(
    model: &Model,
    state: &mut State,
    local: &LocalScratch,
    slots: &[usize],
    body: usize,
    controls: &Controls,
) {
    for (a, &slot) in slots.iter().enumerate() {
        let response = &local.responses[a];
        let contact = &state.contacts.slots[slot];
        let tool = contact.tool;
        if foot_has_jumped(model, contact, response, local.positions[a]) {
            state.tools[tool].entry[body].threshold = f64::INFINITY;
            state.contacts.clear(slot);
            continue;
        }
        match &mut state.bodies[body].motion {
            Some(motion) => {
                let Some(dynamics) = &model.bodies[body].dynamics else { continue };
                motion.set_residual_compliance(&dynamics.modes, slot, &response.compliance);
            }
            None => blend_patch(model, state, &local.weights[a], slot, body),
        }
        let contact: &mut Contact = &mut state.contacts.slots[slot];
        let is_first = contact.local.force == DVec3::ZERO && model.tools[tool].shape.needs_cells();
        contact.force = response.force;
        (contact.point, contact.normal) = (response.point, response.normal);
        (contact.displacement, contact.tool_displacement) =
            (contact.local.tool_position - contact.anchor, contact.local.tool_position - contact.anchor);
        let own = &mut contact.local;
        // A new contact has no previous step.
        let reached = local.positions[a] + local.steps[a];
        own.last_step = if is_first { DVec3::ZERO } else { reached - own.relative_position };
        own.last_changes = match response.has_higher_orders() {
            true => [response.force - own.force, response.offset - own.offset],
            false => [DVec3::ZERO; 2],
        };
        own.force = response.force;
        own.relative_position = local.positions[a];
        own.previous_orientation = own.orientation;
        (own.offset, own.penetration) = (response.offset, response.indentation.depth);
        if !own.is_fading {
            own.foot = response.foot;
        }
        own.friction = response.springs().copied().unwrap_or_default();
        let indentation = &response.indentation;
        (contact.torque, contact.radius) = (response.torque, indentation.radius);
        contact.slipping = response.friction.slipping;
        let along = response.normal.dot(response.compliance * response.normal);
        contact.stiffness = indentation.stiffness / (1.0 + along * indentation.stiffness);
        contact.energy = response.local_energy();
        contact.dissipated = response.friction.dissipated;
        contact.depth = contact_depth(&model.tools[tool], contact, contact.local.tool_position);
        let around = || surroundings(model, state, local, (slots, a), body, controls);
        let ForceError { relative, held } = estimate(&model.tools[tool], &state.contacts.slots[slot], response, around);
        let contact: &mut Contact = &mut state.contacts.slots[slot];
        (contact.error, contact.held) = (relative, held);
        if !continue_contact(&model.tools[tool], contact) {
            state.contacts.clear(slot);
        }
    }
    update_parts(model, state, &local.responses, slots);
    fade_merged_contacts(model, state, slots);
}
