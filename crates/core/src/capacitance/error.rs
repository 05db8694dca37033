//! Error estimate of a solution, from the errors of the entries of the operator ([`crate::green::accuracy`]).

use faer::linalg::solvers::DenseSolveCore;
use faer::{Mat, Side};

use crate::green::accuracy::{ROUNDING_MARGIN, largest, relative, rounding_noise, unknown_errors};
use crate::green::{GreensFunction, Precision};

/// What the columns of an answer add up to.
pub struct Noise<'a> {
    green: &'a GreensFunction,
    /// `sum (s_j v_j)^2` over columns of free dofs, and of supports, J.
    size_squared: [f64; 2],
    /// Of every row, `sum (Psi_ij v_j)^2`; empty where rounding does not follow the entries.
    squares: Vec<f64>,
    /// Error of the displacements that are given, in the energy norm, sqrt(J).
    of_given: f64,
    /// Of every row the error of its displacement, if it is given, m; empty for none.
    of_rows: Vec<f64>,
}

impl<'a> Noise<'a> {
    /// Of no column.
    pub fn new(green: &'a GreensFunction) -> Self {
        let follows = green.precision() != Precision::F16;
        let squares = if follows { vec![0.0; green.rows] } else { Vec::new() };
        Self { green, size_squared: [0.0; 2], squares, of_given: 0.0, of_rows: Vec::new() }
    }

    /// Adds what taking a rigid motion out has left: an error of supports in the energy norm, and one of every row, m.
    pub fn add_motion(&mut self, of_given: f64, of_row: impl Fn(usize) -> f64) {
        self.of_given = of_given;
        self.of_rows = (0..3 * self.green.surface_count()).map(of_row).collect();
    }

    /// Adds `value` times a column to `response`, and its noise.
    pub fn add_column(&mut self, column: usize, value: f64, response: &mut [f64]) {
        let row = self.green.row_of_column(column);
        self.size_squared[usize::from(self.green.row_is_fixed[row])] += (self.green.magnitude(row) * value).powi(2);
        if self.squares.is_empty() {
            return self.green.add_column(column, value, response);
        }
        let mut part = vec![0.0; self.green.rows];
        self.green.add_column(column, value, &mut part);
        for ((sum, square), part) in response.iter_mut().zip(&mut self.squares).zip(part) {
            *sum += part;
            *square += part * part;
        }
    }

    /// Noise of a row from rounding.
    fn of_row(&self, row: usize) -> f64 {
        let precision = self.green.precision();
        match self.squares.get(row) {
            Some(square) => ROUNDING_MARGIN * precision.unit_roundoff() * square.sqrt(),
            None => rounding_noise(precision, self.green.magnitude(row), self.size_squared.iter().sum::<f64>().sqrt()),
        }
    }

    /// Errors of the unknowns of switched `columns`, in their order, and of every row, as if it were none of them.
    ///
    /// `capacitance` is `Psi_SS`. Rows elsewhere follow the error `r` of what is prescribed by `Psi_iS C^-1 r`, at most
    /// `s_i sqrt(r^T C^-1 r)` by the inequality of Cauchy and Schwarz in the inner product of `Psi`. With released supports
    /// `C` is no such product, and columns are added up by magnitude: `|Psi_iS| |C^-1 r|`.
    pub fn errors(&self, columns: &[usize], capacitance: &Mat<f64>) -> (Vec<f64>, Vec<f64>) {
        let rows: Vec<usize> = columns.iter().map(|&column| self.green.row_of_column(column)).collect();
        let [free, supports] = self.size_squared.map(f64::sqrt);
        let accuracy = &self.green.accuracy;
        let residual = accuracy.residual(free) + accuracy.residual_of_supports(supports) + self.of_given;
        let magnitude: Vec<f64> = rows.iter().map(|&row| self.green.magnitude(row)).collect();
        let given =
            |row: usize| if self.green.row_is_fixed[row] { 0.0 } else { self.of_rows.get(row).copied().unwrap_or(0.0) };
        let noise: Vec<f64> =
            rows.iter().zip(&magnitude).map(|(&row, s)| (self.of_row(row) + given(row)) / s).collect();
        let n = rows.len();
        let scaled = Mat::from_fn(n, n, |i, j| capacitance[(i, j)] / (magnitude[i] * magnitude[j]));
        let released = rows.iter().any(|&row| self.green.row_is_fixed[row]);
        let inverse = match scaled.llt(Side::Lower) {
            Ok(factor) if !released => factor.inverse(),
            _ => scaled.partial_piv_lu().inverse(),
        };
        let mut elsewhere: Vec<f64> =
            (0..self.green.rows).map(|row| self.of_row(row) + self.green.magnitude(row) * residual).collect();
        let unscaled = |unknown: Vec<f64>| unknown.iter().zip(&magnitude).map(|(error, s)| error / s).collect();
        if !released {
            let squares = noise.iter().enumerate().map(|(k, noise)| inverse[(k, k)].abs() * noise * noise);
            let energy = squares.sum::<f64>().sqrt();
            elsewhere.iter_mut().enumerate().for_each(|(row, error)| *error += self.green.magnitude(row) * energy);
            return (unscaled(unknown_errors(inverse.as_ref(), &noise, residual)), elsewhere);
        }
        // Neither symmetric nor positive: errors of computing, too, are passed on by whole rows of the inverse.
        let noise: Vec<f64> = noise.iter().map(|noise| noise + residual).collect();
        let unknown: Vec<f64> = unscaled(unknown_errors(inverse.as_ref(), &noise, 0.0));
        let mut part = vec![0.0; self.green.rows];
        for (&column, error) in columns.iter().zip(&unknown) {
            part.fill(0.0);
            self.green.add_column(column, *error, &mut part);
            elsewhere.iter_mut().zip(&part).for_each(|(sum, part)| *sum += part.abs());
        }
        (unknown, elsewhere)
    }
}

/// Larger of the largest error of a force over the largest force, and of a displacement over the largest displacement.
///
/// All by row; `is_force` tells which rows' errors are those of forces. Forces below `least_force`, N, are compared with it.
pub fn relative_error(
    errors: &[f64],
    is_force: &[bool],
    displacements: &[f64],
    forces: &[f64],
    least_force: f64,
) -> f64 {
    let of = |kind: bool, values: &[f64], least: f64| {
        let error = largest(errors.iter().zip(is_force).filter(|&(_, &f)| f == kind).map(|(e, _)| *e));
        relative(error, largest(values.iter().copied().chain([least])))
    };
    of(true, forces, least_force).max(of(false, displacements, 0.0))
}

#[cfg(test)]
mod tests {
    use super::relative_error;

    #[test]
    fn an_error_that_is_no_number_is_not_passed_over() {
        let of = |errors: [f64; 2]| relative_error(&errors, &[true, false], &[0.0, 2.0], &[4.0, 0.0], 0.0);
        assert_eq!(of([0.4, 0.1]), 0.1);
        assert_eq!(of([0.0, 0.0]), 0.0);
        assert_eq!(of([f64::NAN, 0.1]), f64::INFINITY);
        assert_eq!(of([0.4, f64::NAN]), f64::INFINITY);
        // An answer that is none, whatever its error.
        assert_eq!(relative_error(&[0.4, 0.1], &[true, false], &[0.0, f64::NAN], &[4.0, 0.0], 0.0), f64::INFINITY);
    }
}
