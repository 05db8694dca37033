//! Acceleration of Newton's method where it converges linearly.
//!
//! With higher orders of the body's displacement, slope and offset of a contact are those of its latest guess, and some of their
//! derivatives are left out: each step leaves about the same part of the error, up to a half of it on a bent beam. From two steps
//! `r_0 = g_0 - z_0` and `r_1 = g_1 - z_1` of the iteration `z -> g(z)` the sum of all further ones follows (Aitken, 1926; Anderson,
//! 1965, with a single earlier step):
//!
//! ```text
//! z_2 = g_1 - gamma (g_1 - g_0)        gamma = (r_1 - r_0) . r_1 / |r_1 - r_0|^2
//! ```
//!
//! `z` holds position, force, friction and offset of every contact; forces count as lengths by the contact's stiffness.

use glam::DVec3;

use crate::simulation::MAX_CONTACTS;

/// Bounds of `gamma`: steps that shrink by less than a fifth, or swing by more than they are long, are extrapolated no farther.
const LEAST: f64 = -4.0;
const MOST: f64 = 0.5;

/// Position of a tool over the surface at rest, force, friction and offset of its contact.
pub type Iterate = [DVec3; 4];

/// The latest step of the iteration.
#[derive(Default)]
pub struct Acceleration {
    results: [Iterate; MAX_CONTACTS],
    steps: [Iterate; MAX_CONTACTS],
    /// Contacts of the latest step, zero where there is none.
    count: usize,
    /// `(r_1 - r_0) . r_1` and `|r_1 - r_0|^2`.
    products: [f64; 2],
}

impl Acceleration {
    /// Forgets the steps so far.
    pub fn reset(&mut self) {
        self.count = 0;
    }

    /// Begins a step of so many contacts; returns whether there is one before it.
    pub fn begin(&mut self, count: usize) -> bool {
        self.products = [0.0; 2];
        std::mem::replace(&mut self.count, count) == count
    }

    /// Takes the step of a contact from `before` to `result`, under the contact's compliance, m/N. Returns the result before it.
    pub fn take(&mut self, a: usize, before: &Iterate, result: &Iterate, compliance: f64) -> Iterate {
        let as_length = [1.0, compliance, compliance, 1.0];
        for k in 0..before.len() {
            let step = (result[k] - before[k]) * as_length[k];
            let change = step - self.steps[a][k];
            self.products[0] += change.dot(step);
            self.products[1] += change.length_squared();
            self.steps[a][k] = step;
        }
        std::mem::replace(&mut self.results[a], *result)
    }

    /// `gamma` of the steps that have been taken.
    pub fn share(&self) -> f64 {
        let [product, squared] = self.products;
        if squared > 0.0 { (product / squared).clamp(LEAST, MOST) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps until the error is below 1e-12, where each leaves a part of the error along one direction and little along the others.
    fn steps(part: f64, accelerated: bool) -> usize {
        let solution: Iterate = [DVec3::ONE, DVec3::X, DVec3::Y, DVec3::Z];
        let slow = [DVec3::X, DVec3::Z, DVec3::ZERO, DVec3::Y];
        let mut acceleration = Acceleration::default();
        let mut at: Iterate = [DVec3::ZERO; 4];
        for step in 0..60 {
            let error: Iterate = std::array::from_fn(|k| at[k] - solution[k]);
            if error.iter().all(|error| error.length() < 1e-12) {
                return step;
            }
            let along: f64 = error.iter().zip(&slow).map(|(error, slow)| error.dot(*slow)).sum::<f64>() / 3.0;
            let mut result: Iterate = std::array::from_fn(|k| solution[k] + slow[k] * (part * along) + error[k] * 1e-3);
            let has_previous = acceleration.begin(1);
            let previous = acceleration.take(0, &at, &result, 1.0);
            if has_previous && accelerated {
                let share = acceleration.share();
                result = std::array::from_fn(|k| result[k] - (result[k] - previous[k]) * share);
            }
            at = result;
        }
        60
    }

    #[test]
    fn a_slow_direction_is_left_in_a_few_steps() {
        for part in [0.5, -0.3, 0.75] {
            assert!(steps(part, true) <= 9, "{part}: {}", steps(part, true));
            assert!(steps(part, false) > 20, "{part}: {}", steps(part, false));
        }
    }

    #[test]
    fn steps_that_grow_are_extrapolated_within_bounds() {
        let mut acceleration = Acceleration::default();
        let at = |x: f64| [DVec3::X * x, DVec3::ZERO, DVec3::ZERO, DVec3::ZERO];
        assert!(!acceleration.begin(1));
        acceleration.take(0, &at(0.0), &at(1.0), 1.0);
        assert!(acceleration.begin(1));
        assert_eq!(acceleration.take(0, &at(1.0), &at(3.0), 1.0), at(1.0));
        assert_eq!(acceleration.share(), MOST);
        acceleration.reset();
        assert!(!acceleration.begin(1));
    }
}
