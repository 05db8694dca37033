//! Assembly of finished panels: the bounds of the rows, and the stored numbers of every column.

use super::arrangement::Arrangement;
use super::block::Block;
use super::columns::AssembledProblem;
use super::mirror::Mirror;
use super::number::Number;
use super::panels::Panels;
use super::scales::{magnitudes, quantise};
use crate::Result;
use crate::green::entries::scales;
use crate::green::precision::Precision;

/// The finished panels of a store.
pub struct FinishedPanels<'a, T> {
    /// Matrix, rows and columns.
    pub parts: &'a AssembledProblem,
    /// Their order in the store.
    pub arrangement: &'a Arrangement,
    /// Their columns.
    pub blocks: &'a [Block],
    /// The panels.
    pub panels: &'a Panels<T>,
    /// Blocks put together at a time.
    pub tasks: usize,
}

impl<T: Number> FinishedPanels<'_, T> {
    fn mirror(&self) -> Mirror<'_, T> {
        Mirror { layout: &self.parts.layout, arrangement: self.arrangement, blocks: self.blocks, panels: self.panels }
    }

    /// Bounds of the stored rows.
    ///
    /// # Errors
    /// That of reading a panel.
    pub fn magnitudes(&self) -> Result<Vec<f64>> {
        magnitudes(&self.mirror(), &self.parts.stiffness)
    }

    /// Calls `put(column of the store, bytes)` for every column, from several tasks at a time.
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
        self.mirror().columns(self.tasks, &|place, numbers| {
            let column = self.arrangement.column(&self.parts.layout, place);
            if precision != Precision::F16 {
                return put(column, bytemuck::cast_slice(numbers));
            }
            let mut quantised = vec![0i16; numbers.len()];
            quantise(numbers, inverse[column], &inverse, &mut quantised);
            put(column, bytemuck::cast_slice(&quantised))
        })
    }
}
