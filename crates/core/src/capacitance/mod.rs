//! Chapter 6 of docs/theory.md: the capacitance matrix, any change of boundary conditions by one small dense solve.
//!
//! Dofs `S` whose condition changes type have new knowns `vb_S`. With all other knowns in `vb` (and zero on `S`),
//!
//! ```text
//! q = Psi_SS^-1 [ vb_S - (Psi vb)_S ],      v = Psi (vb + E q) elsewhere,      v_S = q
//! ```
//!
//! Reference loads `F` add their free response: `Psi vb` above becomes `v_free + Psi vb`, a prescribed dof carries `F + q`,
//! and a released one is pushed by its own share of `F`. Without loads this
//! is equations 3.8-3.10 of Jun, Choi and Cho with `C = -E^T Psi E`, written without the term that cancels on `S`.

mod change;
mod error;
mod rigid;

pub use change::{Change, SplitConditions};
use error::{Noise, relative_error};
use faer::linalg::solvers::{DenseSolveCore, Solve};
use faer::{Mat, Side};
use rigid::{Conditions, INPUT_ROUNDING};

use crate::green::GreensFunction;
use crate::{Error, Result};

/// Relative error of an entry of `Psi` from its computation, however it is stored: the round-off of a sparse Cholesky solve
/// at the condition numbers of usual bodies. Larger, and weakly held bodies are refused; smaller, and floating ones pass.
const COMPUTED_ERROR: f64 = 1e-11;

/// Supports that move as one take no force, and what is computed is the rounding of their displacements: forces below so
/// many times what it may come to are compared with this.
const FORCE_ROUNDING_FACTOR: f64 = 2e3;

/// Displacements and forces after a change of boundary conditions.
pub struct Answer {
    /// Of the surface dofs, m (3s).
    pub displacements: Vec<f64>,
    /// `K u` at the surface dofs, N (3s): applied loads, contact forces, support reactions.
    pub forces: Vec<f64>,
    /// `K u` at the fixed dofs, N, in their order.
    pub reactions: Vec<f64>,
    /// Estimated error: of the forces relative to the largest force, or of the displacements relative to the largest
    /// displacement, whichever is larger.
    pub error: f64,
}

/// Solves the changed problem.
///
/// `known`: column and value of conditions that keep their type (a force on a free dof, N; the displacement of a support,
/// m). `switched`: column and value of those that change it (a prescribed displacement on a free dof, m; the force on a
/// released support, N). Columns are those of [`GreensFunction`].
///
/// # Errors
/// A capacitance matrix that is singular to working precision: [`Error::Singular`], too much was released, or
/// [`Error::Precision`], the store does not carry that many neighbouring constraints.
pub fn solve(green: &GreensFunction, known: &[(usize, f64)], switched: &[(usize, f64)]) -> Result<Answer> {
    green.require_intact()?;
    // Less a rigid motion `r` of the supports, which changes no force.
    let relative = Conditions::new(green, known, switched);
    let mut response = if green.loads.is_empty() { vec![0.0; green.rows] } else { green.free_response.clone() };
    let mut noise = Noise::new(green);
    for &(column, value) in &relative.known {
        noise.add_column(column, value, &mut response);
    }
    let rows: Vec<usize> = switched.iter().map(|&(column, _)| green.row_of_column(column)).collect();
    let capacitance = switched_square(green, &rows);
    let unknown = capacitance_solve(green, &relative.switched, &capacitance, &response)?;
    for (&(column, _), &q) in switched.iter().zip(&unknown) {
        noise.add_column(column, q, &mut response);
    }
    let rigid = |row: usize| relative.motion.as_ref().map_or(0.0, |motion| motion.at(green, row));
    let (mut displacements, mut forces) = sorted(green, &response, &rigid);
    for &(column, value) in known {
        let row = green.row_of_column(column);
        let known_side = if green.row_is_fixed[row] { &mut displacements } else { &mut forces };
        known_side[row] += value;
    }
    for ((&(_, value), &row), &q) in switched.iter().zip(&rows).zip(&unknown) {
        let load = green.load_on_row(row);
        let (u, f) = if green.row_is_fixed[row] { (q + rigid(row), value + load) } else { (value, q + load) };
        displacements[row] = u;
        forces[row] = f;
    }
    let error = error_of(green, &relative, noise, &capacitance, [&displacements, &forces]);
    let reactions = green.fixed_rows.iter().map(|&row| forces[row as usize]).collect();
    let surface = 3 * green.surface_count();
    displacements.truncate(surface);
    forces.truncate(surface);
    Ok(Answer { displacements, forces, reactions, error })
}

/// Displacements and forces of all rows but those given: unknowns of the response, and loads.
fn sorted(green: &GreensFunction, response: &[f64], rigid: &dyn Fn(usize) -> f64) -> (Vec<f64>, Vec<f64>) {
    let (mut displacements, mut forces) = (vec![0.0; green.rows], vec![0.0; green.rows]);
    for (row, &value) in response.iter().enumerate() {
        if green.row_is_fixed[row] {
            forces[row] = value;
        } else {
            displacements[row] = value + rigid(row);
            forces[row] = green.load_on_row(row);
        }
    }
    (displacements, forces)
}

/// Estimated error of displacements and forces by row, relative to the largest.
fn error_of(
    green: &GreensFunction,
    relative: &Conditions,
    mut noise: Noise<'_>,
    capacitance: &Mat<f64>,
    [displacements, forces]: [&[f64]; 2],
) -> f64 {
    let columns: Vec<usize> = relative.switched.iter().map(|&(column, _)| column).collect();
    let rows: Vec<usize> = columns.iter().map(|&column| green.row_of_column(column)).collect();
    let mut least_force = 0.0;
    if let Some(motion) = &relative.motion {
        noise.add_motion(motion.residual, |row| INPUT_ROUNDING * motion.at(green, row).abs());
        if motion.is_exact {
            let largest = (0..green.rows).filter(|&row| green.row_is_fixed[row]).map(|row| green.magnitude(row));
            least_force = FORCE_ROUNDING_FACTOR * motion.residual * largest.fold(0.0, f64::max);
        }
    }
    let (of_unknown, mut errors) = noise.errors(&columns, capacitance);
    let mut is_force = green.row_is_fixed.clone();
    for (row, error) in rows.into_iter().zip(of_unknown) {
        // What was unknown there is known now, and the other way round.
        (errors[row], is_force[row]) = (error, !is_force[row]);
    }
    relative_error(&errors, &is_force, displacements, forces, least_force)
}

/// `Psi_SS^-1 [ vb_S - response_S ]`. Symmetric positive definite if only free dofs are prescribed; with released
/// supports the coupling blocks are skew, and LU serves.
fn capacitance_solve(
    green: &GreensFunction,
    switched: &[(usize, f64)],
    capacitance: &Mat<f64>,
    response: &[f64],
) -> Result<Vec<f64>> {
    if switched.is_empty() {
        return Ok(Vec::new());
    }
    let rows: Vec<usize> = switched.iter().map(|&(column, _)| green.row_of_column(column)).collect();
    let n = rows.len();
    // A released support answers to its share of the reference loads besides the force given.
    let wanted = |i: usize| switched[i].1 + if green.row_is_fixed[rows[i]] { green.load_on_row(rows[i]) } else { 0.0 };
    let residual = Mat::from_fn(n, 1, |i, _| wanted(i) - response[rows[i]]);
    let unknown = if rows.iter().any(|&row| green.row_is_fixed[row]) {
        solve_released(capacitance, &residual, green.precision().unit_roundoff().max(COMPUTED_ERROR))?
    } else {
        match capacitance.llt(Side::Lower) {
            Ok(factor) => factor.solve(&residual),
            // A matrix that single precision has made slightly indefinite is still well solved by LU.
            Err(_) => capacitance.partial_piv_lu().solve(&residual),
        }
    };
    let unknown: Vec<f64> = (0..n).map(|i| unknown[(i, 0)]).collect();
    if unknown.iter().all(|q| q.is_finite()) {
        return Ok(unknown);
    }
    let precision = green.precision().name();
    Err(Error::Precision(format!(
        "the answer has no digit that is right: compliances of the prescribed nodes are the same in {precision}; prescribe \
         fewer neighbouring nodes, or compute the store with --precision f64 (precision='f64')"
    )))
}

/// `Psi_SS`, cut out of the blocks between the nodes of the rows `S`.
fn switched_square(green: &GreensFunction, rows: &[usize]) -> Mat<f64> {
    let mut nodes: Vec<u32> = rows.iter().map(|row| (row / 3) as u32).collect();
    nodes.sort_unstable();
    nodes.dedup();
    let at = |row: usize| 3 * nodes.partition_point(|&node| (node as usize) < row / 3) + row % 3;
    let places: Vec<usize> = rows.iter().map(|&row| at(row)).collect();
    let mut square = Mat::zeros(rows.len(), rows.len());
    let (mut block, mut in_block) = (vec![0.0; 9 * nodes.len()], None);
    for (j, &row) in rows.iter().enumerate() {
        // The dofs of a node mostly follow each other.
        if in_block != Some(row / 3)
            && let Some(column) = green.touchable(row / 3)
        {
            green.block(&nodes, &[column], &mut block);
            in_block = Some(row / 3);
        }
        let column = &block[row % 3 * 3 * nodes.len()..];
        for (i, &place) in places.iter().enumerate() {
            square[(i, j)] = column[place];
        }
    }
    square
}

/// Solves with released supports, refusing a body that is left free to move.
///
/// Then `Psi_SS` is singular up to the errors of its entries, about `e |Psi_ij|` each, so that
/// `1 / |Psi_SS^-1|_F <= e |Psi_SS|_F`; a matrix that meets this is refused, whatever made it so, for its solution would be
/// rounding errors. Rows and columns are first scaled to a unit diagonal: compliances (m/N) and stiffnesses (N/m) meet here.
fn solve_released(capacitance: &Mat<f64>, residual: &Mat<f64>, entry_error: f64) -> Result<Mat<f64>> {
    let n = capacitance.nrows();
    let scale: Vec<f64> = (0..n).map(|i| capacitance[(i, i)].abs().sqrt().recip()).collect();
    if !scale.iter().all(|s| s.is_finite()) {
        return Err(floating());
    }
    let scaled = Mat::from_fn(n, n, |i, j| scale[i] * capacitance[(i, j)] * scale[j]);
    let inverse = scaled.partial_piv_lu().inverse();
    let condition = scaled.norm_l2() * inverse.norm_l2();
    if !condition.is_finite() || condition * entry_error >= 1.0 {
        return Err(floating());
    }
    let unknown = &inverse * Mat::from_fn(n, 1, |i, _| scale[i] * residual[(i, 0)]);
    Ok(Mat::from_fn(n, 1, |i, _| scale[i] * unknown[(i, 0)]))
}

fn floating() -> Error {
    Error::Singular(
        "the released supports leave the body, or a part of it, free to move; keep supports that hold it, \
         or prescribe displacements that do"
            .into(),
    )
}
