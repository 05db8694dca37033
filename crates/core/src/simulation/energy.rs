//! Energy balance of a body in motion: stored energy, work of the tools, dissipation.
//!
//! The force `f` of a contact does the work of a step with its mean, `(1 - w) f0 + w f1` (`dynamics::Integration::weight`). Then
//! a spring of the extensions `e0`, `e1` stores `(w - 1/2) k_c (e1 - e0)^2` less than the work done on it. A contact that begins or
//! ends touches for an unknown part of the step. The work of its tool in that step is taken from the energy of body and contact,
//!
//! ```text
//! (mean of f) . (change of W^T u) + (change of f^2 / 2 k_c + indentation + f^T R f / 2)
//! ```
//!
//! With the tool's whole motion in that step, or with none of it, the error would be the force times that motion.

use glam::{DMat3, DVec3};

use super::MAX_CONTACTS;
use super::contacts::{Contacts, Mode, REVISIONS};
use crate::dynamics::{Energy, StepEnergy};

/// A contact at the end of the previous step.
#[derive(Clone, Copy, Debug, Default)]
struct PreviousContact {
    /// Its number among all contacts since the start.
    number: u64,
    /// Force on the body, N.
    force: DVec3,
    /// Displacement of the tool, m.
    displacement: DVec3,
    /// Energy of its spring, of its indentation and of the modes left out under its own force, J.
    stored: f64,
}

/// Energies since the start, and the contacts at the end of the previous step.
#[derive(Clone, Debug, Default)]
pub struct EnergyBalance {
    /// Energies by kind.
    pub energy: Energy,
    /// The contacts at the end of the last step.
    previous: [Option<PreviousContact>; MAX_CONTACTS],
}

impl EnergyBalance {
    /// Whether a contact of the body begins or ends in a slot within the current step.
    pub fn begins_or_ends(&self, contacts: &Contacts, body: usize, slot: usize) -> bool {
        self.previous[slot].map(|contact| contact.number) != contact_number(contacts, body, slot)
    }

    /// Force on the body in a slot at the end of the last step, N.
    pub fn last_force(&self, slot: usize) -> DVec3 {
        self.previous[slot].map_or(DVec3::ZERO, |contact| contact.force)
    }

    /// Records the energy of the modes at the end of a step and its dissipation.
    pub fn add_step(&mut self, step: &StepEnergy) {
        (self.energy.kinetic, self.energy.strain) = (step.kinetic, step.strain);
        self.energy.dissipated += step.dissipated;
    }

    /// Records the energy of springs, indentations and the modes left out.
    pub fn add_contacts(
        &mut self,
        contacts: &Contacts,
        slots: &[usize],
        coupling: f64,
        residual: &[[DMat3; MAX_CONTACTS]; MAX_CONTACTS],
    ) {
        self.energy.coupling = 0.0;
        for &a in slots {
            let force = contacts.slots[a].force;
            self.energy.coupling += contact_energy(contacts, a, coupling);
            self.energy.dissipated += contacts.slots[a].dissipated;
            let beyond: DVec3 = slots.iter().map(|&b| residual[a][b] * contacts.slots[b].force).sum();
            self.energy.strain += 0.5 * force.dot(beyond);
        }
    }

    /// Records the work of the tools. `moved` is the displacement in the step of the patches of contacts that begin or end, m. A
    /// slip of the anchor dissipates its part of the work of the other contacts.
    pub fn add_work(
        &mut self,
        (contacts, body): (&Contacts, usize),
        (coupling, weight): (f64, f64),
        residual: &[[DMat3; MAX_CONTACTS]; MAX_CONTACTS],
        moved: &[DVec3; MAX_CONTACTS],
    ) {
        for slot in 0..MAX_CONTACTS {
            let begins_or_ends = self.begins_or_ends(contacts, body, slot);
            let (contact, before) = (&contacts.slots[slot], self.previous[slot]);
            let now = contact_number(contacts, body, slot).map(|number| PreviousContact {
                number,
                force: contact.force,
                displacement: contact.displacement,
                stored: contact_energy(contacts, slot, coupling)
                    + 0.5 * contact.force.dot(residual[slot][slot] * contact.force),
            });
            let [f0, f1] = [before, now].map(|contact| contact.map_or(DVec3::ZERO, |contact| contact.force));
            let mean = f0 + (f1 - f0) * weight;
            if begins_or_ends {
                let [stored_before, stored_now] =
                    [before, now].map(|contact| contact.map_or(0.0, |contact| contact.stored));
                self.energy.work += mean.dot(moved[slot]) + stored_now - stored_before;
            } else if let Some(before) = before {
                self.energy.work += mean.dot(contact.displacement + contact.slipped - before.displacement);
                self.energy.dissipated += mean.dot(contact.slipped);
            }
            self.previous[slot] = now;
        }
    }
}

/// Number of the contact that a body has in a slot. A pending one without a force does not count.
fn contact_number(contacts: &Contacts, body: usize, slot: usize) -> Option<u64> {
    let contact = &contacts.slots[slot];
    let touches = contact.mode != Mode::Free && contact.body == body && contact.force != DVec3::ZERO;
    touches.then_some(contact.serial >> REVISIONS)
}

/// Energy of spring and indentation of a contact, J.
fn contact_energy(contacts: &Contacts, slot: usize, coupling: f64) -> f64 {
    let contact = &contacts.slots[slot];
    0.5 * contact.force.length_squared() / coupling + contact.energy
}
