//! The bound of every row, which scales entries of sixteen bits and measures the error of all.
//!
//! With `s_i^2` the compliance `Psi_ii` of a free dof and the stiffness `K_ii` of a supported one, the inequality of
//! Cauchy and Schwarz in the inner product of `K_NN^-1` gives `|Psi_ij| <= s_i s_j` for every pair: `Psi_NN` directly,
//! `Psi_DD <= K_DD` because the subtracted part is positive, and `(Psi_ND)_ij^2 <= Psi_ii (K - Psi)_jj`. Rows without a
//! column have no mirror; theirs follows from their largest entry.
//!
//! Sixteen bits an entry: `Psi_ij = s_i s_j q_ij / RANGE`, `q` an integer, with one scale a dof, so that `q` is as symmetric as
//! `Psi`. A scale for each block of nodes gains nothing: neighbours have about the same bound, and the relevant error is rounding
//! relative to it in nearly dependent columns.
//!
//! Half-precision floats of the same size and scales were measured too and are less accurate: a contact is solved with entries near
//! their bound, which have 15 bits here and 11 there (nodal forces under 20 neighbouring
//! nodes: 1e-2 of the largest with halves).

use super::columns::AssembledProblem;
use super::mirror::Mirror;
use super::number::Number;
use crate::Result;

/// Bound `s_i` of every row of the store.
///
/// # Errors
/// That of reading a panel.
pub fn magnitudes<T: Number>(mirror: &Mirror<'_, T>) -> Result<Vec<f64>> {
    let AssembledProblem { stiffness, layout, .. } = mirror.parts;
    let mut of_place: Vec<f64> = mirror.diagonal()?.into_iter().map(Number::to_f64).collect();
    for (place, square) in of_place.iter_mut().enumerate() {
        if layout.is_support(place) {
            *square = stiffness.diagonal(layout.dof(place));
        }
        *square = square.sqrt();
    }
    let mut of_rank = vec![0.0f64; layout.rows()];
    mirror.rows_without_column(&mut |rank, place, value| {
        of_rank[rank] = of_rank[rank].max(value.to_f64().abs() / of_place[place]);
    })?;
    of_rank.iter_mut().filter(|value| **value == 0.0).for_each(|value| *value = 1.0);
    for (place, &value) in of_place.iter().enumerate() {
        of_rank[layout.rank(place)] = value;
    }
    Ok(mirror.arrangement.rank_of_stored.iter().map(|&rank| of_rank[rank as usize]).collect())
}
