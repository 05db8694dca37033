//! Motion of a body under contacts: the compliance of one step instead of the static one, and a spring to each tool.
//!
//! A step moves a patch to `d_free + C f`, `d_free = G q` being the free motion at the step's end (`dynamics::modal`) and
//!
//! ```text
//! C = G diag(q_load) G^T + R,     R = W^T Psi W - G diag(1/k) G^T
//! ```
//!
//! `R` is the residual flexibility of the modes left out, which answer at once; with all modes it is zero. `C` is far
//! below the static compliance, so that a patch tied rigidly to a tool would alternate from tick to tick for ever: tool
//! and patch are coupled by a spring `k_c`, `(C + I/k_c) f = d - d_free`.

use glam::{DMat3, DVec3};

use super::MAX_CONTACTS;
use super::body::BodyModel;
use super::contacts::{Contacts, SlotList};
use super::energy::EnergyBalance;
use super::strike::{STRIKES_AT_ONCE, StrikeInProgress, gather_rows};
use crate::contact::{Patch, SurfacePoint};
use crate::dynamics::{Energy, Lanes, LoadedPatch, ModalModel, PredictedState, Projection};

/// Motion of a body.
#[derive(Clone, Debug)]
pub struct Motion {
    predicted: PredictedState,
    /// Mean displacement of each contact's patch at the end of the next step if no force acts there, m.
    free: [DVec3; MAX_CONTACTS],
    projections: Vec<Projection>,
    /// `C` and `R` between the patches, m/N.
    compliance: Box<[[DMat3; MAX_CONTACTS]; MAX_CONTACTS]>,
    residual: Box<[[DMat3; MAX_CONTACTS]; MAX_CONTACTS]>,
    /// Rows of the modes at a node whose displacement is requested.
    watched: Projection,
    /// Modal displacements without the static response to one contact, and a modal force.
    remainder: [Vec<Lanes>; 2],
    /// Strikes, over or in progress.
    strikes: [StrikeInProgress; STRIKES_AT_ONCE],
    balance: EnergyBalance,
    /// Body time not yet stepped through, s.
    pub(super) due: f64,
    /// Body time since the start, s.
    pub time: f64,
}

impl Motion {
    /// At rest.
    pub(super) fn new(modes: &ModalModel) -> Self {
        let blocks = || Box::new([[DMat3::ZERO; MAX_CONTACTS]; MAX_CONTACTS]);
        Self {
            predicted: modes.predicted_state(),
            free: Default::default(),
            projections: vec![Projection::new(modes); MAX_CONTACTS],
            compliance: blocks(),
            residual: blocks(),
            watched: Projection::new(modes),
            remainder: [modes.state().q, modes.state().q],
            strikes: std::array::from_fn(|_| StrikeInProgress::new(modes)),
            balance: EnergyBalance::default(),
            due: 0.0,
            time: 0.0,
        }
    }

    /// Brings the body to rest. One step becomes due, for contacts begin and end only within steps.
    pub(super) fn bring_to_rest(&mut self, modes: &ModalModel) {
        self.predicted.rest();
        self.free = Default::default();
        self.strikes.iter_mut().for_each(StrikeInProgress::end);
        self.balance = EnergyBalance::default();
        self.due = modes.dt;
    }

    /// Energies by kind.
    pub fn energy(&self) -> Energy {
        self.balance.energy
    }

    /// Modal displacements now.
    pub(super) fn modal_displacements(&self) -> &[Lanes] {
        &self.predicted.q
    }

    /// Displacement of a surface node by the modes beyond the static response to the contacts, m: `q - p / k` at its rows.
    pub(super) fn beyond_static(&mut self, modes: &ModalModel, contacts: &Contacts, body: usize, node: usize) -> DVec3 {
        self.watched.gather(modes, std::iter::once((3 * node, 1.0)));
        let mut moved = self.watched.read(modes, &self.predicted.q);
        for slot in contacts.on(body) {
            let compliance = self.watched.static_compliance(modes, &self.projections[slot]);
            moved -= compliance * contacts.slots[slot].force;
        }
        moved
    }

    /// Displacement of a surface point in the free motion, m; the residual flexibility of other contacts is left out.
    pub(super) fn displacement_at(&self, body: &BodyModel, modes: &ModalModel, at: &SurfacePoint) -> DVec3 {
        let triangle = body.loaded.triangles[at.triangle as usize];
        let mut sum = DVec3::ZERO;
        for (node, share) in triangle.into_iter().zip(at.barycentric) {
            sum += share * self.predicted_displacement(modes, node);
        }
        sum
    }

    /// Prepares the contact in `slot`: its compliance within a step with every other one, given the static ones.
    pub(super) fn add_contact(
        &mut self,
        modes: &ModalModel,
        contacts: &Contacts,
        whole: &[[DMat3; MAX_CONTACTS]; MAX_CONTACTS],
        slot: usize,
    ) {
        gather_rows(&mut self.projections[slot], modes, contacts.patches[slot].patch());
        self.free[slot] = self.projections[slot].read(modes, &self.predicted.free_q);
        for other in contacts.on(contacts.slots[slot].body) {
            let (a, b) = (&self.projections[slot], &self.projections[other]);
            let residual = whole[slot][other] - a.static_compliance(modes, b);
            let block = a.step_compliance(modes, b) + residual;
            let symmetric = if other == slot { 0.5 * (block + block.transpose()) } else { block };
            self.residual[slot][other] = residual;
            self.residual[other][slot] = residual.transpose();
            self.compliance[slot][other] = symmetric;
            self.compliance[other][slot] = symmetric.transpose();
        }
    }

    /// Displacement of a surface node at the end of the next step if no force acts, m.
    pub(super) fn predicted_displacement(&self, modes: &ModalModel, node: u32) -> DVec3 {
        let mut moved = [0.0; 3];
        modes.read(&self.predicted.free_q, 3 * node as usize.., &mut moved);
        moved.into()
    }

    /// Updates the projection of a sliding contact to its present patch.
    pub(super) fn follow_contact(&mut self, modes: &ModalModel, contacts: &Contacts, slot: usize) {
        gather_rows(&mut self.projections[slot], modes, contacts.patches[slot].patch());
        self.free[slot] = self.projections[slot].read(modes, &self.predicted.free_q);
    }

    /// Sets the remainder: the motion at the end of the step under the forces of the previous one, less the static response of the
    /// modes to the contact in a slot. The free motion alone would lack the response to the forces within a step, and a press would
    /// settle at an inclination that depends on the scheme.
    pub(super) fn subtract_static(&mut self, modes: &ModalModel, contacts: &Contacts, slot: usize) {
        let [remainder, load] = &mut self.remainder;
        remainder.copy_from_slice(&self.predicted.free_q);
        load.fill(Lanes::default());
        for other in contacts.on(contacts.slots[slot].body) {
            self.projections[other].add_force(modes, contacts.slots[other].force, load);
        }
        modes.add_step(load, remainder);
        load.fill(Lanes::default());
        self.projections[slot].add_force(modes, -contacts.slots[slot].force, load);
        modes.add_static(load, remainder);
    }

    /// Displacement of a surface node in the remainder of [`Motion::subtract_static`], m.
    pub(super) fn remaining_displacement(&self, modes: &ModalModel, node: u32) -> DVec3 {
        let mut moved = [0.0; 3];
        modes.read(&self.remainder[0], 3 * node as usize.., &mut moved);
        moved.into()
    }

    /// Compliance of one step less the static one, of the modes, between the patches in two slots, m/N.
    pub(super) fn step_compliance_change(&self, modes: &ModalModel, a: usize, b: usize) -> DMat3 {
        let (a, b) = (&self.projections[a], &self.projections[b]);
        a.step_compliance(modes, b) - a.static_compliance(modes, b)
    }

    /// Sets the compliance of a contact beyond the modes, for the energy balance.
    pub(super) fn set_residual_compliance(&mut self, modes: &ModalModel, slot: usize, regular: &DMat3) {
        let own = &self.projections[slot];
        self.residual[slot] = [DMat3::ZERO; MAX_CONTACTS];
        self.residual.iter_mut().for_each(|row| row[slot] = DMat3::ZERO);
        self.residual[slot][slot] = *regular - own.static_compliance(modes, own);
    }

    /// Compliance of one step between the patches in two slots, m/N.
    pub(super) fn compliance(&self, a: usize, b: usize) -> DMat3 {
        self.compliance[a][b]
    }

    /// Mean displacement of a contact's patch in the free motion, m.
    pub(super) fn free_displacement(&self, slot: usize) -> DVec3 {
        self.free[slot]
    }

    /// Displacement of a patch beyond its modes by the present forces of other contacts, m.
    pub(super) fn residual_displacement(&self, contacts: &Contacts, slot: usize) -> DVec3 {
        let others = contacts.on(contacts.slots[slot].body).filter(|&other| other != slot);
        others.map(|other| self.residual[slot][other] * contacts.slots[other].force).sum()
    }

    /// Whether another strike may begin before those in progress end.
    pub(super) fn has_room_for_strike(&self) -> bool {
        self.strikes.iter().any(StrikeInProgress::is_over)
    }

    /// Starts a strike at the next step, if there is room for it.
    pub(super) fn begin_strike(&mut self, modes: &ModalModel, patch: &Patch, impulse: DVec3, duration: f64) {
        if let Some(strike) = self.strikes.iter_mut().find(|strike| strike.is_over()) {
            strike.begin(modes, &self.predicted.q, patch, impulse, duration);
        }
    }

    /// Force of a contact on the body at the end of the last step, N; none for one that begins.
    pub(super) fn last_force(&self, contacts: &Contacts, slot: usize) -> DVec3 {
        match self.balance.begins_or_ends(contacts, contacts.slots[slot].body, slot) {
            true => DVec3::ZERO,
            false => self.balance.last_force(slot),
        }
    }

    /// Ends the step with the forces of contacts and strikes, predicts the next, and updates the energy balance.
    pub(super) fn advance(&mut self, modes: &ModalModel, coupling: f64, contacts: &Contacts, body: usize) {
        self.strikes.iter_mut().for_each(StrikeInProgress::advance);
        let changed = std::array::from_fn(|slot| self.balance.begins_or_ends(contacts, body, slot));
        let before = self.patches(modes, &changed, |balance, other| balance.last_force(other));
        // Initial values; only the entries written below are used.
        let mut loaded = [self.strikes[0].loaded(); MAX_CONTACTS + STRIKES_AT_ONCE];
        let slots = SlotList::of(contacts.on(body));
        for (patch, &slot) in loaded.iter_mut().zip(slots.iter()) {
            *patch = LoadedPatch::new(&self.projections[slot], contacts.slots[slot].force);
        }
        let mut with_strikes = slots.len();
        for strike in self.strikes.iter().filter(|strike| strike.force() != DVec3::ZERO) {
            loaded[with_strikes] = strike.loaded();
            with_strikes += 1;
        }
        let step = modes.advance(&mut self.predicted, &mut loaded[..with_strikes]);
        for (&slot, patch) in slots.iter().zip(&loaded) {
            self.free[slot] = patch.free;
        }
        let force = |slot: usize| if slots.contains(&slot) { contacts.slots[slot].force } else { DVec3::ZERO };
        let after = self.patches(modes, &changed, |_, other| force(other));
        let moved = std::array::from_fn(|slot| after[slot] - before[slot]);
        let weight = modes.integration.weight();
        self.balance.add_step(&step);
        self.balance.add_contacts(contacts, &slots, coupling, &self.residual);
        self.balance.add_work((contacts, body), (coupling, weight), &self.residual, &moved);
        for strike in &mut self.strikes {
            self.balance.energy.work += strike.work(modes, &self.predicted.q);
        }
    }

    /// Mean displacements of some patches, m, without the response to their own forces beyond the modes.
    fn patches(
        &self,
        modes: &ModalModel,
        which: &[bool; MAX_CONTACTS],
        force: impl Fn(&EnergyBalance, usize) -> DVec3,
    ) -> [DVec3; MAX_CONTACTS] {
        std::array::from_fn(|slot| {
            if !which[slot] {
                return DVec3::ZERO;
            }
            let others = (0..MAX_CONTACTS).filter(|&other| other != slot);
            let beyond: DVec3 = others.map(|other| self.residual[slot][other] * force(&self.balance, other)).sum();
            self.projections[slot].read(modes, &self.predicted.q) + beyond
        })
    }
}
