//! Finished blocks of columns, until the operator is assembled from them.
//!
//! A block's panel holds, for each of its columns, the rows from the block's first column on in solving order, those
//! without a column last; the numbers of a row are contiguous. Everything earlier is the mirror
//! of an earlier panel.

use std::sync::{Arc, OnceLock};

use super::number::Number;
use super::partial::Partial;
use crate::{Error, Result};

/// Storage of the panels.
pub enum Panels<T> {
    /// In memory.
    Memory(Vec<OnceLock<Vec<T>>>),
    /// In a file beside the store to be.
    File(Arc<Partial>),
}

impl<T: Number> Panels<T> {
    /// Memory for some blocks.
    pub fn in_memory(blocks: usize) -> Self {
        Panels::Memory((0..blocks).map(|_| OnceLock::new()).collect())
    }

    /// Stores the panel of a block.
    ///
    /// # Errors
    /// The operating system's.
    pub fn put(&self, block: usize, panel: &[T]) -> Result<()> {
        match self {
            Panels::Memory(panels) => {
                let _ = panels[block].set(panel.to_vec());
                Ok(())
            }
            Panels::File(partial) => partial.put(block, bytemuck::cast_slice(panel)),
        }
    }

    /// Copies numbers of a panel, from its number `at` on.
    ///
    /// # Errors
    /// The operating system's, or a missing block.
    pub fn get(&self, block: usize, at: usize, out: &mut [T]) -> Result<()> {
        match self {
            Panels::Memory(panels) => {
                let missing = || Error::Invalid("a block of columns is missing".into());
                out.copy_from_slice(&panels[block].get().ok_or_else(missing)?[at..at + out.len()]);
                Ok(())
            }
            Panels::File(partial) => partial.get(block, at * size_of::<T>(), bytemuck::cast_slice_mut(out)),
        }
    }
}
