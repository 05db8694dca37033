//! Passivity of contacts under the local law on a body at rest: they release no more energy than tools have put in.
//!
//! The stored energy changes by the work of the tools less the dissipation by friction, as long as forces are the gradient of one
//! energy. Where a contact moves to another side of an edge, the stored energy may rise by a surplus:
//!
//! ```text
//! surplus += E_new - E_old - W + dissipated         W = sum (f_old + f_new)/2 . dp - (T_old + T_new)/2 . dtheta
//! ```
//!
//! A surplus beyond a part of the largest stored energy is removed: contacts begin at a larger approach. The energy is convex in
//! the approach and zero without it, so that a part `s` of the approach stores no more than `s E`. This is a passivity observer and
//! controller (Hannaford and Ryu, 2002, 10.1109/70.988969) that acts on the geometry instead of the force.

use glam::{DQuat, DVec3};

use super::MAX_CONTACTS;
use crate::tensor::rotation_vector;

/// Tolerated surplus over the largest stored energy, and the surplus to which a larger one is reduced.
const TOLERANCE: f64 = 7e-4;
const TARGET: f64 = 0.9 * TOLERANCE;
/// A surplus below the first part of the largest energy reduces the approach by no more than the second part in a tick: a larger
/// reduction could be felt as a jump.
const SMALL_SURPLUS: f64 = 0.05;
const LARGEST_SMALL_STEP: f64 = 0.01;
/// Ticks over which a surplus decays: rounding would add up over minutes of motion on closed paths.
const DECAY_TICKS: f64 = 1000.0;
/// Longest motion in a tick, over the tool's radius, for which the work is known: to half the change of the force times the
/// motion.
const LONGEST_MOTION: f64 = 0.1;

/// A contact in a tick, as the observer reads it.
#[derive(Clone, Copy, Debug, Default)]
pub struct ObservedContact {
    /// Its slot, and its number among all since the start.
    pub slot: usize,
    pub number: u64,
    /// Position of its tool less the displacement of the body by other laws, m, and orientation of the tool.
    pub position: DVec3,
    pub orientation: DQuat,
    /// Largest displacement of any point of the tool in the tick, m, and the tool's radius.
    pub largest_motion: f64,
    pub radius: f64,
    /// Force on the body, N.
    pub force: DVec3,
    /// Torque on the tool, N m.
    pub torque: DVec3,
    /// Its stored energy: indentation, springs, and its part of `f^T C f / 2`, J.
    pub stored: f64,
    /// Energy that friction dissipated in the tick, J.
    pub dissipated: f64,
}

/// Energy observer of a body.
#[derive(Clone, Debug, Default)]
pub struct PassivityObserver {
    previous: ObservedContacts,
    energy: ContactEnergy,
    /// Observed in this tick.
    contacts: ObservedContacts,
    observed_energy: ContactEnergy,
    /// Young's modulus over the Green's function's.
    scale: f64,
}

/// The contacts of a tick in their slots. Two or three of many slots are usual: what others hold is neither cleared nor copied.
#[derive(Clone, Debug, Default)]
struct ObservedContacts {
    slots: [ObservedContact; MAX_CONTACTS],
    /// A bit for each slot that has been set.
    occupied: u32,
}

impl ObservedContacts {
    fn set(&mut self, contact: ObservedContact) {
        self.slots[contact.slot] = contact;
        self.occupied |= 1 << contact.slot;
    }

    /// The contact in the slot of another one, if both are the same.
    fn same_as(&self, contact: &ObservedContact) -> Option<&ObservedContact> {
        let known = &self.slots[contact.slot];
        (self.occupied & 1 << contact.slot != 0 && known.number == contact.number).then_some(known)
    }

    fn copy_from(&mut self, other: &Self) {
        self.occupied = other.occupied;
        let mut left = other.occupied;
        while left != 0 {
            let slot = left.trailing_zeros() as usize;
            self.slots[slot] = other.slots[slot];
            left &= left - 1;
        }
    }
}

/// Energies of the contacts of a body, J.
#[derive(Clone, Copy, Debug, Default)]
pub struct ContactEnergy {
    /// Stored now.
    stored: f64,
    /// The largest stored energy since the first contact began.
    most: f64,
    /// Stored energy beyond the work of the tools.
    surplus: f64,
}

impl ContactEnergy {
    /// Share of the approach that contacts may keep, if their energy has too large a surplus.
    pub fn share_to_keep(&self) -> Option<f64> {
        let excess = self.surplus - TARGET * self.most;
        let least = if excess < SMALL_SURPLUS * self.most { 1.0 - LARGEST_SMALL_STEP } else { 0.0 };
        (self.surplus > TOLERANCE * self.most).then(|| (1.0 - excess / self.stored).max(least))
    }
}

impl PassivityObserver {
    /// Resets the observer: there are no contacts.
    pub fn reset(&mut self) {
        if self.energy.most != 0.0 {
            *self = Self::default();
        }
    }

    /// Energy of the contacts under the forces of this tick. The stored energy of a new contact counts as work.
    pub fn observe(&mut self, contacts: impl Iterator<Item = ObservedContact>, scale: f64) -> ContactEnergy {
        let (mut stored, mut work, mut is_known) = (0.0, 0.0, true);
        self.contacts.occupied = 0;
        for now in contacts {
            self.contacts.set(now);
            let relative_motion = now.largest_motion / (LONGEST_MOTION * now.radius);
            is_known &= relative_motion < 1.0;
            stored += now.stored;
            work += if let Some(before) = self.previous.same_as(&now) {
                let rotation = rotation_vector(before.orientation, now.orientation);
                0.5 * (before.force + now.force).dot(now.position - before.position)
                    - 0.5 * (before.torque + now.torque).dot(rotation)
                    - now.dissipated
                    + 0.5 * (now.force - before.force).length() * now.largest_motion * relative_motion
            } else {
                now.stored
            };
        }
        // A change of the body's stiffness is no work of the tools.
        let gained =
            if scale == self.scale || self.energy.stored == 0.0 { stored - self.energy.stored - work } else { 0.0 };
        let surplus = self.energy.surplus * (1.0 - 1.0 / DECAY_TICKS) + if is_known { gained } else { gained.min(0.0) };
        self.observed_energy = ContactEnergy { stored, most: self.energy.most.max(stored), surplus };
        self.observed_energy
    }

    /// Makes the latest observation the previous one of the next tick.
    pub fn commit(&mut self, scale: f64) {
        self.previous.copy_from(&self.contacts);
        (self.energy, self.scale) = (self.observed_energy, scale);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A spring of 100 N/m along z that is pressed to a depth, m, and stores so many times its energy.
    fn spring(depth: f64, times: f64) -> ObservedContact {
        let (force, stored) = (DVec3::NEG_Z * 100.0 * depth, times * 50.0 * depth * depth);
        ObservedContact {
            number: 1,
            position: DVec3::NEG_Z * depth,
            largest_motion: 1e-5,
            radius: 1.0,
            force,
            stored,
            ..ObservedContact::default()
        }
    }

    /// Least share that is kept of a spring pressed by 10 mm in `count` ticks, which stores `times` its energy in the second half.
    fn least_share(count: usize, times: f64) -> f64 {
        let mut account = PassivityObserver::default();
        let mut least = 1.0f64;
        for tick in 1..=count {
            let part = tick as f64 / count as f64;
            let contact = spring(0.01 * part, if part > 0.5 { times } else { 1.0 });
            let energy = account.observe(std::iter::once(contact), 1.0);
            least = least.min(energy.share_to_keep().unwrap_or(1.0));
            account.commit(1.0);
        }
        least
    }

    #[test]
    fn a_spring_holds_what_was_put_in() {
        assert_eq!(least_share(1000, 1.0), 1.0);
    }

    #[test]
    fn a_surplus_is_taken_back_and_a_loss_is_not() {
        assert_eq!(least_share(1000, 0.8), 1.0);
        // A tenth more at once, of which half a thousandth may stay.
        let part = least_share(1000, 1.1);
        assert!((0.89..0.93).contains(&part), "{part}");
        let reduced = least_share(1000, 1.02);
        assert_eq!(reduced, 1.0 - LARGEST_SMALL_STEP);
    }

    #[test]
    fn another_stiffness_is_no_surplus() {
        let mut account = PassivityObserver::default();
        let [soft, hard] = [1.0, 3.0].map(|times| ObservedContact { largest_motion: 0.01, ..spring(0.01, times) });
        account.observe(std::iter::once(soft), 1.0);
        account.commit(1.0);
        assert_eq!(account.observe(std::iter::once(hard), 3.0).share_to_keep(), None);
        assert!(account.observe(std::iter::once(hard), 1.0).share_to_keep().is_some());
    }
}
