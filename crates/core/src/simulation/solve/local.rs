//! Contacts under the local law: where each tool is over the surface at rest, by Newton's method on all of them together.
//!
//! ```text
//! p'_a + sum_b C_ab f_b(p'_b) = p_a - u_free,a
//! ```
//!
//! Sneddon's force grows ever steeper with the approach: from a place that is too deep the method approaches the answer from
//! that side, and one step brings any other place there.

use glam::{DMat3, DVec3};

use crate::contact::local::cells::Resolution;
use crate::contact::regular::WIDTH;
use crate::contact::{Refusal, patch_weights};
use crate::simulation::MAX_CONTACTS;
use crate::simulation::contacts::{Contact, Mode};
use crate::simulation::covering::Covering;
use crate::simulation::input::Controls;
use crate::simulation::law::{Cells, Guess, LocalTool, Others, evaluate, posed, takes_cells};
use crate::simulation::model::Model;
use crate::simulation::solve::coupling::{couple, cover};
use crate::simulation::solve::forces::dent_of;
use crate::simulation::solve::handover::{
    Found, approach, change_parts, go_on, hand_over, has_jumped, hold_lost, join,
};
use crate::simulation::solve::local_scratch::{LocalScratch, local_body};
use crate::simulation::solve::surplus::{book, take_back_surplus};
use crate::simulation::state::{Entry, State};
use crate::simulation::system::System;
use crate::simulation::tool::LawKind;
use crate::tensor::outer;

/// Most steps; three or four are usual.
pub const MOST_STEPS: usize = 16;
/// From this step on steps are shortened, ever more: in a hollow about as narrow as the tool the force turns with the place so
/// fast that whole steps go to and fro.
const USUAL_STEPS: usize = 10;
/// Longest step, over the tool's radius.
const LONGEST: f64 = 0.5;
/// Where the last step is longer than this, over the tool's radius, nothing has been found.
const LOST: f64 = 2e-3;
/// Most steps where a tool takes pressure cells, whose every answer costs a hundred times a closed form's; two or three are usual.
pub const MOST_CELL_STEPS: usize = 8;
/// A step of such a tool that leaves more of the equation than there was is taken back to a part of it within these bounds: as a
/// force that grows with the depth to the power 3/2 would leave nothing.
const TAKEN_BACK: [f64; 2] = [0.01, 0.5];
const DEPTH_BY_FORCE: f64 = 2.0 / 3.0;
/// Where more of the equation than this, over the tool's thickness, is left of it, the tool may have come away: its last answer is
/// asked for where no force has moved the body.
const AWAY: f64 = 1e-2;
/// Cosine of the angle to the inward normal from which a tool has gone through the body, not beside it.
const THROUGH: f64 = 0.5;
/// A step of this length, over the tool's radius, is none.
const SETTLED: f64 = 1e-7;
/// A force that differs by less than this part from what was expected is found.
const SAME: f64 = 1e-7;
/// Both, over those above, where a tool takes pressure cells. They are found to 1e-6 of the depth, and the step that is left, of
/// 1e-5 of the radius, bounds the error of the force; what it differs from the expected only tells that steps still go to and fro.
const CELLS_LOOSER: [f64; 2] = [1e2, 1e4];
/// Steps in which the compliance between contacts follows them.
const FOLLOWED: usize = 3;

fn local_tool<'a>(model: &'a Model, controls: &Controls, tool: usize) -> LocalTool<'a> {
    let fixed = &model.tools[tool];
    LocalTool {
        shape: &fixed.shape,
        radius: fixed.radius,
        pad: fixed.pad_youngs_modulus,
        coefficient: controls.friction[tool],
    }
}

/// Whether the contact in a slot takes pressure cells.
fn takes_pressures(model: &Model, state: &State, slot: usize) -> bool {
    takes_cells(&model.tools[state.contacts.slots[slot].tool].shape)
}

/// How fine cells may be: the more contacts take them, the coarser, so that a tick stays within its time.
fn resolution(model: &Model, state: &State) -> Resolution {
    let slots = &state.contacts.slots;
    let local = |slot: usize| slots[slot].mode != Mode::Free && slots[slot].law == LawKind::Local;
    match (0..MAX_CONTACTS).filter(|&slot| local(slot) && takes_pressures(model, state, slot)).count() {
        0 | 1 => Resolution::Fine,
        2..=4 => Resolution::Medium,
        _ => Resolution::Coarse,
    }
}

/// Memory of a tick, as far as contacts under the local law need it.
pub struct Memory<'a> {
    pub covering: &'a mut Covering,
    pub local: &'a mut LocalScratch,
    pub system: &'a mut System,
}

/// What has become of the method.
enum Outcome {
    Settled,
    Lost,
    /// A contact had to be let go.
    LetGo,
}

/// Forces of the contacts of a body under the local law. Where the foot of one has jumped, or none was found, they are found once
/// more, with what takes its place. Where that finds nothing either they stay as they were a tick ago.
pub fn local_forces(model: &Model, state: &mut State, mut memory: Memory<'_>, body: usize, controls: &Controls) {
    let mut last = false;
    memory.local.pressed = None;
    memory.local.footprint.near.forget();
    loop {
        let mut slots = [0; MAX_CONTACTS];
        let mut count = 0;
        for slot in state.contacts.on(body).filter(|&slot| state.contacts.slots[slot].law == LawKind::Local) {
            slots[count] = slot;
            count += 1;
        }
        let slots = &slots[..count];
        if count == 0 {
            return state.bodies[body].passivity.end();
        }
        match settle(model, state, &mut memory, slots, body, controls) {
            Outcome::Settled => {}
            // The others go on without it.
            Outcome::LetGo => continue,
            Outcome::Lost if last => {
                return slots.iter().for_each(|&slot| {
                    let contact = &mut state.contacts.slots[slot];
                    contact.force = contact.local.force;
                });
            }
            Outcome::Lost => {
                hold_lost(state, &memory.local.steps[..count], slots);
                last = true;
                continue;
            }
        }
        let (responses, places) = (&memory.local.responses, &memory.local.places);
        let found = Found { responses, places, covering: memory.covering };
        let done = last
            || !(hand_over(model, state, found, slots) || take_back_surplus(model, state, memory.local, slots, body));
        if done {
            book(model, state, memory.local, slots, body);
            take_up(model, state, memory.local, slots, body);
            return;
        }
        last = true;
    }
}

/// Newton's method.
fn settle(
    model: &Model,
    state: &mut State,
    memory: &mut Memory<'_>,
    slots: &[usize],
    body: usize,
    controls: &Controls,
) -> Outcome {
    let Memory { covering, local, system } = memory;
    local.turn_to(body);
    local.others[..slots.len()].fill(Others::default());
    follow_motion(model, state, covering, local, slots, body);
    for (a, &slot) in slots.iter().enumerate() {
        let contact = &state.contacts.slots[slot];
        // Whatever moves goes on as it did.
        local.places[a] = contact.local.relative + contact.local.advance;
        local.from[a] = contact.local.tool - free_displacement(model, state, body, slot);
        local.responses[a].force = contact.local.force;
        local.responses[a].foot = contact.local.foot;
    }
    let cells = slots.iter().any(|&slot| takes_pressures(model, state, slot));
    let (most, [looser, looser_force]) = if cells { (MOST_CELL_STEPS, CELLS_LOOSER) } else { (MOST_STEPS, [1.0; 2]) };
    let tool = &model.tools[state.contacts.slots[slots[0]].tool];
    let radius = if cells { tool.shape.thickness() } else { tool.radius };
    let mut least = f64::INFINITY;
    local.stepped = false;
    for step in 0..most {
        local.taken = step + 1;
        if !meet(model, state, local, slots, body, controls, step) {
            return Outcome::LetGo;
        }
        if cells {
            let miss = local.miss(slots.len());
            // From a place where nothing touches the method does not find back.
            let untouched = local.untouched(slots.len());
            if miss.is_nan() || (miss > least && !untouched) {
                // A part of the last step, or where it led from.
                let part = (least / miss).powf(DEPTH_BY_FORCE).clamp(TAKEN_BACK[0], TAKEN_BACK[1]);
                local.take_back(slots.len(), if step + 1 < most { part } else { 0.0 });
            } else {
                least = miss;
                local.keep(slots.len());
            }
            if step + 2 == most && least > AWAY * radius && all_away(model, state, local, slots) {
                let from = local.from;
                local.places[..slots.len()].copy_from_slice(&from[..slots.len()]);
                continue;
            }
            if miss.is_nan() || (miss > least && !untouched) {
                continue;
            }
        }
        let longest = advance(local, system, slots.len());
        let longest = if cells { local.go_by_power(slots.len()) } else { longest };
        if step >= USUAL_STEPS || longest > LONGEST * radius {
            let share = (LONGEST * radius / longest).min(if step < USUAL_STEPS { 1.0 } else { 0.5 });
            local.steps[..slots.len()].iter_mut().for_each(|step| *step *= share);
        }
        // What contacts do to each other is known from the first step on.
        let knows_others = step > 0 || slots.len() == 1;
        if knows_others && longest < looser * SETTLED * radius && local.changed < looser_force * SAME {
            break;
        }
        if step + 1 < most {
            local.go(slots.len());
        } else if !cells && longest > LOST * radius {
            return Outcome::Lost;
        }
    }
    Outcome::Settled
}

/// Whether all tools are outside of the body, before or beside the places that they touched, where no force moves the body.
fn all_away(model: &Model, state: &State, local: &LocalScratch, slots: &[usize]) -> bool {
    slots.iter().zip(&local.from).all(|(&slot, &from)| {
        let contact = &state.contacts.slots[slot];
        let (tool, foot) = (&model.tools[contact.tool], &contact.local.foot);
        let centre = from + contact.local.orientation * tool.shape.centre();
        let outside = model.bodies[contact.body].closest(centre).is_some_and(|closest| closest.signed_distance > 0.0);
        let offset = centre - foot.position;
        outside && offset.dot(foot.normal) > -THROUGH * offset.length()
    })
}

/// Displacement at a contact that does not come from contacts under the local law: the free motion of the body, or on one at
/// rest what contacts that stick do to it, m.
fn free_displacement(model: &Model, state: &State, body: usize, slot: usize) -> DVec3 {
    match &state.bodies[body].motion {
        Some(motion) => motion.free_displacement(slot),
        None => dent_of(model, state, slot, |law| law != LawKind::Local),
    }
}

/// On a body in motion each contact is met where it was a step ago, over a patch so wide that what the local law has less
/// than the patch is monotonic even where the body is rigid within a step ([`WIDTH`]).
fn follow_motion(
    model: &Model,
    state: &mut State,
    covering: &mut Covering,
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
        let Some(regular) = model.regular[contacts.slots[slot].tool][body].as_deref() else { return };
        let (contact, weights) = (&contacts.slots[slot].local, &mut local.weights[a]);
        let (foot, tool) = (&contact.foot, &model.tools[contacts.slots[slot].tool]);
        match model.pressed[contacts.slots[slot].tool][body].as_deref() {
            // With the weights that its compliance has.
            Some(pressed) => {
                let at = posed(&tool.shape, contact, contact.relative);
                let near = &mut local.footprint.near;
                near.gather(pressed, &fixed.query, &at);
                if local.footprint.find(&pressed.fine, &own.smooth, contact.plane(), weights).is_none() {
                    own.smooth.weigh(foot, weights);
                }
            }
            None => own.smooth.weigh(foot, weights),
        }
        let wide = weights.blend(&regular.fields).values[WIDTH];
        let centre = fixed.material_point(&fixed.surface_point(foot));
        let (surface, patches) = (&fixed.green.surface, &mut covering.patches[body]);
        // As many nodes as at the fans around fit.
        if patch_weights(surface, &fixed.geometry, &centre, wide, patches, &mut covering.candidate).is_ok() {
            contacts.patches[slot].admit_touchable(&fixed.green, &covering.candidate);
        }
        motion.follow_contact(&dynamics.modes, contacts, slot);
        motion.leave_out_static(&dynamics.modes, contacts, slot);
        let (mut moving, mut turning) = (DMat3::ZERO, DMat3::ZERO);
        let turns = weights.with_turns().map(|(_, turn)| turn);
        for ((fan, _, gradient), turn) in weights.with_gradients().zip(turns) {
            let moved = motion.remaining_displacement(&dynamics.modes, own.smooth.fans()[fan].node);
            moving += outer(gradient, moved);
            turning += outer(turn, moved);
        }
        (local.others[a].moving, local.others[a].moving_turn) = (Some(moving), Some(turning));
    }
    for (a, &slot) in slots.iter().enumerate() {
        for (b, &other) in slots.iter().enumerate() {
            let mut change = motion.change_in_a_step(&dynamics.modes, slot, other);
            if a == b {
                change += DMat3::IDENTITY * (1.0 / dynamics.coupling);
            }
            local.change[a][b] = change;
        }
    }
}

/// Answers of all contacts at their places. A contact that has come where nothing may be touched is let go: false.
fn meet(
    model: &Model,
    state: &mut State,
    local: &mut LocalScratch,
    slots: &[usize],
    body: usize,
    controls: &Controls,
    step: usize,
) -> bool {
    local.changed = 0.0;
    let resolution = resolution(model, state);
    for (a, &slot) in slots.iter().enumerate() {
        let tool = state.contacts.slots[slot].tool;
        let answer = local_body(model, state, tool, body).and_then(|met| {
            let LocalScratch { places, responses, others, weights, cells, footprint, unused, .. } = &mut *local;
            let contact = &state.contacts.slots[slot].local;
            let pressures = state.pressures.get_mut(slot).unwrap_or(unused);
            let cells = Cells { state: pressures, scratch: cells, footprint, resolution };
            let tool = local_tool(model, controls, tool);
            let guess = Guess { place: places[a], force: responses[a].force, foot: &responses[a].foot };
            evaluate(met, tool, contact, guess, others[a], &mut weights[a], cells)
        });
        match answer {
            Some(answer) => {
                let change = (answer.force - local.responses[a].force).length();
                local.changed = local.changed.max(change / answer.force.length().max(f64::MIN_POSITIVE));
                local.responses[a] = answer;
                local.pressed = takes_pressures(model, state, slot).then_some(slot);
            }
            None => {
                if local.weights[a].is_outside() {
                    let [node, ..] = model.bodies[body].loaded.triangles[local.responses[a].foot.triangle as usize];
                    state.tools[tool].refused[body] = Some(Refusal::NotTouchable(node));
                    // Where it comes in again its force begins at zero, however deep it is.
                    state.tools[tool].entry[body] = Entry { depth: f64::INFINITY, reached: f64::INFINITY };
                }
                state.contacts.clear(slot);
                return false;
            }
        }
        local.between[a][a] = local.responses[a].compliance;
        if state.bodies[body].motion.is_some() {
            local.between[a][a] += local.change[a][a];
        }
    }
    if slots.len() > 1 && step < FOLLOWED {
        couple(model, state, local, slots, body);
    }
    true
}

/// One step of Newton's method; the longest of all.
fn advance(local: &mut LocalScratch, system: &mut System, count: usize) -> f64 {
    for a in 0..count {
        let mut residual = local.places[a] - local.from[a];
        for b in 0..count {
            let between = local.between[a][b];
            residual += between * local.responses[b].force;
            let mut block = between * local.responses[b].jacobian;
            if a == b {
                block += DMat3::IDENTITY;
            }
            for row in 0..3 {
                for column in 0..3 {
                    system.matrix[3 * a + row][3 * b + column] = block.col(column)[row];
                }
            }
        }
        system.right[3 * a..3 * a + 3].copy_from_slice(&(-residual).to_array());
    }
    system.solve_unsymmetric(3 * count);
    let mut longest = 0.0f64;
    for a in 0..count {
        let step = DVec3::from_slice(&system.right[3 * a..3 * a + 3]);
        let step = if step.is_finite() { step } else { DVec3::ZERO };
        local.steps[a] = step;
        longest = longest.max(step.length());
    }
    longest
}

/// Writes the answers down.
fn take_up(model: &Model, state: &mut State, local: &LocalScratch, slots: &[usize], body: usize) {
    for (a, &slot) in slots.iter().enumerate() {
        let response = &local.responses[a];
        let contact = &state.contacts.slots[slot];
        let tool = contact.tool;
        if has_jumped(model, contact, response, local.places[a]) {
            state.tools[tool].entry[body].depth = f64::INFINITY;
            state.contacts.clear(slot);
            continue;
        }
        match &mut state.bodies[body].motion {
            Some(motion) => {
                let Some(dynamics) = &model.bodies[body].dynamics else { continue };
                motion.keep_residual(&dynamics.modes, slot, &response.compliance);
            }
            None => cover(model, state, &local.weights[a], slot, body),
        }
        let contact: &mut Contact = &mut state.contacts.slots[slot];
        // What has just begun comes from nowhere.
        let begun = contact.local.force == DVec3::ZERO && takes_cells(&model.tools[tool].shape);
        (contact.force, contact.local.force) = (response.force, response.force);
        (contact.point, contact.normal) = (response.point, response.normal);
        (contact.displacement, contact.wanted) =
            (contact.local.tool - contact.anchor, contact.local.tool - contact.anchor);
        let own = &mut contact.local;
        own.advance = if begun { DVec3::ZERO } else { local.places[a] - own.relative };
        own.relative = local.places[a];
        own.turned = own.orientation;
        (own.foot, own.sunk) = (response.foot, response.sunk);
        own.friction = response.springs();
        let indentation = &response.indentation;
        (own.torque, own.radius, own.slipping) = (response.torque, indentation.radius, response.friction.slipping);
        let along = response.normal.dot(response.compliance * response.normal);
        own.stiffness = indentation.stiffness / (1.0 + along * indentation.stiffness);
        own.energy = indentation.energy + response.springs().energy();
        own.dissipated = response.friction.dissipated;
        contact.local.depth = approach(&model.tools[tool], contact, contact.local.tool);
        if !go_on(&model.tools[tool], contact) {
            state.contacts.clear(slot);
        }
    }
    change_parts(state, &local.responses, slots);
    join(model, state, slots);
}
