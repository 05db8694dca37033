//! Work shared among tasks of the thread pool.

use std::sync::Mutex;

use crate::{Error, Result};

/// Called with `(columns done, columns in all)` from any thread; `false` stops the computation.
pub type Progress<'a> = &'a (dyn Fn(usize, usize) -> bool + Sync);

/// Runs `work` in some tasks at once, to the first error.
pub fn in_tasks(tasks: usize, work: &(dyn Fn() -> Result<()> + Sync)) -> Result<()> {
    let outcome = Mutex::new(Ok(()));
    rayon::scope(|scope| {
        for _ in 0..tasks {
            scope.spawn(|_| {
                if let (Err(error), Ok(mut first)) = (work(), outcome.lock())
                    && first.is_ok()
                {
                    *first = Err(error);
                }
            });
        }
    });
    outcome.into_inner().map_err(|_| task_failed())?
}

/// A poisoned or missing result of a task.
pub fn task_failed() -> Error {
    Error::Invalid("a task of the precomputation failed unexpectedly".into())
}

/// Reports progress, and stops the computation on request.
pub fn report_progress(progress: Progress<'_>, done: usize, columns: usize) -> Result<()> {
    if progress(done, columns) { Ok(()) } else { Err(Error::Interrupted) }
}
