//! Slip of sticking contacts beyond Coulomb's cone.
//!
//! A sticking contact carries any tangential force until it ends, and ends where it would pull: lifted after a drag, it would lose
//! all of that force within one tick. So a law may bound the tangential force `t` by `mu` times the pressing force `n`
//! (`Law::cone`): where it would be more, the anchor slips along `t` until `|t| = mu n`. Both then end at zero together.
//!
//! Forces are affine in the anchor of one contact, all others held: with a slip of length `s` along `e = t/|t|`
//!
//! ```text
//! t(s) = t - s g_t,   n(s) = n - s g_n,   |t(s)| = mu n(s),
//! ```
//!
//! a quadratic in `s` whose least positive root is the slip. `g` comes from one solve with a trial slip, so that it holds
//! whatever the contacts share, at rest and in motion.
//!
//! Beside edges a slip reduces the pressing force as well, `g_n > 0`. A tool that is lifted at a rate `n'` slips at the rate
//! `s' = mu n' / (g_t . e - mu g_n)`: where `mu` comes near `g_t . e / g_n` a slip takes away the force that bounds it,
//! and the contact is gone at once. So `mu` is at most half of that ratio, which doubles the slip and no more; but it is at least
//! [`LEAST_COEFFICIENT`], so that a contact loaded evenly sticks everywhere. The ratio is the contact's own, the forces of others
//! held: it does not change when one of them ends.
//!
//! A contact that begins where another tool has displaced the surface along itself has a tangential force before a pressing one.
//! That follows from sticking there; it slips only after its force has once been within the cone.
//!
//! A slip only dissipates energy. At a fixed tool the stored energy falls by `s (|t| + t(s) . e) / 2`, and `t(s) . e` is not
//! allowed to become negative. On a body in motion a slip takes the mean force of the step along the slip, `(1 - w) t0 + w t(s)`
//! (`energy`): where the force has just reversed, `t(s) . e` is kept above `-(1 - w) t0 . e / w`. A contact within its cone
//! keeps every bit.

use glam::DVec3;

use super::contacts::Contact;
use super::law::law_of;
use super::model::Model;
use super::solve::{contact_forces, own_compliance};
use super::state::State;
use super::system::System;

/// Least coefficient of a cone, whatever the coupling of pressing and sliding. Where dragging presses as much as it pulls along, a
/// contact then may end with a jump.
const LEAST_COEFFICIENT: f64 = 1.0;

/// Sweeps over the contacts of a body: a slip of one may move the force of another out of its cone. The rest after these sweeps, a
/// thousandth where two tools are a patch apart, is left to the next tick.
const SWEEPS: usize = 4;

/// Tolerance of the cone for a contact that has just slipped onto it.
const ROUNDING: f64 = 1e-9;

/// Lets contacts of a body slip whose forces lie outside their cones, and finds the forces of all again.
pub fn slip(model: &Model, state: &mut State, system: &mut System, body: usize) {
    for _ in 0..SWEEPS {
        if !sweep(model, state, system, body) {
            return;
        }
    }
}

/// One sweep over the contacts; returns whether any slipped.
fn sweep(model: &Model, state: &mut State, system: &mut System, body: usize) -> bool {
    let mut slipped = false;
    for slot in state.contacts.occupied() {
        let contact = &state.contacts.slots[slot];
        if contact.body != body {
            continue;
        }
        let Some(largest_coefficient) = law_of(contact.law).cone(contact) else { continue };
        let contact = *contact;
        let force = ForceParts::of(contact.force, contact.normal);
        let Some(direction) = force.direction_beyond(LEAST_COEFFICIENT) else {
            state.contacts.slots[slot].was_in_cone |= force.pressing > 0.0;
            continue;
        };
        let own = own_compliance(model, state, slot).inverse() * direction;
        let coefficient = ForceParts::of(own, contact.normal).coefficient(direction, largest_coefficient);
        let outside = force.direction_beyond(coefficient * (1.0 + ROUNDING)).is_some();
        state.contacts.slots[slot].was_in_cone |= !outside;
        if !(outside && contact.was_in_cone) {
            continue;
        }
        // The forces are affine in the length, so that any trial length serves.
        let trial = model.tools[contact.tool].radius;
        shift_anchor(&mut state.contacts.slots[slot], direction * trial);
        contact_forces(model, state, system, body);
        let after = ForceParts::of(state.contacts.slots[slot].force, contact.normal);
        let rate = ForceParts {
            pressing: (force.pressing - after.pressing) / trial,
            tangential: (force.tangential - after.tangential) / trial,
        };
        let most = (force.tangential.length() - least_tangential(model, state, slot, direction)).max(0.0)
            / rate.tangential.dot(direction);
        let length = slip_length(&force, &rate, coefficient, most);
        shift_anchor(&mut state.contacts.slots[slot], direction * (length - trial));
        contact_forces(model, state, system, body);
        slipped = true;
    }
    slipped
}

/// Pressing and tangential part of the force of a contact on the body, N, or of its decrease with the slip, N/m.
struct ForceParts {
    pressing: f64,
    tangential: DVec3,
}

impl ForceParts {
    /// Parts of a vector at a surface.
    fn of(vector: DVec3, normal: DVec3) -> Self {
        let pressing = -vector.dot(normal);
        Self { pressing, tangential: vector + normal * pressing }
    }

    /// Direction of the tangential force, if it is more than `coefficient` times the pressing one. A contact that pulls does not
    /// slip: it ends.
    fn direction_beyond(&self, coefficient: f64) -> Option<DVec3> {
        let outside = self.pressing > 0.0 && self.tangential.length() > coefficient * self.pressing;
        if outside { self.tangential.try_normalize() } else { None }
    }

    /// Coefficient of the cone from the decrease with the slip, see the module's header.
    fn coefficient(&self, direction: DVec3, largest_coefficient: f64) -> f64 {
        let along = self.tangential.dot(direction);
        let coupled = if self.pressing > 0.0 { 0.5 * along / self.pressing } else { largest_coefficient };
        coupled.clamp(LEAST_COEFFICIENT, largest_coefficient)
    }
}

/// Least tangential force along the slip that remains, N. On a body in motion the mean of the step is then zero.
fn least_tangential(model: &Model, state: &State, slot: usize, direction: DVec3) -> f64 {
    let body = state.contacts.slots[slot].body;
    let (Some(motion), Some(dynamics)) = (&state.bodies[body].motion, &model.bodies[body].dynamics) else { return 0.0 };
    let weight = dynamics.modes.integration.weight();
    let before = motion.last_force(&state.contacts, slot).dot(direction);
    (-before * (1.0 - weight) / weight).max(0.0)
}

/// Length of the slip that ends on the cone, at most `most`.
fn slip_length(force: &ForceParts, rate: &ForceParts, coefficient: f64, most: f64) -> f64 {
    let squared = coefficient * coefficient;
    let a = rate.tangential.length_squared() - squared * rate.pressing * rate.pressing;
    let b = force.tangential.dot(rate.tangential) - squared * force.pressing * rate.pressing;
    let c = force.tangential.length_squared() - squared * force.pressing * force.pressing;
    // a s^2 - 2 b s + c = 0 with c > 0: the form without a difference of like numbers, for either sign of a.
    let discriminant = b * b - a * c;
    let root = c / (b + discriminant.sqrt());
    if discriminant >= 0.0 && root > 0.0 && root < most { root } else { most }
}

/// Moves the anchor of a contact.
fn shift_anchor(contact: &mut Contact, by: DVec3) {
    contact.anchor += by;
    contact.displacement -= by;
    contact.tool_displacement -= by;
    contact.slipped += by;
}
