//! Sixteen bits an entry: `Psi_ij = s_i s_j q_ij` with one scale a dof, so that `q` is as symmetric as `Psi`.
//!
//! With `s_i^2` the compliance `Psi_ii` of a free dof and the stiffness `K_ii` of a supported one, the inequality of
//! Cauchy and Schwarz in the inner product of `K_NN^-1` gives `|Psi_ij| <= s_i s_j` for every pair: `Psi_NN` directly,
//! `Psi_DD <= K_DD` because the subtracted part is positive, and `(Psi_ND)_ij^2 <= Psi_ii (K - Psi)_jj`. Rows without a
//! column have no mirror and are scaled by their largest entry. `q` reaches up to [`RANGE`], far below the largest half
//! number, so that entries down to 4e-9 of their bound keep all 11 bits.

use half::f16;
use half::slice::HalfFloatSliceExt;

use super::columns::Layout;
use super::mirror::Mirror;
use super::number::Number;
use crate::Result;
use crate::fem::SymmetricCsc;

/// Largest `|q|`: the square of a power of two, so that scales lose nothing by it.
const RANGE: f64 = 16384.0;
/// Numbers converted at a time, on the stack.
const CHUNK: usize = 256;

/// Scale of every row; a column has that of its row.
///
/// # Errors
/// That of reading a panel.
pub fn scales<T: Number>(mirror: &Mirror<'_, T>, stiffness: &SymmetricCsc) -> Result<Vec<f64>> {
    let Layout { row_dofs, order, supported, extra, .. } = mirror.layout;
    let own = |dof: u32| stiffness.column(dof as usize).find(|&(row, _)| row == dof).map_or(0.0, |(_, value)| value);
    let mut of_place: Vec<f64> = mirror.diagonal()?.into_iter().map(Number::to_f64).collect();
    for (scale, &row) in of_place.iter_mut().zip(&order[..*supported]) {
        *scale = own(row_dofs[row as usize]);
    }
    of_place.iter_mut().for_each(|scale| *scale = (*scale / RANGE).sqrt());
    let mut largest = vec![0.0f64; extra.len()];
    mirror.extra(&mut |row, place, value| {
        largest[row] = largest[row].max(value.to_f64().abs() / of_place[place]);
    })?;
    of_place.extend(largest.into_iter().map(|value| if value > 0.0 { value / RANGE } else { 1.0 }));
    Ok(mirror.layout.place_of_row.iter().map(|&place| of_place[place as usize]).collect())
}

/// `q` of a column from its entries.
pub fn quantise<T: Number>(column: &[T], column_scale: f64, row_scales: &[f64], out: &mut [f16]) {
    for ((q, value), scale) in out.iter_mut().zip(column).zip(row_scales) {
        *q = f16::from_f64(value.to_f64() / (scale * column_scale));
    }
}

/// `out += factor * s_j * s_i q_ij`, `factor_scaled` being `factor * s_j`.
pub fn add_scaled(column: &[f16], factor_scaled: f64, row_scales: &[f64], out: &mut [f64]) {
    let mut numbers = [0.0f32; CHUNK];
    for ((q, out), scales) in column.chunks(CHUNK).zip(out.chunks_mut(CHUNK)).zip(row_scales.chunks(CHUNK)) {
        q.convert_to_f32_slice(&mut numbers[..q.len()]);
        for ((o, &number), scale) in out.iter_mut().zip(&numbers).zip(scales) {
            *o += factor_scaled * (scale * f64::from(number));
        }
    }
}
