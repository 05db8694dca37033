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

use faer::mat::MatMut;

use crate::fem::{Supports, SymmetricCsc};
use crate::solver::Factor;
use crate::{Error, Result};

/// `v` on the rows `row_dofs` for the loads (N, all dofs); empty if there are none.
///
/// # Errors
/// A wrong number of loads.
pub(super) fn free_response(
    stiffness: &SymmetricCsc,
    factor: &Factor,
    supports: &Supports,
    loads: &[f64],
    row_dofs: &[u32],
) -> Result<Vec<f64>> {
    if loads.is_empty() {
        return Ok(Vec::new());
    }
    if loads.len() != stiffness.dimension {
        return Err(Error::Invalid(format!("{} loads were given for {} dofs", loads.len(), stiffness.dimension)));
    }
    let mut free: Vec<f64> = supports.free.iter().map(|&dof| loads[dof as usize]).collect();
    let rows = free.len();
    let mut memory = factor.solve_scratch(1);
    factor.solve_in_place(MatMut::from_column_major_slice_mut(&mut free, rows, 1), &mut memory);
    let displacement = |dof: u32| match supports.free_rank[dof as usize] {
        u32::MAX => 0.0,
        rank => free[rank as usize],
    };
    Ok(row_dofs
        .iter()
        .map(|&dof| {
            if supports.is_fixed(dof) {
                stiffness.column(dof as usize).map(|(other, k)| k * displacement(other)).sum()
            } else {
                displacement(dof)
            }
        })
        .collect())
}
