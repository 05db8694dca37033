//! The matrices `G` and `M` of every node of the tree (see [`super::tree`]), from the columns of the factor.
//!
//! A node is a block of columns of a supernode, not all of it: with `W = L_kk^-1` of the block, `M = W^T W` and `G = L_bk W`
//! cost `w (w + b)` operations a column of the block. Of a whole supernode with `n` columns they would cost `n (n + b)` each,
//! several times the factor itself, and save a sweep `n^2` operations for each column that is read there but not loaded.

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_inverse::invert_lower_triangular;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rayon::prelude::*;

use super::number::Number;
use crate::solver::block_columns::{BlockColumn, trapezoid_len};
use crate::solver::front::{Eliminated, SHARED};

/// Rows of `G` that a task computes at a time.
const ROWS: usize = 512;

/// `G` (boundary by rows) and `M` (rows by rows) of a node, columns contiguous.
pub struct Operator<C> {
    size: usize,
    g: Vec<C>,
    m: Vec<C>,
}

/// Numbers of the operators of a supernode: those of its columns of the factor.
pub fn operator_numbers(size: usize, boundary: usize) -> usize {
    trapezoid_len(size, size + boundary)
}

impl<C: Number> Operator<C> {
    /// Those of a supernode, one for each block of its columns.
    pub fn all(factor: &Eliminated) -> Vec<Self> {
        let shared = factor.rows >= SHARED;
        factor.blocks.iter().map(|block| Self::new(block, shared)).collect()
    }

    fn new(block: &BlockColumn<f64>, shared: bool) -> Self {
        let size = block.width;
        let (top, below) = block.matrix().split_at_row(size);
        let mut inverse = Mat::zeros(size, size);
        invert_lower_triangular(inverse.as_mut(), top, Par::Seq);
        let mut m = Mat::zeros(size, size);
        matmul(m.as_mut(), Accum::Replace, inverse.transpose(), inverse.as_ref(), 1.0, Par::Seq);
        let mut g = vec![C::default(); size * below.nrows()];
        if below.nrows() > 0 {
            let target = MatMut::from_column_major_slice_mut(&mut g, below.nrows(), size);
            let product = |(k, mut target): (usize, MatMut<'_, C>)| {
                let mut rows = Mat::zeros(target.nrows(), size);
                let left = below.subrows(k * ROWS, target.nrows());
                matmul(rows.as_mut(), Accum::Replace, left, inverse.as_ref(), 1.0, Par::Seq);
                for j in 0..size {
                    let (target, values) = (target.as_mut().col_mut(j), rows.col_as_slice(j));
                    let target = target.try_as_col_major_mut();
                    let Some(target) = target else { return };
                    target.as_slice_mut().iter_mut().zip(values).for_each(|(to, &from)| *to = C::from_f64(from));
                }
            };
            let pieces = target.par_row_chunks_mut(ROWS).enumerate();
            pieces.with_min_len(if shared { 1 } else { usize::MAX }).for_each(product);
        }
        let m = (0..size).flat_map(|j| m.col_as_slice(j)).map(|&value| C::from_f64(value)).collect();
        Self { size, g, m }
    }

    /// `G`.
    pub fn g(&self) -> MatRef<'_, C> {
        MatRef::from_column_major_slice(&self.g, self.g.len().checked_div(self.size).unwrap_or(0), self.size)
    }

    /// `M`.
    pub fn m(&self) -> MatRef<'_, C> {
        MatRef::from_column_major_slice(&self.m, self.size, self.size)
    }

    /// Of some of the rows only, ascending.
    pub fn cut(self, rows: &[usize]) -> Self {
        if rows.len() == self.size {
            return self;
        }
        let (g, m) = (self.g(), self.m());
        let columns = rows.iter().flat_map(|&row| (0..g.nrows()).map(move |i| g[(i, row)])).collect();
        let square = rows.iter().flat_map(|&j| rows.iter().map(move |&i| m[(i, j)])).collect();
        Self { size: rows.len(), g: columns, m: square }
    }

    /// Whether all are finite.
    pub fn is_finite(&self) -> bool {
        self.g.iter().chain(&self.m).all(|value| value.to_f64().is_finite())
    }
}
