//! Account of the energy of a body in motion: what it holds, what tools put in, what damping took out.
//!
//! The force `f` of a contact does the work of a step with its mean, `(1 - w) f0 + w f1` (`dynamics::Integration::weight`). Then
//! a spring of the extensions `e0`, `e1` takes up `(w - 1/2) k_c (e1 - e0)^2` less than it is given. A contact that begins or
//! ends touches for an unknown part of the step: its tool's work there is what body and contact take up,
//!
//! ```text
//! (mean of f) . (change of W^T u) + (change of f^2 / 2 k_c + indentation + f^T R f / 2)
//! ```
//!
//! With the tool's whole way in that step instead, or with none of it, the account would be off by the force times that way.

use glam::{DMat3, DVec3};

use super::MAX_CONTACTS;
use super::contacts::{Contacts, Mode, REVISIONS};
use crate::dynamics::{Energy, StepEnergy};

/// A contact as it was booked last.
#[derive(Clone, Copy, Debug, Default)]
struct Booked {
    /// Which one.
    begun: u64,
    /// Force on the body, N.
    force: DVec3,
    /// Displacement of the tool, m.
    displacement: DVec3,
    /// What its spring, its indentation and the modes left out hold under its own force, J.
    stored: f64,
}

/// Energies so far, and what the next booking starts from.
#[derive(Clone, Debug, Default)]
pub struct Account {
    /// Where the energy is.
    pub energy: Energy,
    /// The contacts at the end of the last step.
    last: [Option<Booked>; MAX_CONTACTS],
}

impl Account {
    /// Whether a contact of the body begins or ends in a slot within the step that is being made.
    pub fn changes(&self, contacts: &Contacts, body: usize, slot: usize) -> bool {
        self.last[slot].map(|booked| booked.begun) != begun(contacts, body, slot)
    }

    /// Force on the body in a slot at the end of the last step, N.
    pub fn last_force(&self, slot: usize) -> DVec3 {
        self.last[slot].map_or(DVec3::ZERO, |booked| booked.force)
    }

    /// Books what the modes hold at a step's end, and what damping took out within it.
    pub fn book_step(&mut self, step: &StepEnergy) {
        (self.energy.kinetic, self.energy.strain) = (step.kinetic, step.strain);
        self.energy.dissipated += step.dissipated;
    }

    /// Books what springs, indentations and the modes left out hold.
    pub fn book_contacts(
        &mut self,
        contacts: &Contacts,
        slots: &[usize],
        coupling: f64,
        residual: &[[DMat3; MAX_CONTACTS]; MAX_CONTACTS],
    ) {
        self.energy.coupling = 0.0;
        for &a in slots {
            let force = contacts.slots[a].force;
            self.energy.coupling += in_contact(contacts, a, coupling);
            self.energy.dissipated += contacts.slots[a].local.dissipated;
            let beyond: DVec3 = slots.iter().map(|&b| residual[a][b] * contacts.slots[b].force).sum();
            self.energy.strain += 0.5 * force.dot(beyond);
        }
    }

    /// Books the work of the tools, given how far the patches of contacts that begin or end have `moved` in the step, m. Of that
    /// of the others a slip of the anchor takes its part out.
    pub fn book_work(
        &mut self,
        (contacts, body): (&Contacts, usize),
        (coupling, weight): (f64, f64),
        residual: &[[DMat3; MAX_CONTACTS]; MAX_CONTACTS],
        moved: &[DVec3; MAX_CONTACTS],
    ) {
        for slot in 0..MAX_CONTACTS {
            let changes = self.changes(contacts, body, slot);
            let (contact, before) = (&contacts.slots[slot], self.last[slot]);
            let now = begun(contacts, body, slot).map(|begun| Booked {
                begun,
                force: contact.force,
                displacement: contact.displacement,
                stored: in_contact(contacts, slot, coupling)
                    + 0.5 * contact.force.dot(residual[slot][slot] * contact.force),
            });
            let [f0, f1] = [before, now].map(|booked| booked.map_or(DVec3::ZERO, |booked| booked.force));
            let mean = f0 + (f1 - f0) * weight;
            if changes {
                let [held, holds] = [before, now].map(|booked| booked.map_or(0.0, |booked| booked.stored));
                self.energy.work += mean.dot(moved[slot]) + holds - held;
            } else if let Some(before) = before {
                self.energy.work += mean.dot(contact.displacement + contact.slipped - before.displacement);
                self.energy.dissipated += mean.dot(contact.slipped);
            }
            self.last[slot] = now;
        }
    }
}

/// Which contact of the body a slot has. One that waits without a force is none yet.
fn begun(contacts: &Contacts, body: usize, slot: usize) -> Option<u64> {
    let contact = &contacts.slots[slot];
    let touches = contact.mode != Mode::Free && contact.body == body && contact.force != DVec3::ZERO;
    touches.then_some(contact.serial >> REVISIONS)
}

/// What spring and indentation of a contact hold, J.
fn in_contact(contacts: &Contacts, slot: usize, coupling: f64) -> f64 {
    let contact = &contacts.slots[slot];
    0.5 * contact.force.length_squared() / coupling + contact.local.energy
}
