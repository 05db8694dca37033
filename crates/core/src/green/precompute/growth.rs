//! Precomputation in stages: a region is computed first and can be touched while the rest is computed.
//!
//! At the end of each stage the nodes that are ready are written as a store of their own and renamed over the one before: a reader
//! of that path always finds a complete store. Nodes requested meanwhile become the next stage, and the others are put into new
//! stages around them; finished blocks stay.

use std::sync::{Arc, Mutex, PoisonError};

use super::column_store::ColumnStore;
use super::columns::Columns;
use super::problem::Problem;
use super::solving::{Work, solve};
use super::stages::stages;
use super::tasks::Progress;
use crate::{Error, Result};

/// Order in which a store grows, and callbacks.
pub struct Growth<'a> {
    /// Nodes that are computed first, ranks among the surface nodes; empty for all at once.
    pub first: &'a [u32],
    /// Called between blocks, from any task; returns nodes that are to be ready next.
    pub next: &'a (dyn Fn() -> Option<Vec<u32>> + Sync),
    /// Called with the number of touchable nodes of each written store.
    pub ready: &'a (dyn Fn(usize) + Sync),
}

impl Growth<'_> {
    /// Solves the missing blocks, and writes the store of every stage but the last.
    ///
    /// # Errors
    /// An interruption, or the operating system's.
    pub fn grow(
        &self,
        problem: &Problem,
        columns: &mut Columns,
        store: &mut ColumnStore,
        progress: Progress<'_>,
    ) -> Result<()> {
        let mut written = 0;
        while let Some(stage) = store.first_unfinished() {
            // Columns that an interrupted computation has finished.
            written = self.write(written, stage.first, columns, store, progress)?;
            let painted = self.solve(&stage.blocks, columns, store, progress)?;
            if painted.is_empty() {
                written = self.write(written, stage.end, columns, store, progress)?;
                continue;
            }
            let parts = &columns.parts;
            let prefix = store.begun();
            let waiting = parts.layout.waiting_nodes(prefix);
            let ready = problem.touch.len() - waiting.len();
            let stages = stages(&problem.surface_positions(), &waiting, &painted, ready);
            store.arrange(Arc::new(parts.with_stages(prefix, &stages)))?;
            columns.arrange(Arc::clone(&store.parts));
        }
        Ok(())
    }

    /// Writes the store of the first `end` columns if they are more than those written, not all, and whole nodes. Returns the
    /// number of written columns.
    fn write(
        &self,
        written: usize,
        end: usize,
        columns: &Columns,
        store: &mut ColumnStore,
        progress: Progress<'_>,
    ) -> Result<usize> {
        let layout = &columns.parts.layout;
        if end <= written || end == layout.columns || !layout.covers_whole_nodes(end) {
            return Ok(written);
        }
        store.write(end, columns.tasks, progress)?;
        (self.ready)(end / 3);
        Ok(end)
    }

    /// Solves blocks of a stage. Stops when nodes of another stage are requested, and returns them.
    fn solve(
        &self,
        blocks: &[usize],
        columns: &Columns,
        store: &ColumnStore,
        progress: Progress<'_>,
    ) -> Result<Vec<u32>> {
        let (layout, begun) = (&columns.parts.layout, store.leading_blocks());
        let painted = Mutex::new(Vec::new());
        let lock = || painted.lock().unwrap_or_else(PoisonError::into_inner);
        let begin = |block: usize| {
            if let Some(nodes) = (self.next)() {
                let waiting = layout.waiting_nodes(store.begun());
                lock().extend(nodes.into_iter().filter(|node| waiting.binary_search(node).is_ok()));
            }
            // Blocks before one that is finished stay where they are.
            lock().is_empty() || block < begun
        };
        solve(
            columns,
            &store.blocks,
            (blocks, store.done()),
            Work { begin: &begin, put: &|k, p| store.put(k, p) },
            progress,
        )?;
        let painted = painted.into_inner().map_err(|_| Error::Interrupted)?;
        Ok(painted)
    }
}
