//! Account of the energy of a body in motion: what it holds, what tools put in, what damping took out.

use glam::{DMat3, DVec3};

use super::MAX_CONTACTS;
use super::contacts::Contacts;
use crate::dynamics::{Energy, StepEnergy};

/// Energies so far, and what the next booking starts from.
#[derive(Clone, Debug, Default)]
pub struct Account {
    /// Where the energy is.
    pub energy: Energy,
    /// Force on the body and displacement of the tool at the end of the last step, where there is a contact.
    last: [Option<(DVec3, DVec3)>; MAX_CONTACTS],
}

impl Account {
    /// A contact begins in a slot: what the one before it did there does not count for it.
    pub fn forget(&mut self, slot: usize) {
        self.last[slot] = None;
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
            self.energy.coupling += 0.5 * force.length_squared() / coupling + contacts.slots[a].local.energy;
            self.energy.dissipated += contacts.slots[a].local.dissipated;
            let beyond: DVec3 = slots.iter().map(|&b| residual[a][b] * contacts.slots[b].force).sum();
            self.energy.strain += 0.5 * force.dot(beyond);
        }
    }

    /// Books the work of the tools: forces change linearly within a step, so it is their mean times the tool's displacement.
    pub fn book_work(&mut self, contacts: &Contacts, body: usize) {
        let mut now = [None; MAX_CONTACTS];
        for slot in contacts.on(body) {
            let contact = &contacts.slots[slot];
            now[slot] = Some((contact.force, contact.displacement));
            if let Some((force, displacement)) = self.last[slot] {
                self.energy.work += 0.5 * (force + contact.force).dot(contact.displacement - displacement);
            }
        }
        self.last = now;
    }
}
