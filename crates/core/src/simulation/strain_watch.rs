//! Strain responses of the contacts of a body, as the limit of strain keeps them.

use glam::DVec3;

use super::contacts::{Contact, REVISIONS};
use crate::strain::{MAX_CONTACTS_WATCHED, StrainResponse};

/// Change a tick of what is eased out.
const EASING: f64 = 1.005;
/// How far two responses are followed beyond the later one and back to the earlier, over their distance, and most that they
/// may differ: the largest strain has bends where it goes from one place of the body to another.
const FOLLOWED: [f64; 2] = [-1.0, 2.0];
const MOST_CHANGE: f64 = 1.1;

/// Strain per newton on some contacts of a body.
#[derive(Clone, Debug)]
pub struct StrainWatch {
    /// The places that matter.
    pub response: StrainResponse,
    /// Serials of the contacts, in the order of the response; zero for none.
    pub serials: [u64; MAX_CONTACTS_WATCHED],
}

/// Share of the forces of contacts that slide which the limit of strain lets through, between responses.
///
/// A response belongs to the place at which it was asked for; when it comes the contact has gone on, and the strain of a
/// newton has changed. From two of them, `x_1` and `x_2` apart, the share at `x` is taken as
///
/// ```text
/// s(x) = s_2 (s_2 / s_1)^t,   t = (x - x_2) . (x_2 - x_1) / |x_2 - x_1|^2
/// ```
///
/// What is left of a jump where the next one comes is eased out, so that the force has none.
#[derive(Clone, Copy, Debug)]
pub struct LimitShare {
    /// Whose response it is.
    serials: [u64; MAX_CONTACTS_WATCHED],
    /// What the response said in the latest tick, and what was let through.
    said: f64,
    latest: f64,
    /// `s_2 / s_1`, `x_2` and `x_2 - x_1`, m.
    ratio: f64,
    place: DVec3,
    step: DVec3,
    /// What is eased out: over the share that follows from the responses.
    eased: f64,
}

impl Default for LimitShare {
    fn default() -> Self {
        let serials = [0; MAX_CONTACTS_WATCHED];
        Self { serials, said: 1.0, latest: 1.0, ratio: 1.0, place: DVec3::ZERO, step: DVec3::ZERO, eased: 1.0 }
    }
}

impl LimitShare {
    /// Goes on with what the response to `serials` says; `slid` is where it was asked for and where the contact is now, of a
    /// contact by itself.
    pub(super) fn follow(
        &mut self,
        serials: &[u64; MAX_CONTACTS_WATCHED],
        said: f64,
        slid: Option<(DVec3, DVec3)>,
    ) -> f64 {
        let new = self.serials != *serials;
        let same = self.serials.iter().zip(serials).all(|(&one, &other)| same_contact(one, other));
        if new {
            (self.ratio, self.step) = (1.0, DVec3::ZERO);
        }
        if let Some((place, _)) = slid.filter(|_| new) {
            // Below the limit both shares are one, and say nothing.
            let told = same && said < 1.0 && self.said < 1.0 && self.said > 0.0;
            if told {
                self.ratio = (said / self.said).clamp(1.0 / MOST_CHANGE, MOST_CHANGE);
                self.step = place - self.place;
            }
            self.place = place;
        }
        let squared = self.step.length_squared();
        let gone = slid.filter(|_| squared > 0.0).map_or(0.0, |(_, now)| (now - self.place).dot(self.step) / squared);
        let share = said * self.ratio.powf(gone.clamp(FOLLOWED[0], FOLLOWED[1]));
        if new {
            self.serials = *serials;
            self.eased = if same && share > 0.0 { self.latest / share } else { 1.0 };
        }
        self.said = said;
        self.latest = (share * self.eased).min(1.0);
        self.eased = if self.eased > 1.0 { (self.eased / EASING).max(1.0) } else { (self.eased * EASING).min(1.0) };
        self.latest
    }
}

/// Whether two serials are of the same contact, here or where it was before it slid on.
pub(super) fn same_contact(one: u64, other: u64) -> bool {
    one >> REVISIONS == other >> REVISIONS
}

impl StrainWatch {
    /// Whether a contact has been prepared for, here or where it was before it slid on.
    pub(super) fn covers(watch: Option<&Self>, contact: &Contact) -> bool {
        watch.is_some_and(|watch| watch.place_of(contact).is_some())
    }

    /// Place of a contact in the response.
    pub(super) fn place_of(&self, contact: &Contact) -> Option<usize> {
        self.serials.iter().position(|&known| known != 0 && same_contact(known, contact.serial))
    }
}
