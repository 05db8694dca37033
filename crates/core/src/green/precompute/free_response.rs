//! The free response: what the reference loads (weight, pressure, nodal forces) do to the body before anyone touches it.
//!
//! With the loads `F` on all dofs as knowns of the reference problem, `v = Psi F_N` without forming the columns inside:
//!
//! ```text
//! u_N = K_NN^-1 F_N,      f_D = K_DN u_N
//! ```
//!
//! `f_D` is `K u` on the supports: the support reaction is `f_D - F_D`, for what is loaded onto a support goes straight
//! into it.

//! It is corrected once by its residual, which tells the error that it had: `K_NN e = F_N - K_NN u`, in the energy norm
//! `sqrt(e^T K e)`.

use faer::mat::MatMut;

use crate::fem::{Supports, SymmetricCsc};
use crate::solver::Factor;
use crate::{Error, Result};

/// `v` on the rows for the reference loads, and its error in the energy norm, sqrt(J).
#[derive(Default)]
pub struct FreeResponse {
    /// Displacements, m, and forces, N; empty without loads.
    pub values: Vec<f64>,
    /// Before the correction, which bounds what is left.
    pub error: f64,
    /// Its energy norm, sqrt(J).
    pub size: f64,
}

/// `v` on the rows `row_dofs` for the loads (N, all dofs); empty if there are none.
///
/// # Errors
/// A wrong number of loads.
pub fn free_response(
    stiffness: &SymmetricCsc,
    factor: &Factor,
    supports: &Supports,
    loads: &[f64],
    row_dofs: &[u32],
) -> Result<FreeResponse> {
    if loads.is_empty() {
        return Ok(FreeResponse::default());
    }
    if loads.len() != stiffness.dimension {
        return Err(Error::Invalid(format!("{} loads were given for {} dofs", loads.len(), stiffness.dimension)));
    }
    let mut memory = factor.solve_scratch(1);
    let mut solve = |x: &mut [f64]| {
        let rows = x.len();
        factor.solve_in_place(MatMut::from_column_major_slice_mut(x, rows, 1), &mut memory);
    };
    let mut residual: Vec<f64> = supports.free.iter().map(|&dof| loads[dof as usize]).collect();
    let mut free = residual.clone();
    solve(&mut free);
    subtract_product(stiffness, supports, &free, &mut residual);
    let mut correction = residual.clone();
    solve(&mut correction);
    let energy: f64 = residual.iter().zip(&correction).map(|(r, e)| r * e).sum();
    free.iter_mut().zip(&correction).for_each(|(u, e)| *u += e);
    let work: f64 = supports.free.iter().zip(&free).map(|(&dof, u)| loads[dof as usize] * u).sum();
    let displacement = |dof: u32| match supports.free_rank[dof as usize] {
        u32::MAX => 0.0,
        rank => free[rank as usize],
    };
    let of_row = |&dof: &u32| {
        if supports.is_fixed(dof) {
            stiffness.column(dof as usize).map(|(other, k)| k * displacement(other)).sum()
        } else {
            displacement(dof)
        }
    };
    let values = row_dofs.iter().map(of_row).collect();
    Ok(FreeResponse { values, error: energy.abs().sqrt(), size: work.abs().sqrt() })
}

/// `residual -= K_NN x` for a vector on the free dofs.
pub fn subtract_product(stiffness: &SymmetricCsc, supports: &Supports, x: &[f64], residual: &mut [f64]) {
    for (r, &dof) in residual.iter_mut().zip(&supports.free) {
        let free = |(other, k): (u32, f64)| x.get(supports.free_rank[other as usize] as usize).map_or(0.0, |x| k * x);
        *r -= stiffness.column(dof as usize).map(free).sum::<f64>();
    }
}
