//! Secant corrections of Newton's method where its steps go to and fro.
//!
//! The Jacobian has no derivative of the slope `f^T (dC_reg/dp') f / 2` by the position. Under a deep tool, whose displacement `u` is
//! as long as that over which `C_reg` changes along the surface, it counts: a whole step along the surface goes `1 + u^2 C''/(2 C)`
//! times as far as it should, and beyond 2 the steps grow. What is missing follows from the residuals before and after a step
//! (Broyden, Math. Comp. 19, 1965, 577-593). With a share `w` of the step that would remove the residual `r_0`,
//!
//! ```text
//! B <- B + (r_1 - (1 - w) r_0) s^T / |s|^2        s the step that was taken
//! ```
//!
//! for each contact by itself: the slope is that of its own place. `B` begins as the identity, with which the first corrected step is
//! about half of a whole one.

use glam::{DMat3, DVec3};

use crate::simulation::MAX_CONTACTS;
use crate::tensor::outer;

/// First step that is compared with the one before: the first ones correct the extrapolation.
const FIRST: usize = 3;
/// A step that goes back by more than this part of the one before goes to and fro.
const TURNED_BACK: f64 = 0.3;

/// What the steps of one solution have shown. Of its memory only what belongs to contacts is set anew.
#[derive(Default)]
pub struct Secant {
    /// Whether steps have gone to and fro.
    pub is_on: bool,
    /// Residuals before the last steps, m, the steps, m, and their share of whole ones.
    residuals: [DVec3; MAX_CONTACTS],
    steps: [DVec3; MAX_CONTACTS],
    share: f64,
    /// `B`, once it is on.
    corrections: [DMat3; MAX_CONTACTS],
}

impl Secant {
    /// Begins a solution for so many contacts.
    pub fn begin(&mut self, contacts: usize) {
        (self.is_on, self.share) = (false, 0.0);
        self.residuals[..contacts].fill(DVec3::ZERO);
        self.steps[..contacts].fill(DVec3::ZERO);
    }

    /// What the matrix of a contact lacks, by its residual after the last step, m; `None` where no step has gone to and fro.
    pub fn correction(&mut self, contact: usize, residual: DVec3) -> Option<DMat3> {
        let (step, expected) = (self.steps[contact], self.residuals[contact] * (1.0 - self.share));
        if self.is_on && step != DVec3::ZERO {
            self.corrections[contact] += outer(residual - expected, step) * (1.0 / step.length_squared());
        }
        self.residuals[contact] = residual;
        self.is_on.then_some(self.corrections[contact])
    }

    /// Compares whole steps with those taken before.
    pub fn compare(&mut self, step: usize, whole: &[DVec3]) {
        if self.is_on {
            return;
        }
        let products = whole.iter().zip(&self.steps).map(|(now, before)| (now.dot(*before), before.length_squared()));
        let (along, squared) = products.fold((0.0, 0.0), |sum, (a, b)| (sum.0 + a, sum.1 + b));
        self.is_on = step >= FIRST && along < -TURNED_BACK * squared;
        if self.is_on {
            self.corrections[..whole.len()].fill(DMat3::IDENTITY);
        }
    }

    /// Takes note of steps, a share of the whole ones.
    pub fn take(&mut self, steps: &[DVec3], share: f64) {
        self.steps[..steps.len()].copy_from_slice(steps);
        self.share = share;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A residual for which the method takes the identity as its matrix.
    fn residual(at: DVec3) -> DVec3 {
        let curved = 3.2 * at.x + 40.0 * at.x * at.x;
        DVec3::new(curved + 0.2 * at.y, 0.2 * at.x + at.y, 1.5 * at.z)
    }

    /// Steps until the residual is below 1e-12.
    fn steps_from(mut at: DVec3, with_corrections: bool) -> Option<usize> {
        let mut secant = Secant::default();
        for step in 0..40 {
            let now = residual(at);
            if now.length() < 1e-12 {
                return Some(step);
            }
            let correction = secant.correction(0, now).filter(|_| with_corrections).unwrap_or(DMat3::ZERO);
            let whole = (DMat3::IDENTITY + correction).inverse() * -now;
            secant.compare(step, &[whole]);
            let share = (0.02 / whole.length()).min(1.0);
            secant.take(&[whole * share], share);
            at += whole * share;
        }
        None
    }

    #[test]
    fn steps_that_grow_converge_with_corrections_only() {
        let from = DVec3::new(1e-4, 2e-4, -1e-4);
        assert_eq!(steps_from(from, false), None);
        assert!(steps_from(from, true).is_some_and(|steps| steps < 20), "{:?}", steps_from(from, true));
    }

    #[test]
    fn nothing_is_corrected_before_steps_go_to_and_fro() {
        let mut secant = Secant::default();
        for (step, length) in [1e-3, 1e-4, 1e-6, 1e-9].into_iter().enumerate() {
            assert!(secant.correction(0, DVec3::X * length).is_none());
            secant.compare(step, &[DVec3::X * -length]);
            secant.take(&[DVec3::X * -length], 1.0);
        }
        assert!(secant.correction(0, DVec3::ZERO).is_none());
    }
}
