//! The whole operator from its panels, symmetric to the bit: `Psi_NN` and `Psi_DD` symmetric, `Psi_DN = -Psi_ND^T`. An
//! operator that is not lets a hand draw energy from a static spring.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::arrangement::Arrangement;
use super::columns::AssembledProblem;
use super::layout::{Block, runs};
use super::number::Number;
use super::panels::Panels;
use super::tasks::in_tasks;
use crate::Result;
use crate::green::entries::scales;
use crate::green::precision::Precision;

/// Panels that are finished, and their order.
pub struct Mirror<'a, T> {
    /// Matrix, rows and columns.
    pub parts: &'a AssembledProblem,
    /// Order of rows and columns in the store.
    pub arrangement: &'a Arrangement,
    /// Blocks of columns that are ready: the first ones.
    pub blocks: &'a [Block],
    /// Their panels.
    pub panels: &'a Panels<T>,
    /// Blocks put together at a time.
    pub tasks: usize,
}

/// Rows of a panel that are read at a time, at most.
const ROWS_AT_ONCE: usize = 256;

impl<T: Number> Mirror<'_, T> {
    /// Calls `put(column of the store, bytes)` for every column, from several tasks at a time. `magnitude` are the bounds of
    /// the stored rows. A task has `2 width + 1` numbers a row in memory, as the plan counts them.
    ///
    /// # Errors
    /// That of reading a panel, or of `put`.
    pub fn columns(
        &self,
        precision: Precision,
        magnitude: &[f64],
        put: &(dyn Fn(usize, &[u8]) -> Result<()> + Sync),
    ) -> Result<()> {
        let inverse: Vec<f64> = scales(precision, magnitude).into_iter().map(|scale| 1.0 / scale).collect();
        let store = |place: usize, numbers: &[T]| {
            let column = self.arrangement.column(&self.parts.layout, place);
            if precision != Precision::F16 {
                return put(column, bytemuck::cast_slice(numbers));
            }
            let mut quantised = vec![0i16; numbers.len()];
            quantise(numbers, inverse[column], &inverse, &mut quantised);
            put(column, bytemuck::cast_slice(&quantised))
        };
        let next = AtomicUsize::new(0);
        in_tasks(self.tasks, &|| {
            let (mut lines, mut panel, mut column) =
                (Vec::new(), Vec::new(), vec![T::default(); self.parts.layout.rows()]);
            loop {
                let block = next.fetch_add(1, Ordering::Relaxed);
                if block >= self.blocks.len() {
                    return Ok(());
                }
                self.lines(block, &mut lines, &mut panel)?;
                for (k, line) in lines.chunks_exact(self.parts.layout.rows()).enumerate() {
                    for (value, &rank) in column.iter_mut().zip(&self.arrangement.rank_of_stored) {
                        *value = line[rank as usize];
                    }
                    store(self.blocks[block].first + k, &column)?;
                }
            }
        })
    }

    /// The columns of a block with all their rows by rank.
    fn lines(&self, index: usize, lines: &mut Vec<T>, panel: &mut Vec<T>) -> Result<()> {
        let (block, length) = (&self.blocks[index], self.parts.layout.rows());
        let ranks = self.parts.layout.ranks(block);
        lines.resize(block.width * length, T::default());
        // Of the ranks below each column's own, how many are solved so far: no panel after them has their rows.
        let mut solved = vec![0; block.width];
        for (earlier_index, earlier) in self.blocks[..index].iter().enumerate() {
            let theirs = self.parts.layout.ranks(earlier);
            let below = ranks.iter().map(|&rank| theirs.partition_point(|&other| other < rank));
            solved.iter_mut().zip(below).for_each(|(solved, below)| *solved += below);
            self.rows(earlier_index, &solved, ranks, panel)?;
            let other_kind = self.parts.layout.moves_supports(earlier) != self.parts.layout.moves_supports(block);
            let runs = runs(theirs.iter().copied());
            for (line, mut piece) in lines.chunks_exact_mut(length).zip(panel.chunks_exact(earlier.width)) {
                for run in &runs {
                    let (part, rest) = piece.split_at(run.len());
                    let target = &mut line[run.clone()];
                    if other_kind {
                        target.iter_mut().zip(part).for_each(|(value, &solved)| *value = -solved);
                    } else {
                        target.copy_from_slice(part);
                    }
                    piece = rest;
                }
            }
        }
        panel.resize(block.len(), T::default());
        self.panels.get(index, 0, panel)?;
        let mut row = 0;
        for run in self.parts.layout.panel_rows(block) {
            let part = &panel[row * block.width..(row + run.len()) * block.width];
            transpose_into(part, block.width, lines, length, run.start);
            row += run.len();
        }
        for (k, line) in lines.chunks_exact_mut(length).enumerate() {
            for (&rank, &value) in ranks[..k].iter().zip(&panel[k * block.width..]) {
                line[rank as usize] = value;
            }
        }
        Ok(())
    }

    /// Rows `ranks` of an earlier panel, which are columns of a later block: contiguous pieces of lines. `solved` has for
    /// each rank the number of lower ranks that are columns up to and including those of that panel.
    fn rows(&self, earlier: usize, solved: &[usize], ranks: &[u32], panel: &mut Vec<T>) -> Result<()> {
        let width = self.blocks[earlier].width;
        panel.resize(ranks.len() * width, T::default());
        let rows = ranks.iter().zip(solved).map(|(&rank, solved)| (width + rank as usize - solved) as u32);
        let mut rest = &mut panel[..];
        for run in runs(rows) {
            let part = rest.split_off_mut(..run.len() * width).unwrap_or_default();
            self.panels.get(earlier, run.start * width, part)?;
        }
        Ok(())
    }

    /// The value that each column has in its own row.
    ///
    /// # Errors
    /// That of reading a panel.
    pub fn diagonal(&self) -> Result<Vec<T>> {
        let mut diagonal = Vec::new();
        for (index, block) in self.blocks.iter().enumerate() {
            let mut square = vec![T::default(); block.width * block.width];
            self.panels.get(index, 0, &mut square)?;
            diagonal.extend((0..block.width).map(|k| square[k * block.width + k]));
        }
        Ok(diagonal)
    }

    /// Calls `see(rank, place of the column, value)` for all rows whose columns are not ready, or that have none.
    ///
    /// # Errors
    /// That of reading a panel.
    pub fn rows_without_column(&self, see: &mut dyn FnMut(usize, usize, T)) -> Result<()> {
        let ready: usize = self.blocks.iter().map(|block| block.width).sum();
        let waits = |rank: &u32| self.parts.layout.place_of_rank(*rank as usize).is_none_or(|place| place >= ready);
        let mut values = Vec::new();
        for (index, block) in self.blocks.iter().enumerate() {
            let mut row = 0;
            for run in self.parts.layout.panel_rows(block) {
                for waiting in runs((run.start as u32..run.end as u32).filter(waits)) {
                    for rank in waiting.clone().step_by(ROWS_AT_ONCE) {
                        let count = ROWS_AT_ONCE.min(waiting.end - rank);
                        values.resize(count * block.width, T::default());
                        self.panels.get(index, (row + rank - run.start) * block.width, &mut values)?;
                        for (rank, values) in (rank..).zip(values.chunks_exact(block.width)) {
                            values.iter().enumerate().for_each(|(k, &value)| see(rank, block.first + k, value));
                        }
                    }
                }
                row += run.len();
            }
        }
        Ok(())
    }
}

/// Rows of a panel become ends of lines, by tiles whose both sides stay in the cache.
fn transpose_into<T: Number>(panel: &[T], width: usize, lines: &mut [T], length: usize, first: usize) {
    const TILE: usize = 16;
    for (tile, rows) in panel.chunks(TILE * width).enumerate() {
        for from in (0..width).step_by(TILE) {
            for k in from..width.min(from + TILE) {
                let target = &mut lines[k * length + first + tile * TILE..];
                for (value, row) in target.iter_mut().zip(rows.chunks_exact(width)) {
                    *value = row[k];
                }
            }
        }
    }
}

/// `q` of a column from its entries, the inverse scales being given.
fn quantise<T: Number>(column: &[T], column_inverse: f64, row_inverses: &[f64], out: &mut [i16]) {
    for ((q, value), inverse) in out.iter_mut().zip(column).zip(row_inverses) {
        // The conversion saturates, where rounding has crossed the bound.
        *q = (value.to_f64() * (inverse * column_inverse)).round() as i16;
    }
}
