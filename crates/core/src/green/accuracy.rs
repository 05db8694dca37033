//! Errors of the stored entries, and the errors of contact forces that follow from them.
//!
//! Write `s_i^2` for the compliance `Psi_ii` of a free dof and the stiffness `K_ii` of a supported one; then
//! `|Psi_ij| <= s_i s_j` (see `precompute::scales`), and `s_i` is stored for every row. An entry has two errors, which
//! reach an answer in different ways.
//!
//! Rounding into the store changes entries independently of each other. Forces `q` on columns then displace a row by a
//! noise of standard deviation at most `rounding s_i |S q|`, `S = diag(s)` (in `f32` and `f64` that of the entries themselves
//! is taken), and a solve with the capacitance matrix `C`
//! passes it on by the rows of its inverse: `sqrt(sum_k (C^-1)_ik^2 noise_k^2)`. That is the condition of `C` times the
//! rounding of the store, but for this answer alone.
//!
//! Computing gives the columns of slightly other bodies: `K (Psi_j + e_j) = f_j - w_j`, `e_j = -K^-1 w_j`. With
//! `w = sum_j q_j w_j` an answer is wrong by what `w` does to the body under the answer's own constraints. A constraint
//! only takes compliance away, so that in the energy norm `|w|^2 = w^T K^-1 w`
//!
//! ```text
//! |error of a displacement i| <= s_i |w|          |error of a constraint force k| <= sqrt((C^-1)_kk) |w|
//! ```
//!
//! and the condition of `C` enters by its root only: the reason why a double precision store is right in bodies whose
//! capacitance matrices have condition numbers of 1e10. `computed` is the largest `|w_j| / s_j` that was measured on free
//! dofs, so `|w|` is about `computed |S q|`.
//!
//! Columns of supports may be far worse: a support that holds a stiff part turns it as a whole, and the reaction is a small
//! difference of large forces. Random signs `z_j / s_j` on all of them give `|w|^2` whose mean is the sum of all
//! `|w_j|^2 / s_j^2`, and that of any displacements is at most its root times `|S q|`: that root is `supports`.
//!
//! Both are estimates, raised by a factor so that they bound what was measured over random bodies (docs/accuracy.md).

use glam::{DMat3, DVec3};

use super::precision::Precision;
use crate::{Error, Result};

/// Answers that may be wrong by more than this are refused, and stores whose touches may be.
pub const REFUSED_ERROR: f64 = 0.1;

/// Refuses what may be wrong by more than [`REFUSED_ERROR`].
///
/// # Errors
/// [`Error::Precision`], with what it may be wrong by.
pub fn require_right(what: &str, error: f64) -> Result<()> {
    // Not a number is refused, too.
    if error <= REFUSED_ERROR {
        return Ok(());
    }
    let (wrong, most) = (100.0 * error, 100.0 * REFUSED_ERROR);
    Err(Error::Precision(format!(
        "{what} may be wrong by {wrong:.2} %, more than the {most} % allowed: compute the store with more digits \
         (--precision), or prescribe fewer neighbouring nodes"
    )))
}

/// Standard deviations of the noise of rounding that are stated. Rounding is even within half a unit, whose largest
/// value stands for the deviation: five true ones.
pub const ROUNDING_MARGIN: f64 = 3.0;
/// What the measured error of computing is multiplied by: it was seen on some columns, and sums may add up.
pub const COMPUTED_MARGIN: f64 = 3.0;

/// Errors of the entries of a store, and of two typical answers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Accuracy {
    /// Largest error of computing an entry, over `s_i s_j`, as measured.
    pub computed: f64,
    /// Error of the columns of all touchable supports: of moving them by `1 / s_j` each, in the energy norm, as measured.
    pub supports: f64,
    /// Error of the free response in the energy norm, as measured, sqrt(J).
    pub loads: f64,
    /// Estimated relative error of the force on a node or a patch that is pressed, the largest of those probed.
    pub touch: f64,
    /// The same of nodal forces under a stamp: neighbouring nodes all prescribed.
    pub stamp: f64,
}

impl Accuracy {
    /// As a store keeps it.
    pub fn to_array(self) -> [f64; 5] {
        [self.computed, self.supports, self.loads, self.touch, self.stamp]
    }

    /// From [`Accuracy::to_array`]; `None` for another number of numbers.
    pub fn from_slice(numbers: &[f64]) -> Option<Self> {
        let &[computed, supports, loads, touch, stamp] = numbers else { return None };
        Some(Self { computed, supports, loads, touch, stamp })
    }

    /// `|w|` of columns of free dofs with `|S q|` of this `size`, sqrt(J), loads included.
    pub fn residual(self, size: f64) -> f64 {
        COMPUTED_MARGIN * (self.computed * size + self.loads)
    }

    /// `|w|` of columns of supports with `|S q|` of this `size`, sqrt(J).
    pub fn residual_of_supports(self, size: f64) -> f64 {
        COMPUTED_MARGIN * self.supports * size
    }
}

/// Noise of a row of magnitude `s_i`, all of whose entries are rounded to a fraction of `s_i s_j`, under columns of `size`.
pub fn rounding_noise(precision: Precision, magnitude: f64, size: f64) -> f64 {
    ROUNDING_MARGIN * precision.unit_roundoff() * magnitude * size
}

/// Errors of `C^-1 r` for rows with independent `noise`, and a residual `|w|` of computing; all scaled so that the diagonal
/// of `C` is one.
#[cfg(feature = "offline")]
pub fn unknown_errors(inverse: faer::MatRef<'_, f64>, noise: &[f64], residual: f64) -> Vec<f64> {
    let of = |i: usize| {
        let squares: f64 = noise.iter().enumerate().map(|(k, noise)| (inverse[(i, k)] * noise).powi(2)).sum();
        squares.sqrt() + inverse[(i, i)].abs().sqrt() * residual
    };
    (0..noise.len()).map(of).collect()
}

/// Largest magnitude; not a number if one of the values is none, where `f64::max` would pass over it.
pub fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |most: f64, value| if most.is_nan() || value.abs() <= most { most } else { value.abs() })
}

/// An error relative to a value: zero only of an error that is zero, infinite of one that is no number.
pub fn relative(error: f64, value: f64) -> f64 {
    let ratio = if error == 0.0 { 0.0 } else { error / value };
    if ratio.is_nan() { f64::INFINITY } else { ratio }
}

/// What is known of a pressed patch, by axis.
#[derive(Clone, Copy, Debug)]
pub struct Pressed {
    /// `W^T Psi W` over the prescribed axes and the identity elsewhere, inverted, N/m.
    pub stiffness: DMat3,
    /// Which axes are prescribed.
    pub prescribed: [bool; 3],
    /// `sqrt(sum_i w_i^2 s_i^2)`: magnitude of the mean of independent noise.
    pub independent: DVec3,
    /// `sum_i |w_i| s_i`: that of a mean that sees all nodes alike.
    pub coherent: DVec3,
    /// Force, N.
    pub force: DVec3,
}

/// Errors of a touch.
#[derive(Clone, Copy, Debug)]
pub struct PressedError {
    /// Of the force, N.
    pub force: f64,
    /// Of the displacement of any row, over its magnitude, sqrt(J).
    pub elsewhere: f64,
}

impl Pressed {
    /// Error of the force and of all displacements.
    pub fn error(&self, accuracy: Accuracy, precision: Precision) -> PressedError {
        let size = (self.independent * self.force).length();
        let residual = accuracy.residual((self.coherent * self.force).length());
        let noise = self.independent.map(|magnitude| rounding_noise(precision, magnitude, size));
        let (mut force, mut energy) = (DVec3::ZERO, 0.0);
        for a in (0..3).filter(|&a| self.prescribed[a]) {
            let own = self.stiffness.col(a)[a].abs();
            let mut squares = 0.0;
            for b in (0..3).filter(|&b| self.prescribed[b]) {
                squares += (self.stiffness.col(b)[a] * noise[b]).powi(2);
            }
            force[a] = squares.sqrt() + own.sqrt() * residual;
            energy += own * noise[a].powi(2);
        }
        let elsewhere = rounding_noise(precision, 1.0, size) + energy.sqrt() + residual;
        PressedError { force: force.length(), elsewhere }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_of_a_point_contact_is_amplified_by_its_condition() {
        // Two axes that almost move together: C = [[1, r], [r, 1]] with eigenvalues 1 + r and 1 - r.
        let r = 1.0 - 1e-4;
        let compliance = DMat3::from_cols(DVec3::new(1.0, r, 0.0), DVec3::new(r, 1.0, 0.0), DVec3::Z);
        let pressed = Pressed {
            stiffness: compliance.inverse(),
            prescribed: [true; 3],
            independent: DVec3::ONE,
            coherent: DVec3::ONE,
            force: DVec3::new(1.0, -1.0, 0.0),
        };
        let error = pressed.error(Accuracy::default(), Precision::F16);
        // Rows of the inverse are 1 / (2 (1 - r)) long along both axes; the force has length sqrt(2).
        let row = ROUNDING_MARGIN * 2.0_f64.powi(-16) * 2.0_f64.sqrt() * (0.5 / 1e-4) * 2.0_f64.sqrt();
        assert!((error.force / (2.0_f64.sqrt() * row) - 1.0).abs() < 1e-3, "{} {row}", error.force);
    }
}
