//! Strain responses of the contacts of a body, for the strain limit.

use glam::DVec3;

use super::contacts::{Contact, REVISIONS};
use crate::math::pow;
use crate::strain::{MAX_CONTACTS_WATCHED, StrainResponse};

/// Factor by which a jump decays in a tick.
const EASING: f64 = 1.005;
/// Range of the extrapolation from two responses, over their distance (0 is the later one, -1 the earlier), and largest ratio of
/// both: the largest strain has kinks where it moves from one place of the body to another.
const EXTRAPOLATION: [f64; 2] = [-1.0, 2.0];
const MOST_CHANGE: f64 = 1.1;

/// Strain per newton on some contacts of a body.
#[derive(Clone, Debug)]
pub struct StrainWatch {
    /// Strain at the places that decide the largest.
    pub response: StrainResponse,
    /// Serials of the contacts, in the order of the response; zero for none.
    pub serials: [u64; MAX_CONTACTS_WATCHED],
}

/// Share of the forces of sliding contacts within the strain limit, between responses.
///
/// A response belongs to the contact point of its request. When it arrives the contact has slid on, and the strain per newton has
/// changed. From two of them, `x_1` and `x_2` apart, the share at `x` is taken as
///
/// ```text
/// s(x) = s_2 (s_2 / s_1)^t,   t = (x - x_2) . (x_2 - x_1) / |x_2 - x_1|^2
/// ```
///
/// The remaining jump when the next response arrives decays over some ticks, so that the force has none.
#[derive(Clone, Copy, Debug)]
pub struct LimitShare {
    /// Serials of the contacts of the response.
    serials: [u64; MAX_CONTACTS_WATCHED],
    /// Share by the response in the previous tick, and the share that was used.
    allowed: f64,
    previous_share: f64,
    /// `s_2 / s_1`, `x_2` and `x_2 - x_1`, m.
    ratio: f64,
    place: DVec3,
    step: DVec3,
    /// Decaying factor over the share that follows from the responses.
    easing: f64,
}

impl Default for LimitShare {
    fn default() -> Self {
        let serials = [0; MAX_CONTACTS_WATCHED];
        Self {
            serials,
            allowed: 1.0,
            previous_share: 1.0,
            ratio: 1.0,
            place: DVec3::ZERO,
            step: DVec3::ZERO,
            easing: 1.0,
        }
    }
}

impl LimitShare {
    /// The share to use in this tick, from the share `allowed` by the response to `serials`. `path`, for a single contact, is the
    /// contact point of the request and the present one.
    pub(super) fn update(
        &mut self,
        serials: &[u64; MAX_CONTACTS_WATCHED],
        allowed: f64,
        path: Option<(DVec3, DVec3)>,
    ) -> f64 {
        let new = self.serials != *serials;
        let same = self.serials.iter().zip(serials).all(|(&one, &other)| same_contact(one, other));
        if new {
            (self.ratio, self.step) = (1.0, DVec3::ZERO);
        }
        if let Some((place, _)) = path.filter(|_| new) {
            // Within the limit both shares are one: no ratio follows from them.
            let comparable = same && allowed < 1.0 && self.allowed < 1.0 && self.allowed > 0.0;
            if comparable {
                self.ratio = (allowed / self.allowed).clamp(1.0 / MOST_CHANGE, MOST_CHANGE);
                self.step = place - self.place;
            }
            self.place = place;
        }
        let squared = self.step.length_squared();
        let extrapolation =
            path.filter(|_| squared > 0.0).map_or(0.0, |(_, now)| (now - self.place).dot(self.step) / squared);
        let share = allowed * pow(self.ratio, extrapolation.clamp(EXTRAPOLATION[0], EXTRAPOLATION[1]));
        if new {
            self.serials = *serials;
            self.easing = if same && share > 0.0 { self.previous_share / share } else { 1.0 };
        }
        self.allowed = allowed;
        self.previous_share = (share * self.easing).min(1.0);
        self.easing = if self.easing > 1.0 { (self.easing / EASING).max(1.0) } else { (self.easing * EASING).min(1.0) };
        self.previous_share
    }
}

/// Whether two serials are of the same contact, whatever their requests.
pub(super) fn same_contact(one: u64, other: u64) -> bool {
    one >> REVISIONS == other >> REVISIONS
}

impl StrainWatch {
    /// Whether there is a response of a contact, at its present point or an earlier one.
    pub(super) fn covers(watch: Option<&Self>, contact: &Contact) -> bool {
        watch.is_some_and(|watch| watch.rank_of(contact).is_some())
    }

    /// Rank of a contact in the response.
    pub(super) fn rank_of(&self, contact: &Contact) -> Option<usize> {
        self.serials.iter().position(|&known| known != 0 && same_contact(known, contact.serial))
    }
}
