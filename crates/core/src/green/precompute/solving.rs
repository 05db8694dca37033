//! Solution of blocks by the threads of this process.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::columns::Columns;
use super::layout::Block;
use super::tasks::{Progress, in_tasks, report_progress};
use crate::Result;

/// Callbacks for a block, from any task.
#[derive(Clone, Copy)]
pub struct Work<'a> {
    /// Called before it begins; `false` stops the computation.
    pub begin: &'a (dyn Fn(usize) -> bool + Sync),
    /// Called with the bytes of its panel.
    pub put: &'a (dyn Fn(usize, &[u8]) -> Result<()> + Sync),
}

/// Solves the blocks numbered in `some`, ascending, from several tasks at a time; `done` columns are finished already.
pub fn solve(
    columns: &Columns,
    blocks: &[Block],
    (some, done): (&[usize], usize),
    work: Work<'_>,
    progress: Progress<'_>,
) -> Result<()> {
    let all = columns.parts.layout.columns;
    let done = AtomicUsize::new(done);
    let finished = |more: usize| {
        let before = done.fetch_add(more, Ordering::Relaxed);
        report_progress(progress, before + more, all)
    };
    finished(0)?;
    let next = AtomicUsize::new(0);
    in_tasks(columns.tasks, &|| {
        let mut working = columns.task_memory(columns.measurement.width);
        while let Some(&block) = some.get(next.fetch_add(1, Ordering::Relaxed)) {
            if !(work.begin)(block) {
                break;
            }
            (work.put)(block, columns.solve(&blocks[block], &mut working)?)?;
            finished(blocks[block].width)?;
        }
        Ok(())
    })
}
