//! The front of a supernode: its columns of the matrix with what the eliminated supernodes below have added, and what its
//! own elimination adds to those above.
//!
//! With the supernode's dofs `k` first and those of its boundary `b` after them,
//!
//! ```text
//! | F_kk  .    |     L_kk = chol(F_kk),  L_bk = F_bk L_kk^-T,  U_bb = F_bb - L_bk L_bk^T
//! | F_bk  F_bb |
//! ```
//!
//! `U` is added to the front of the parent, which holds all of the boundary (I. Duff and J. Reid, The multifrontal solution
//! of indefinite sparse symmetric linear equations, ACM TOMS 9, 1983). Every entry is summed by one thread in an order that
//! does not depend on how many there are.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltRegularization, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Accum, MatMut, Par};
use rayon::prelude::*;

use super::block_columns::{BlockColumn, WIDTH, trapezoid, trapezoid_len};

/// Rows that a task works on at a time: with [`WIDTH`] columns they stay in the second-level cache.
const ROWS: usize = 512;
/// A front of fewer rows is one task.
pub const SHARED: usize = 768;

/// A front being assembled.
pub struct Front {
    rows: usize,
    size: usize,
    /// Columns of the supernode, then those of the boundary.
    blocks: Vec<BlockColumn<f64>>,
}

/// Columns of the factor: `L_kk` over `L_bk`; what stands above the diagonal is not defined.
pub struct Eliminated {
    /// Number of rows, those of the columns themselves first.
    pub rows: usize,
    /// The columns.
    pub blocks: Vec<BlockColumn<f64>>,
}

/// `U_bb`, lower half.
pub struct Update(Vec<BlockColumn<f64>>);

/// Numbers of a front, and of its update.
pub fn front_numbers(size: usize, boundary: usize) -> (usize, usize) {
    let update = trapezoid_len(boundary, boundary);
    (trapezoid_len(size, size + boundary) + update, update)
}

impl Front {
    /// Zeros.
    pub fn new(size: usize, boundary: usize) -> Self {
        let mut blocks = trapezoid(size, size + boundary);
        blocks.extend(trapezoid(boundary, boundary).into_iter().map(|mut block: BlockColumn<f64>| {
            block.first += size;
            block
        }));
        Self { rows: size + boundary, size, blocks }
    }

    /// Number of blocks with columns of the supernode.
    fn pivots(&self) -> usize {
        self.size.div_ceil(WIDTH)
    }

    /// Adds an entry of the matrix in a column of the supernode, on or below its diagonal.
    pub fn add(&mut self, row: usize, column: usize, value: f64) {
        let block = &mut self.blocks[column / WIDTH];
        let first = block.first;
        block.column_mut(column - first)[row - first] += value;
    }

    /// Adds the update of a child, whose boundary has the ascending `places` here.
    pub fn assemble(&mut self, update: &Update, places: &[u32]) {
        let add = |block: &mut BlockColumn<f64>| {
            let first = block.first;
            let from = places.partition_point(|&place| (place as usize) < first);
            let to = places.partition_point(|&place| (place as usize) < first + block.width);
            for column in from..to {
                let target = block.column_mut(places[column] as usize - first);
                let source = &update.0[column / WIDTH];
                let values = &source.column(column - source.first)[column - source.first..];
                for (value, &place) in values.iter().zip(&places[column..]) {
                    target[place as usize - first] += value;
                }
            }
        };
        if places.len() < SHARED {
            self.blocks.iter_mut().for_each(add);
        } else {
            self.blocks.par_iter_mut().with_max_len(1).for_each(add);
        }
    }

    /// Eliminates the supernode. An error is a pivot that is not positive.
    pub fn eliminate(mut self) -> Result<(Eliminated, Update), NotPositive> {
        let (pivots, shared) = (self.pivots(), self.rows >= SHARED);
        for k in 0..pivots {
            let (done, rest) = self.blocks.split_at_mut(k);
            let block = &mut rest[0];
            subtract(done, block, shared);
            factorise(block, shared)?;
        }
        let mut update = self.blocks.split_off(pivots);
        let done = &self.blocks;
        let subtract = |block: &mut BlockColumn<f64>| {
            subtract(done, block, shared);
            block.first -= self.size;
        };
        if shared {
            update.par_iter_mut().with_max_len(1).for_each(subtract);
        } else {
            update.iter_mut().for_each(subtract);
        }
        Ok((Eliminated { rows: self.rows, blocks: self.blocks }, Update(update)))
    }
}

/// A pivot is not a positive number.
#[derive(Clone, Copy, Debug)]
pub struct NotPositive;

/// `F_j -= L_i L_i^T` for the finished blocks of columns `i`.
fn subtract(done: &[BlockColumn<f64>], block: &mut BlockColumn<f64>, shared: bool) {
    let (first, width) = (block.first, block.width);
    if done.is_empty() {
        return;
    }
    in_row_chunks(block.matrix_mut(), shared, &|from, mut rows| {
        for earlier in done {
            let all = earlier.rows_from(first);
            let (left, right) = (all.subrows(from, rows.nrows()), all.subrows(0, width));
            matmul(rows.as_mut(), Accum::Add, left, right.transpose(), -1.0, Par::Seq);
        }
    });
}

/// `L_kk`, then `L_bk`, of one block of columns.
fn factorise(block: &mut BlockColumn<f64>, shared: bool) -> Result<(), NotPositive> {
    let width = block.width;
    let mut memory = MemBuffer::new(cholesky_in_place_scratch::<f64>(width, Par::Seq, Default::default()));
    let (mut top, below) = block.matrix_mut().split_at_row_mut(width);
    let regular = LltRegularization::default();
    cholesky_in_place(top.as_mut(), regular, Par::Seq, MemStack::new(&mut memory), Default::default())
        .map_err(|_| NotPositive)?;
    if !(0..width).all(|k| top[(k, k)].is_finite()) {
        return Err(NotPositive);
    }
    let top = top.as_ref();
    in_row_chunks(below, shared, &|_, rows| solve_lower_triangular_in_place(top, rows.transpose_mut(), Par::Seq));
    Ok(())
}

/// Calls `work` with the first row and the rows of every chunk.
fn in_row_chunks(matrix: MatMut<'_, f64>, shared: bool, work: &(dyn Fn(usize, MatMut<'_, f64>) + Sync)) {
    if matrix.nrows() == 0 {
        return;
    }
    if shared {
        matrix.par_row_chunks_mut(ROWS).enumerate().for_each(|(k, rows)| work(k * ROWS, rows));
        return;
    }
    let (mut from, mut rest) = (0, matrix);
    while rest.nrows() > 0 {
        let height = ROWS.min(rest.nrows());
        let (rows, below) = rest.split_at_row_mut(height);
        work(from, rows);
        (from, rest) = (from + ROWS, below);
    }
}
