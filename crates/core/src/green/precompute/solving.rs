//! Blocks solved by the threads of this process, whoever takes their panels.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::block::Block;
use super::columns::Columns;
use super::tasks::{Progress, go_on, in_tasks};
use crate::Result;

/// What is done with a block, from any task.
#[derive(Clone, Copy)]
pub struct Work<'a> {
    /// Asked before it is begun; `false` stops there.
    pub begin: &'a (dyn Fn(usize) -> bool + Sync),
    /// Given the bytes of its panel.
    pub put: &'a (dyn Fn(usize, &[u8]) -> Result<()> + Sync),
}

/// Solves the blocks numbered in `some`, ascending, from several tasks at a time; `done` columns are there already.
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
        go_on(progress, before + more, all)
    };
    finished(0)?;
    let next = AtomicUsize::new(0);
    in_tasks(columns.tasks, &|| {
        let mut working = columns.working(columns.measurement.width);
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
