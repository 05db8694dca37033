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

use std::ops::Range;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltRegularization, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Accum, MatMut, Par};
use rayon::prelude::*;

use super::block_columns::{BlockColumn, WIDTH, cuts};
use super::buffers::{Buffers, buffer_numbers};
use crate::{Error, Result};

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

impl Eliminated {
    /// Gives its memory to others.
    pub fn recycle(self, buffers: &Buffers) {
        self.blocks.into_iter().for_each(|block| buffers.give(block.into_values()));
    }
}

/// Update matrix of a child, which is added to the front of its parent.
pub struct UpdateMatrix {
    update: Update,
    /// Places of its boundary in the front, ascending.
    places: Vec<u32>,
    /// Where they follow each other without a gap, as ranges of their indices.
    runs: Vec<Range<usize>>,
}

impl UpdateMatrix {
    /// The update of a child, whose boundary has the ascending `places` in the front.
    pub fn new(update: Update, places: Vec<u32>) -> Self {
        let mut from = 0;
        let range = |run: &[u32]| {
            from += run.len();
            from - run.len()..from
        };
        let runs = places.chunk_by(|a, b| a + 1 == *b).map(range).collect();
        Self { update, places, runs }
    }

    /// Its columns from a place in the front on.
    fn from(&self, place: usize) -> Rest<'_> {
        let column = self.places.partition_point(|&other| (other as usize) < place);
        Rest { of: self, column, runs: &self.runs[self.runs.partition_point(|run| run.end <= column)..] }
    }
}

/// Columns of an addend that are not added yet.
struct Rest<'a> {
    of: &'a UpdateMatrix,
    column: usize,
    runs: &'a [Range<usize>],
}

impl Rest<'_> {
    /// Adds to the column of a place, whose rows begin with that of place `first`; all places are asked for in turn.
    fn add(&mut self, place: usize, first: usize, target: &mut [f64]) {
        let UpdateMatrix { update, places, .. } = self.of;
        if places.get(self.column).is_none_or(|&next| next as usize != place) {
            return;
        }
        let source = &update.0[self.column / WIDTH];
        let values = &source.column(self.column - source.first)[self.column - source.first..];
        for run in self.runs {
            let start = run.start.max(self.column);
            let target = &mut target[places[start] as usize - first..][..run.end - start];
            target.iter_mut().zip(&values[start - self.column..]).for_each(|(sum, value)| *sum += value);
        }
        self.column += 1;
        if self.runs.first().is_some_and(|run| run.end <= self.column) {
            self.runs = &self.runs[1..];
        }
    }
}

/// Blocks of the columns of a supernode, first columns and widths, then those of its boundary.
fn blocks(size: usize, boundary: usize) -> impl Iterator<Item = (usize, usize)> {
    cuts(size).chain(cuts(boundary).map(move |(first, width)| (size + first, width)))
}

/// Numbers of a front, and of its update.
pub fn front_numbers(size: usize, boundary: usize) -> (usize, usize) {
    let numbers = |from: usize| -> usize {
        let panels = blocks(size, boundary).filter(|&(first, _)| first >= from);
        panels.map(|(first, width)| buffer_numbers(width * (size + boundary - first))).sum()
    };
    (numbers(0), numbers(size))
}

/// Visits the entries of a column of the supernode: positions of their rows, and values.
pub type ColumnEntries<'a> = &'a (dyn Fn(usize, &mut dyn FnMut(usize, f64)) + Sync);

impl Front {
    /// The sum of the supernode's columns of the matrix, whose rows on and below the diagonal `own` tells by their places,
    /// and the updates of the children.
    pub fn new(
        size: usize,
        boundary: usize,
        own: ColumnEntries<'_>,
        children: Vec<UpdateMatrix>,
        buffers: &Buffers,
    ) -> Self {
        let rows = size + boundary;
        let block = |(first, width): (usize, usize)| {
            BlockColumn::new(first, width, rows - first, buffers.take(width * (rows - first)))
        };
        let mut blocks: Vec<BlockColumn<f64>> = blocks(size, boundary).map(block).collect();
        // Column by column, each cleared and summed while the cache has it.
        let assemble = |block: &mut BlockColumn<f64>| {
            let first = block.first;
            let mut rests: Vec<Rest<'_>> = children.iter().map(|child| child.from(first)).collect();
            for column in 0..block.width {
                let target = block.column_mut(column);
                target.fill(0.0);
                if first + column < size {
                    own(first + column, &mut |row, value| target[row - first] += value);
                }
                rests.iter_mut().for_each(|rest| rest.add(first + column, first, target));
            }
        };
        if rows < SHARED {
            blocks.iter_mut().for_each(assemble);
        } else {
            blocks.par_iter_mut().with_max_len(1).for_each(assemble);
        }
        for child in children {
            child.update.0.into_iter().for_each(|block| buffers.give(block.into_values()));
        }
        Self { rows, size, blocks }
    }

    /// Number of blocks with columns of the supernode.
    fn pivots(&self) -> usize {
        self.size.div_ceil(WIDTH)
    }

    /// Eliminates the supernode.
    ///
    /// # Errors
    /// A pivot that is not a positive number.
    pub fn eliminate(mut self) -> Result<(Eliminated, Update)> {
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
fn factorise(block: &mut BlockColumn<f64>, shared: bool) -> Result<()> {
    let width = block.width;
    let mut memory = MemBuffer::new(cholesky_in_place_scratch::<f64>(width, Par::Seq, Default::default()));
    let (mut top, below) = block.matrix_mut().split_at_row_mut(width);
    let regular = LltRegularization::default();
    cholesky_in_place(top.as_mut(), regular, Par::Seq, MemStack::new(&mut memory), Default::default())
        .map_err(|_| not_positive())?;
    if !(0..width).all(|k| top[(k, k)].is_finite()) {
        return Err(not_positive());
    }
    let top = top.as_ref();
    in_row_chunks(below, shared, &|_, rows| solve_lower_triangular_in_place(top, rows.transpose_mut(), Par::Seq));
    Ok(())
}

fn not_positive() -> Error {
    Error::Singular("a pivot is not positive; is every part of the body held by a support?".into())
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
