//! Work shared among tasks of the thread pool, and what is reported of it.

use std::sync::Mutex;

use crate::{Error, Result};

/// Called with `(columns done, columns in all)` from any thread; `false` stops the computation.
pub type Progress<'a> = &'a (dyn Fn(usize, usize) -> bool + Sync);

/// Phase of a precomputation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Stiffness from the elements.
    Assembly,
    /// Fill-reducing order, structure of the factor, and its needed part.
    Ordering,
    /// The factor, and the operators of the sweeps from it.
    Factor,
    /// Accuracy of the answers.
    Accuracy,
    /// Columns, block by block.
    Columns,
    /// The store from the blocks.
    Store,
}

impl Phase {
    /// Name for users.
    pub fn name(self) -> &'static str {
        match self {
            Phase::Assembly => "assembling",
            Phase::Ordering => "ordering",
            Phase::Factor => "factorising",
            Phase::Accuracy => "measuring accuracy",
            Phase::Columns => "columns",
            Phase::Store => "writing",
        }
    }
}

/// Called as each phase begins.
pub type PhaseCallback<'a> = &'a (dyn Fn(Phase) + Sync);

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
