//! Free response: displacements and reactions under the reference loads alone (weight, pressure, nodal forces).
//!
//! With the loads `F` on all dofs as knowns of the reference problem, `v = Psi F_N` without forming the columns inside:
//!
//! ```text
//! u_N = K_NN^-1 F_N,      f_D = K_DN u_N
//! ```
//!
//! `f_D` is `K u` on the supports: the support reaction is `f_D - F_D`, for a load on a support acts on it directly.
//!
//! It is corrected by its residual, which gives the error before the correction: `K_NN e = F_N - K_NN u`, in the energy norm
//! `sqrt(e^T K e)`.

use super::inverse::Inverse;
use super::number::Number;
use crate::fem::{Supports, SymmetricCsc};
use crate::{Error, Result};

/// `v` on the rows for the reference loads, and its error in the energy norm, sqrt(J).
#[derive(Default)]
pub struct FreeResponse {
    /// Displacements, m, and forces, N; empty without loads.
    pub values: Vec<f64>,
    /// The last correction, which bounds the remaining error.
    pub error: f64,
    /// Its energy norm, sqrt(J).
    pub size: f64,
}

/// `v` on the rows `row_dofs` for the loads (N, all dofs); empty if there are none, `None` where corrections do not help.
///
/// # Errors
/// A wrong number of loads.
pub fn free_response<C: Number>(
    stiffness: &SymmetricCsc,
    inverse: &Inverse<'_, C>,
    supports: &Supports,
    loads: &[f64],
    row_dofs: &[u32],
) -> Result<Option<FreeResponse>> {
    if loads.is_empty() {
        return Ok(Some(FreeResponse::default()));
    }
    if loads.len() != stiffness.dimension {
        return Err(Error::Invalid(format!("{} loads were given for {} dofs", loads.len(), stiffness.dimension)));
    }
    let free: Vec<f64> = supports.free.iter().map(|&dof| loads[dof as usize]).collect();
    let Some(found) = inverse.refined(&free) else { return Ok(None) };
    let displacement = |dof: u32| found.columns.get(supports.free_rank[dof as usize] as usize).copied().unwrap_or(0.0);
    let of_row = |&dof: &u32| {
        if supports.is_fixed(dof) {
            stiffness.column(dof as usize).map(|(other, k)| k * displacement(other)).sum()
        } else {
            displacement(dof)
        }
    };
    let values = row_dofs.iter().map(of_row).collect();
    Ok(Some(FreeResponse { values, error: found.last[0] * found.size[0], size: found.size[0] }))
}
