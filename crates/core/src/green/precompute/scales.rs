//! Sixteen bits an entry: `Psi_ij = s_i s_j q_ij`, `q` an integer, with one scale a dof, so that `q` is as symmetric as
//! `Psi`.
//!
//! With `s_i^2` the compliance `Psi_ii` of a free dof and the stiffness `K_ii` of a supported one, the inequality of
//! Cauchy and Schwarz in the inner product of `K_NN^-1` gives `|Psi_ij| <= s_i s_j` for every pair: `Psi_NN` directly,
//! `Psi_DD <= K_DD` because the subtracted part is positive, and `(Psi_ND)_ij^2 <= Psi_ii (K - Psi)_jj`. Rows without a
//! column have no mirror and are scaled by their largest entry.
//!
//! Half-precision floats of the same size and scales were measured beside these integers and lose: what a contact solves
//! with are the entries near their bound, and those have 15 bits here and 11 there (nodal forces under 20 neighbouring
//! nodes: 1e-2 of the largest with halves).

use super::layout::Layout;
use super::mirror::Mirror;
use super::number::Number;
use crate::Result;
use crate::fem::SymmetricCsc;

/// Largest `|q|`.
const RANGE: f64 = i16::MAX as f64;

/// Scale of every row of the store; a column has that of its row.
///
/// # Errors
/// That of reading a panel.
pub fn scales<T: Number>(mirror: &Mirror<'_, T>, stiffness: &SymmetricCsc) -> Result<Vec<f64>> {
    let Layout { row_dofs, order, columns, supported, place_of_stored, .. } = mirror.layout;
    let own = |dof: u32| stiffness.column(dof as usize).find(|&(row, _)| row == dof).map_or(0.0, |(_, value)| value);
    let mut of_place: Vec<f64> = mirror.diagonal()?.into_iter().map(Number::to_f64).collect();
    for (scale, &row) in of_place.iter_mut().zip(&order[..*supported]) {
        *scale = own(row_dofs[row as usize]);
    }
    of_place.iter_mut().for_each(|scale| *scale = (*scale / RANGE).sqrt());
    let mut largest = vec![0.0f64; order.len() - columns];
    mirror.rows_without_column(&mut |row, column, value| {
        largest[row - columns] = largest[row - columns].max(value.to_f64().abs() / of_place[column]);
    })?;
    of_place.extend(largest.into_iter().map(|value| if value > 0.0 { value / RANGE } else { 1.0 }));
    Ok(place_of_stored.iter().map(|&place| of_place[place as usize]).collect())
}

/// `q` of a column from its entries, the inverse scales being given.
pub fn quantise<T: Number>(column: &[T], column_inverse: f64, row_inverses: &[f64], out: &mut [i16]) {
    for ((q, value), inverse) in out.iter_mut().zip(column).zip(row_inverses) {
        // The conversion saturates, where rounding has crossed the bound.
        *q = (value.to_f64() * (inverse * column_inverse)).round() as i16;
    }
}
