//! The body in motion under the same contacts: the compliance of one step in place of the static one, and a spring.
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
use super::contacts::Contacts;
use super::energy::Account;
use super::strike::{STRIKES_AT_ONCE, StrikeInProgress, gather};
use crate::contact::{Patch, SurfacePoint};
use crate::dynamics::{Energy, Lanes, LoadedPatch, ModalModel, PredictedState, Projection};

/// How a body moves.
#[derive(Clone, Debug)]
pub struct Motion {
    predicted: PredictedState,
    /// Mean displacement of each contact's patch at the end of the next step if no force acts there, m.
    free: [DVec3; MAX_CONTACTS],
    projections: Vec<Projection>,
    /// `C` and `R` between the patches, m/N.
    compliance: Box<[[DMat3; MAX_CONTACTS]; MAX_CONTACTS]>,
    residual: Box<[[DMat3; MAX_CONTACTS]; MAX_CONTACTS]>,
    /// The node that is watched.
    watched: Projection,
    /// Motion less what one contact does to the body at rest, and a modal force.
    remainder: [Vec<Lanes>; 2],
    /// Strikes, over or under way.
    strikes: [StrikeInProgress; STRIKES_AT_ONCE],
    account: Account,
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
            account: Account::default(),
            due: 0.0,
            time: 0.0,
        }
    }

    /// Brings the body to rest. A step is made due, for contacts begin and end only within steps.
    pub(super) fn rest(&mut self, modes: &ModalModel) {
        self.predicted.rest();
        self.free = Default::default();
        self.strikes.iter_mut().for_each(StrikeInProgress::end);
        self.account = Account::default();
        self.due = modes.dt;
    }

    /// Where the energy is.
    pub fn energy(&self) -> Energy {
        self.account.energy
    }

    /// Modal displacements now.
    pub(super) fn modal_displacements(&self) -> &[Lanes] {
        &self.predicted.q
    }

    /// Displacement of a surface node by the modes, less what the contacts do to it at rest, m: `q - p / k` at its rows.
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
        gather(&mut self.projections[slot], modes, contacts.patches[slot].patch());
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

    /// Takes up where the patch of a contact that slides is now.
    pub(super) fn follow_contact(&mut self, modes: &ModalModel, contacts: &Contacts, slot: usize) {
        gather(&mut self.projections[slot], modes, contacts.patches[slot].patch());
        self.free[slot] = self.projections[slot].read(modes, &self.predicted.free_q);
    }

    /// Takes the motion at the end of the step as it is under the forces of the last one, less what that in a slot does to the
    /// modes at rest. Of the free motion alone, a body at rest would have what its forces do within a step left out, and a
    /// press would settle at an inclination that depends on the scheme.
    pub(super) fn leave_out_static(&mut self, modes: &ModalModel, contacts: &Contacts, slot: usize) {
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

    /// Displacement of a surface node in what [`Motion::leave_out_static`] took, m.
    pub(super) fn remaining_displacement(&self, modes: &ModalModel, node: u32) -> DVec3 {
        let mut moved = [0.0; 3];
        modes.read(&self.remainder[0], 3 * node as usize.., &mut moved);
        moved.into()
    }

    /// Compliance of one step between the patches in two slots less that at rest, as far as the modes carry it, m/N.
    pub(super) fn change_in_a_step(&self, modes: &ModalModel, a: usize, b: usize) -> DMat3 {
        let (a, b) = (&self.projections[a], &self.projections[b]);
        a.step_compliance(modes, b) - a.static_compliance(modes, b)
    }

    /// Takes up what a contact gives beyond the modes, for the account of energy.
    pub(super) fn keep_residual(&mut self, modes: &ModalModel, slot: usize, regular: &DMat3) {
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

    /// How far the forces that other contacts already exert move a patch beyond its modes, m.
    pub(super) fn residual_displacement(&self, contacts: &Contacts, slot: usize) -> DVec3 {
        let others = contacts.on(contacts.slots[slot].body).filter(|&other| other != slot);
        others.map(|other| self.residual[slot][other] * contacts.slots[other].force).sum()
    }

    /// Whether another strike may begin before those under way are over.
    pub(super) fn has_room_for_strike(&self) -> bool {
        self.strikes.iter().any(StrikeInProgress::is_over)
    }

    /// Readies a strike from the next step on; nothing where there is no room for it.
    pub(super) fn begin_strike(&mut self, modes: &ModalModel, patch: &Patch, impulse: DVec3, duration: f64) {
        if let Some(strike) = self.strikes.iter_mut().find(|strike| strike.is_over()) {
            strike.begin(modes, &self.predicted.q, patch, impulse, duration);
        }
    }

    /// Force of a contact on the body at the end of the last step, N; none for one that begins.
    pub(super) fn last_force(&self, contacts: &Contacts, slot: usize) -> DVec3 {
        match self.account.changes(contacts, contacts.slots[slot].body, slot) {
            true => DVec3::ZERO,
            false => self.account.last_force(slot),
        }
    }

    /// Ends the step by the forces of contacts and strikes, predicts the next, and keeps account of the energy.
    pub(super) fn advance(&mut self, modes: &ModalModel, coupling: f64, contacts: &Contacts, body: usize) {
        self.strikes.iter_mut().for_each(StrikeInProgress::advance);
        let changed = std::array::from_fn(|slot| self.account.changes(contacts, body, slot));
        let before = self.patches(modes, &changed, |account, other| account.last_force(other));
        // Filled with any of them: what is not written below is not used.
        let mut loaded = [self.strikes[0].loaded(); MAX_CONTACTS + STRIKES_AT_ONCE];
        let mut slots = [0; MAX_CONTACTS];
        let mut count = 0;
        for slot in contacts.on(body) {
            loaded[count] = LoadedPatch::new(&self.projections[slot], contacts.slots[slot].force);
            slots[count] = slot;
            count += 1;
        }
        let slots = &slots[..count];
        let mut with_strikes = count;
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
        self.account.book_step(&step);
        self.account.book_contacts(contacts, slots, coupling, &self.residual);
        self.account.book_work((contacts, body), (coupling, weight), &self.residual, &moved);
        for strike in &mut self.strikes {
            self.account.energy.work += strike.work(modes, &self.predicted.q);
        }
    }

    /// Mean displacements of some patches, m, without what their own forces do beyond the modes.
    fn patches(
        &self,
        modes: &ModalModel,
        which: &[bool; MAX_CONTACTS],
        force: impl Fn(&Account, usize) -> DVec3,
    ) -> [DVec3; MAX_CONTACTS] {
        std::array::from_fn(|slot| {
            if !which[slot] {
                return DVec3::ZERO;
            }
            let others = (0..MAX_CONTACTS).filter(|&other| other != slot);
            let beyond: DVec3 = others.map(|other| self.residual[slot][other] * force(&self.account, other)).sum();
            self.projections[slot].read(modes, &self.predicted.q) + beyond
        })
    }
}
