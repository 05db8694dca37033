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

use super::MAX_CONTACTS;
use super::rotation::rotation_vector;

/// Part of the most energy that has been held which may be given out beyond what was put in, and to which it is taken back.
const TOLERANCE: f64 = 9e-4;
const TAKEN_BACK_TO: f64 = 0.9 * TOLERANCE;
/// A surplus below the first part of the most is taken back by no more than the second part of the approach in a tick, so that it is
/// not felt as a jump.
const SMALL: f64 = 0.05;
const GENTLY: f64 = 0.01;
/// Ticks over which a surplus is forgotten: a tool that goes round for minutes would add up rounding.
const FORGOTTEN: f64 = 1000.0;
/// The work of a tick is known to half the change of the force times the way, where that is this part of the tool's radius; over
/// longer ways it is not known.
const COARSE: f64 = 0.1;

/// A contact in a tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct Press {
    /// Its slot, and its number among all since the start.
    pub slot: usize,
    pub number: Option<u64>,
    /// Where its tool is, less what other laws move the body by, m, and how it is turned.
    pub from: DVec3,
    pub orientation: DQuat,
    /// How far any point of the tool has gone at most in the tick, m, and the tool's radius.
    pub way: f64,
    pub radius: f64,
    /// Force on the body, N.
    pub force: DVec3,
    /// Torque on the tool, N m.
    pub torque: DVec3,
    /// What it holds: indentation, springs, and its part of `f^T C f / 2`, J.
    pub stored: f64,
    /// What friction took out in the tick, J.
    pub dissipated: f64,
}

/// The account of a body.
#[derive(Clone, Debug, Default)]
pub struct Passivity {
    last: [Press; MAX_CONTACTS],
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

    /// What contacts hold with the answers that have been found. A contact that begins has put in what it holds.
    pub fn observe(&self, presses: impl Iterator<Item = Press>, scale: f64) -> Held {
        let (mut stored, mut put_in, mut known) = (0.0, 0.0, true);
        for now in presses {
            let coarse = now.way / (COARSE * now.radius);
            known &= coarse < 1.0;
            let before = &self.last[now.slot];
            stored += now.stored;
            put_in += if now.number == before.number {
                let turned = rotation_vector(before.orientation, now.orientation);
                0.5 * (before.force + now.force).dot(now.from - before.from)
                    - 0.5 * (before.torque + now.torque).dot(turned)
                    - now.dissipated
                    + 0.5 * (now.force - before.force).length() * now.way * coarse
            } else {
                now.stored
            };
        }
        // Another stiffness is not the tool's work.
        let made =
            if scale == self.scale || self.held.stored == 0.0 { stored - self.held.stored - put_in } else { 0.0 };
        let surplus = self.held.surplus * (1.0 - 1.0 / FORGOTTEN) + if known { made } else { made.min(0.0) };
        Held { stored, most: self.held.most.max(stored), surplus }
    }

    /// Books what has been observed.
    pub fn book(&mut self, held: Held, presses: impl Iterator<Item = Press>, scale: f64) {
        (self.held, self.scale) = (held, scale);
        self.last = Default::default();
        for press in presses {
            self.last[press.slot] = press;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A spring of 100 N/m along z that is pressed to a depth, m, and holds so many times its energy.
    fn spring(depth: f64, times: f64) -> Press {
        let (force, stored) = (DVec3::NEG_Z * 100.0 * depth, times * 50.0 * depth * depth);
        Press { number: Some(1), from: DVec3::NEG_Z * depth, way: 1e-5, radius: 1.0, force, stored, ..Press::default() }
    }

    /// What is kept of a spring that is pressed by 10 mm in `count` ticks, and holds `times` its energy from half the way on.
    fn kept(count: usize, times: f64) -> f64 {
        let mut account = Passivity::default();
        let mut least = 1.0f64;
        for tick in 1..=count {
            let part = tick as f64 / count as f64;
            let press = spring(0.01 * part, if part > 0.5 { times } else { 1.0 });
            let held = account.observe(std::iter::once(press), 1.0);
            least = least.min(held.part_to_keep().unwrap_or(1.0));
            account.book(held, std::iter::once(press), 1.0);
        }
        least
    }

    #[test]
    fn a_spring_holds_what_was_put_in() {
        assert_eq!(kept(1000, 1.0), 1.0);
    }

    #[test]
    fn a_surplus_is_taken_back_and_a_loss_is_not() {
        assert_eq!(kept(1000, 0.8), 1.0);
        // A tenth more at once, of which half a thousandth may stay.
        let part = kept(1000, 1.1);
        assert!((0.89..0.93).contains(&part), "{part}");
        let gently = kept(1000, 1.02);
        assert_eq!(gently, 1.0 - GENTLY);
    }

    #[test]
    fn another_stiffness_is_no_surplus() {
        let mut account = Passivity::default();
        let [soft, hard] = [1.0, 3.0].map(|times| Press { way: 0.01, ..spring(0.01, times) });
        let held = account.observe(std::iter::once(soft), 1.0);
        account.book(held, std::iter::once(soft), 1.0);
        assert_eq!(account.observe(std::iter::once(hard), 3.0).part_to_keep(), None);
        assert!(account.observe(std::iter::once(hard), 1.0).part_to_keep().is_some());
    }
}
