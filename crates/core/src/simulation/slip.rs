//! Contacts that stick slip where they are hardly pressed.
//!
//! A sticking contact carries any tangential force until it lets go, and lets go where it would pull: lifted from a drag it
//! drops all of that force within one tick. So a law may bound the tangential force `t` by `mu` times the pressing force `n`
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
//! Beside edges a slip takes pressing force away as well, `g_n > 0`. While a tool is lifted at a rate `n'` the slip goes on at
//! `s' = mu n' / (g_t . e - mu g_n)`: where `mu` comes near `g_t . e / g_n` a slip takes away the force that bounds it,
//! and the contact is gone at once. So `mu` is at most half of that ratio, which doubles the slip and no more; but it is at least
//! [`SHALLOWEST`], so that a contact loaded evenly sticks everywhere. The ratio is the contact's own, the forces of others
//! held: it does not change when one of them ends.
//!
//! A contact that lands in the dent of another tool finds material that is displaced along the surface, and force along it before
//! there is any into it. That is what sticking there means; it slips only after its force has once been within the cone.
//!
//! A slip only takes energy out. With the tool where it is the contacts hold `s (|t| + t(s) . e) / 2` less, and `t(s) . e` is
//! kept from turning negative. On a body in motion it takes the mean force of the step along the slip, `(1 - w) t0 + w t(s)`
//! (`energy`): where the force has just turned round, `t(s) . e` is kept above `-(1 - w) t0 . e / w`. A contact within its cone
//! keeps every bit.

use glam::DVec3;

use super::MAX_CONTACTS;
use super::contacts::{Contact, Mode};
use super::law::law_of;
use super::model::Model;
use super::solve::{contact_forces, own_compliance};
use super::state::State;
use super::system::System;

/// No coupling of pressing and sliding makes a cone less steep than this: a contact then may let go with a jump, where
/// dragging presses as much as it pulls along.
const SHALLOWEST: f64 = 1.0;

/// Sweeps over the contacts of a body in which those slip that others have pushed out of their cones; what is left after
/// them, a thousandth where two tools are a patch apart, waits for the next tick.
const SWEEPS: usize = 4;

/// Part of the cone within which a contact that has just slipped onto it is left alone.
const ROUNDING: f64 = 1e-9;

/// Lets contacts of a body slip whose forces, just found, leave their cones; the forces of all are found again.
pub fn slip(model: &Model, state: &mut State, system: &mut System, body: usize) {
    for _ in 0..SWEEPS {
        if !sweep(model, state, system, body) {
            return;
        }
    }
}

/// Each contact once; whether any slipped.
fn sweep(model: &Model, state: &mut State, system: &mut System, body: usize) -> bool {
    let mut slipped = false;
    for slot in 0..MAX_CONTACTS {
        let contact = &state.contacts.slots[slot];
        if contact.mode == Mode::Free || contact.body != body {
            continue;
        }
        let Some(steepest) = law_of(contact.law).cone(contact) else { continue };
        let contact = *contact;
        let force = Parts::along(contact.force, contact.normal);
        let Some(direction) = force.beyond(SHALLOWEST) else {
            state.contacts.slots[slot].settled |= force.pressing > 0.0;
            continue;
        };
        let own = own_compliance(model, state, slot).inverse() * direction;
        let coefficient = Parts::along(own, contact.normal).coefficient(direction, steepest);
        let outside = force.beyond(coefficient * (1.0 + ROUNDING)).is_some();
        state.contacts.slots[slot].settled |= !outside;
        if !(outside && contact.settled) {
            continue;
        }
        // Any length will do: the forces are affine in it.
        let trial = model.tools[contact.tool].radius;
        shift(&mut state.contacts.slots[slot], direction * trial);
        contact_forces(model, state, system, body);
        let after = Parts::along(state.contacts.slots[slot].force, contact.normal);
        let rate = Parts {
            pressing: (force.pressing - after.pressing) / trial,
            tangential: (force.tangential - after.tangential) / trial,
        };
        let most =
            (force.tangential.length() - kept(model, state, slot, direction)).max(0.0) / rate.tangential.dot(direction);
        let length = slip_length(&force, &rate, coefficient, most);
        shift(&mut state.contacts.slots[slot], direction * (length - trial));
        contact_forces(model, state, system, body);
        slipped = true;
    }
    slipped
}

/// A force of a contact on the body, into it and along it, N, or its decrease with the slip, N/m.
struct Parts {
    pressing: f64,
    tangential: DVec3,
}

impl Parts {
    /// Of a vector beside a surface.
    fn along(vector: DVec3, normal: DVec3) -> Self {
        let pressing = -vector.dot(normal);
        Self { pressing, tangential: vector + normal * pressing }
    }

    /// Direction of the tangential force, if it is more than `coefficient` times the pressing one. A contact that pulls is
    /// not for slipping: it ends.
    fn beyond(&self, coefficient: f64) -> Option<DVec3> {
        let outside = self.pressing > 0.0 && self.tangential.length() > coefficient * self.pressing;
        if outside { self.tangential.try_normalize() } else { None }
    }

    /// Of a decrease with the slip: the coefficient of the cone, see the module's header.
    fn coefficient(&self, direction: DVec3, steepest: f64) -> f64 {
        let along = self.tangential.dot(direction);
        let coupled = if self.pressing > 0.0 { 0.5 * along / self.pressing } else { steepest };
        coupled.clamp(SHALLOWEST, steepest)
    }
}

/// Tangential force along the slip that it leaves at least, N: on a body in motion what makes the mean of the step none.
fn kept(model: &Model, state: &State, slot: usize, direction: DVec3) -> f64 {
    let body = state.contacts.slots[slot].body;
    let (Some(motion), Some(dynamics)) = (&state.bodies[body].motion, &model.bodies[body].dynamics) else { return 0.0 };
    let weight = dynamics.modes.integration.weight();
    let before = motion.last_force(&state.contacts, slot).dot(direction);
    (-before * (1.0 - weight) / weight).max(0.0)
}

/// Length of the slip that ends on the cone, at most `most`.
fn slip_length(force: &Parts, rate: &Parts, coefficient: f64, most: f64) -> f64 {
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
fn shift(contact: &mut Contact, by: DVec3) {
    contact.anchor += by;
    contact.displacement -= by;
    contact.wanted -= by;
    contact.slipped += by;
}
