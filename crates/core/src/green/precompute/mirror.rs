//! The whole operator from its panels, symmetric to the bit: `Psi_NN` and `Psi_DD` symmetric, `Psi_DN = -Psi_ND^T`. An
//! operator that is not lets a hand draw energy from a static spring.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::block::Block;
use super::layout::Layout;
use super::number::Number;
use super::panels::Panels;
use super::tasks::in_tasks;
use crate::Result;

/// The panels with what is known of their places.
pub struct Mirror<'a, T> {
    /// Rows and columns.
    pub layout: &'a Layout,
    /// Blocks of columns.
    pub blocks: &'a [Block],
    /// Their panels.
    pub panels: &'a Panels<T>,
}

/// Numbers that one task of [`Mirror::columns`] needs.
pub fn numbers(layout: &Layout, width: usize) -> usize {
    (2 * width + 1) * layout.rows()
}

impl<T: Number> Mirror<'_, T> {
    /// Hands every column to `take`, as its place in the order and its rows in the order of the store, from up
    /// to `tasks` tasks at a time.
    ///
    /// # Errors
    /// That of reading a panel, or of `take`.
    pub fn columns(&self, tasks: usize, take: &(dyn Fn(usize, &[T]) -> Result<()> + Sync)) -> Result<()> {
        let next = AtomicUsize::new(0);
        in_tasks(tasks, &|| {
            let (mut lines, mut panel, mut column) = (Vec::new(), Vec::new(), vec![T::default(); self.layout.rows()]);
            loop {
                let block = next.fetch_add(1, Ordering::Relaxed);
                if block >= self.blocks.len() {
                    return Ok(());
                }
                self.lines(block, &mut lines, &mut panel)?;
                for (k, line) in lines.chunks_exact(self.layout.rows()).enumerate() {
                    for (value, &place) in column.iter_mut().zip(&self.layout.place_of_stored) {
                        *value = line[place as usize];
                    }
                    take(self.blocks[block].first + k, &column)?;
                }
            }
        })
    }

    /// The columns of a block with all their rows in solving order.
    fn lines(&self, index: usize, lines: &mut Vec<T>, panel: &mut Vec<T>) -> Result<()> {
        let (block, length) = (&self.blocks[index], self.layout.rows());
        lines.resize(block.width * length, T::default());
        for (earlier_index, earlier) in self.blocks[..index].iter().enumerate() {
            // Rows of this block in the earlier one's panel are columns of this block: contiguous pieces of lines.
            panel.resize(block.width * earlier.width, T::default());
            self.panels.get(earlier_index, (block.first - earlier.first) * earlier.width, panel)?;
            let other_kind = (earlier.first < self.layout.supported) != (block.first < self.layout.supported);
            for (line, piece) in lines.chunks_exact_mut(length).zip(panel.chunks_exact(earlier.width)) {
                let target = &mut line[earlier.first..earlier.first + earlier.width];
                if other_kind {
                    target.iter_mut().zip(piece).for_each(|(value, &solved)| *value = -solved);
                } else {
                    target.copy_from_slice(piece);
                }
            }
        }
        panel.resize(block.len(), T::default());
        self.panels.get(index, 0, panel)?;
        transpose_into(panel, block.width, lines, length, block.first);
        for k in 0..block.width {
            for earlier in 0..k {
                lines[k * length + block.first + earlier] = panel[k * block.width + earlier];
            }
        }
        Ok(())
    }

    /// The value that each column has in its own row.
    ///
    /// # Errors
    /// That of reading a panel.
    pub fn diagonal(&self) -> Result<Vec<T>> {
        let mut diagonal = Vec::with_capacity(self.layout.columns);
        for (index, block) in self.blocks.iter().enumerate() {
            let mut square = vec![T::default(); block.width * block.width];
            self.panels.get(index, 0, &mut square)?;
            diagonal.extend((0..block.width).map(|k| square[k * block.width + k]));
        }
        Ok(diagonal)
    }

    /// Calls `see(row, column, value)` for all rows that have no column, row and column as places in the order.
    ///
    /// # Errors
    /// That of reading a panel.
    pub fn rows_without_column(&self, see: &mut dyn FnMut(usize, usize, T)) -> Result<()> {
        let mut row = Vec::new();
        for (index, block) in self.blocks.iter().enumerate() {
            row.resize(block.width, T::default());
            for place in self.layout.columns..self.layout.rows() {
                self.panels.get(index, (place - block.first) * block.width, &mut row)?;
                row.iter().enumerate().for_each(|(k, &value)| see(place, block.first + k, value));
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
