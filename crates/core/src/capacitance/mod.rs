//! Chapter 5: the capacitance matrix algorithm: any change of boundary conditions by one small dense solve.
//!
//! Dofs `S` whose condition changes type have new knowns `vb_S`. With all other knowns in `vb` (and zero on `S`),
//!
//! ```text
//! q = Psi_SS^-1 [ vb_S - (Psi vb)_S ],      v = Psi (vb + E q) elsewhere,      v_S = q
//! ```
//!
//! which is equations 3.8-3.10 of Jun, Choi and Cho with `C = -E^T Psi E`, written without the term that cancels on `S`.

use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

use crate::green::GreensFunction;
use crate::{Error, Result};

/// Displacements and forces after a change of boundary conditions.
pub struct Answer {
    /// Of the surface dofs, m (3s).
    pub displacements: Vec<f64>,
    /// `K u` at the surface dofs, N (3s): applied loads, contact forces, support reactions.
    pub forces: Vec<f64>,
    /// `K u` at the fixed dofs, N, in their order.
    pub reactions: Vec<f64>,
}

/// Solves the changed problem.
///
/// `known`: column and value of conditions that keep their type (a force on a free dof, N; the displacement of a support,
/// m). `switched`: column and value of those that change it (a prescribed displacement on a free dof, m; the force on a
/// released support, N). Columns are those of [`GreensFunction`].
///
/// # Errors
/// A capacitance matrix that is singular to working precision: too much was released, or the store's precision does not
/// carry that many neighbouring constraints.
pub fn solve(green: &GreensFunction, known: &[(usize, f64)], switched: &[(usize, f64)]) -> Result<Answer> {
    let mut response = vec![0.0; green.rows];
    for &(column, value) in known {
        green.add_column(column, value, &mut response);
    }
    let unknown = capacitance_solve(green, switched, &response)?;
    for (&(column, _), &q) in switched.iter().zip(&unknown) {
        green.add_column(column, q, &mut response);
    }

    // Sort knowns and unknowns into displacements and forces, row by row.
    let (mut displacements, mut forces) = (vec![0.0; green.rows], vec![0.0; green.rows]);
    for (row, &value) in response.iter().enumerate() {
        let unknown_side = if green.row_is_fixed[row] { &mut forces } else { &mut displacements };
        unknown_side[row] = value;
    }
    for &(column, value) in known {
        let row = green.row_of_column(column);
        let known_side = if green.row_is_fixed[row] { &mut displacements } else { &mut forces };
        known_side[row] += value;
    }
    for (&(column, value), &q) in switched.iter().zip(&unknown) {
        let row = green.row_of_column(column);
        let (u, f) = if green.row_is_fixed[row] { (q, value) } else { (value, q) };
        displacements[row] = u;
        forces[row] = f;
    }
    let reactions = green.fixed_rows.iter().map(|&row| forces[row as usize]).collect();
    let surface = 3 * green.surface_count();
    displacements.truncate(surface);
    forces.truncate(surface);
    Ok(Answer { displacements, forces, reactions })
}

/// `Psi_SS^-1 [ vb_S - response_S ]`. Symmetric positive definite if only free dofs are prescribed; with released
/// supports the coupling blocks are skew, and LU serves.
fn capacitance_solve(green: &GreensFunction, switched: &[(usize, f64)], response: &[f64]) -> Result<Vec<f64>> {
    if switched.is_empty() {
        return Ok(Vec::new());
    }
    let rows: Vec<usize> = switched.iter().map(|&(column, _)| green.row_of_column(column)).collect();
    let n = rows.len();
    let capacitance = Mat::from_fn(n, n, |i, j| green.entry(rows[i], switched[j].0));
    let residual = Mat::from_fn(n, 1, |i, _| switched[i].1 - response[rows[i]]);
    let symmetric = rows.iter().all(|&row| !green.row_is_fixed[row]);
    let unknown = match symmetric.then(|| capacitance.llt(Side::Lower)) {
        Some(Ok(factor)) => factor.solve(&residual),
        // A matrix that single precision has made slightly indefinite is still well solved by LU.
        _ => capacitance.partial_piv_lu().solve(&residual),
    };
    let unknown: Vec<f64> = (0..n).map(|i| unknown[(i, 0)]).collect();
    if unknown.iter().all(|q| q.is_finite()) {
        Ok(unknown)
    } else {
        Err(Error::Singular("the changed boundary conditions leave the body free to move".into()))
    }
}
