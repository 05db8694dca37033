//! Passivity of contacts under the local law on a body at rest: they give out no more energy than tools have put in.
//!
//! What contacts hold changes by the work of their tools less what friction takes out, as long as forces are the gradient of one
//! energy. Where a contact comes to lie on another side of an edge, or cells pass one, the method can hold more than before:
//!
//! ```text
//! surplus += E_new - E_old - W + dissipated         W = sum (f_old + f_new)/2 . dp - (T_old + T_new)/2 . dtheta
//! ```
//!
//! Beyond a part of the most that has been held the surplus is taken back: contacts begin at a larger approach. The energy is convex
//! in the approach and zero without it, so that with a part `s` of the approach no more than `s E` is held. An observer and controller
//! of passivity (Hannaford and Ryu, 2002, 10.1109/70.988969) that acts on the geometry, not on the force.

use glam::{DQuat, DVec3};

use super::handover::approach;
use super::local_scratch::LocalScratch;
use crate::simulation::contacts::{Contact, Contacts, REVISIONS};
use crate::simulation::model::Model;
use crate::simulation::rotation::rotation_vector;
use crate::simulation::{MAX_CONTACTS, law::takes_cells};

/// Part of the most energy that has been held which may be given out beyond what was put in, and to which it is taken back.
const TOLERANCE: f64 = 9e-4;
const TAKEN_BACK_TO: f64 = 0.9 * TOLERANCE;
/// A surplus below the first part of the most is taken back by no more than the second part of the approach in a tick, so that it is
/// not felt as a jump.
const SMALL: f64 = 0.05;
const GENTLY: f64 = 0.01;
/// Ticks over which a surplus is forgotten: a tool that goes round for minutes would add up rounding.
const FORGOTTEN: f64 = 1000.0;

/// A contact as it was booked last.
#[derive(Clone, Copy, Debug, Default)]
struct Booked {
    /// Which one.
    begun: Option<u64>,
    /// Where its tool was, less what other laws move the body by, m, and how it was turned.
    from: DVec3,
    orientation: DQuat,
    /// Force on the body, N.
    force: DVec3,
    /// Torque on the tool, N m.
    torque: DVec3,
}

/// The account of a body.
#[derive(Clone, Debug, Default)]
pub struct Passivity {
    last: [Booked; MAX_CONTACTS],
    held: Held,
    /// Young's modulus over the Green's function's.
    scale: f64,
}

/// Energies of the contacts of a body, J.
#[derive(Clone, Copy, Debug, Default)]
pub struct Held {
    /// Now.
    stored: f64,
    /// The most since one began.
    most: f64,
    /// What they hold beyond what was put in.
    surplus: f64,
}

impl Held {
    /// The part of their approach that contacts may keep, if they hold too much.
    pub fn part_to_keep(&self) -> Option<f64> {
        let excess = self.surplus - TAKEN_BACK_TO * self.most;
        let least = if excess < SMALL * self.most { 1.0 - GENTLY } else { 0.0 };
        (self.surplus > TOLERANCE * self.most).then(|| (1.0 - excess / self.stored).max(least))
    }
}

impl Passivity {
    /// Nothing touches.
    pub fn end(&mut self) {
        if self.held.most != 0.0 {
            *self = Self::default();
        }
    }

    /// What contacts hold with the answers that have been found.
    pub fn observe(&self, contacts: &Contacts, local: &LocalScratch, slots: &[usize], scale: f64) -> Held {
        let (mut stored, mut put_in) = (0.0, 0.0);
        for (a, &slot) in slots.iter().enumerate() {
            let response = &local.responses[a];
            let moved: DVec3 = (0..slots.len()).map(|b| local.between[a][b] * local.responses[b].force).sum();
            let own = response.indentation.energy + response.springs().energy() + 0.5 * response.force.dot(moved);
            stored += own;
            let (now, before) = (booked(&contacts.slots[slot], local, a), &self.last[slot]);
            put_in += if now.begun == before.begun {
                let turned = rotation_vector(before.orientation, now.orientation);
                0.5 * (before.force + now.force).dot(now.from - before.from)
                    - 0.5 * (before.torque + now.torque).dot(turned)
                    - response.friction.dissipated
            } else {
                own
            };
        }
        // Another stiffness is not the tool's work.
        let made = if scale == self.scale { stored - self.held.stored - put_in } else { 0.0 };
        let surplus = self.held.surplus * (1.0 - 1.0 / FORGOTTEN) + made;
        Held { stored, most: self.held.most.max(stored), surplus }
    }

    /// Books what has been observed.
    pub fn book(&mut self, held: Held, contacts: &Contacts, local: &LocalScratch, slots: &[usize], scale: f64) {
        (self.held, self.scale) = (held, scale);
        self.last = Default::default();
        for (a, &slot) in slots.iter().enumerate() {
            self.last[slot] = booked(&contacts.slots[slot], local, a);
        }
    }
}

fn booked(contact: &Contact, local: &LocalScratch, a: usize) -> Booked {
    Booked {
        begun: Some(contact.serial >> REVISIONS),
        from: local.from[a],
        orientation: contact.local.orientation,
        force: local.responses[a].force,
        torque: local.responses[a].torque,
    }
}

/// Lets contacts keep a part of their approach.
pub fn take_back(model: &Model, contacts: &mut Contacts, local: &LocalScratch, slots: &[usize], part: f64) {
    for (a, &slot) in slots.iter().enumerate() {
        let contact = &mut contacts.slots[slot];
        let tool = &model.tools[contact.tool];
        let mut there = *contact;
        there.local.foot = local.responses[a].foot;
        let deep = approach(tool, &there, local.from[a]) - contact.local.entry;
        if takes_cells(&tool.shape) {
            // The approach counts along the normal that has been found.
            contact.local.foot = there.local.foot;
        }
        contact.local.entry += (1.0 - part) * deep.max(0.0);
    }
}
