//! Long computations on a thread, with progress reports and Ctrl-C.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use palpate_core::{Error, Result};
use pyo3::prelude::*;

use crate::errors::Answer;

/// Runs some long work on its own thread, while this one reports progress and listens for Ctrl-C. The work calls the
/// function it is given with what is done and all there is to do, and stops when that returns false.
pub(crate) fn run_interruptible<T: Send>(
    py: Python<'_>,
    total: usize,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(&(dyn Fn(usize, usize) -> bool + Sync)) -> Result<T> + Send,
) -> Answer<T> {
    run_interruptible_and(py, total, progress, &mut || Ok(()), work)
}

/// The same, and does something else whenever progress is reported, and at the end.
pub(crate) fn run_interruptible_and<T: Send>(
    py: Python<'_>,
    total: usize,
    progress: Option<&Py<PyAny>>,
    meanwhile: &mut dyn FnMut() -> PyResult<()>,
    work: impl FnOnce(&(dyn Fn(usize, usize) -> bool + Sync)) -> Result<T> + Send,
) -> Answer<T> {
    let (done, total) = (AtomicUsize::new(0), AtomicUsize::new(total));
    let stop = AtomicBool::new(false);
    let note = |finished: usize, all: usize| {
        done.fetch_max(finished, Ordering::Relaxed);
        total.store(all, Ordering::Relaxed);
        !stop.load(Ordering::Relaxed)
    };
    std::thread::scope(|scope| {
        let worker = scope.spawn(|| work(&note));
        while !worker.is_finished() {
            py.detach(|| wait_a_little(&worker));
            let report = || match progress {
                Some(callback) => {
                    callback.call1(py, (done.load(Ordering::Relaxed), total.load(Ordering::Relaxed))).map(|_| ())
                }
                None => Ok(()),
            };
            if let Err(error) = py.check_signals().and_then(|()| report()).and_then(|()| meanwhile()) {
                stop.store(true, Ordering::Relaxed);
                let _ = py.detach(|| worker.join());
                return Err(error.into());
            }
        }
        match worker.join() {
            Ok(done) => {
                let value = done?;
                meanwhile()?;
                Ok(value)
            }
            Err(_) => Err(Error::Invalid("the precomputation failed unexpectedly".into()).into()),
        }
    })
}

/// What a mutex holds, whatever became of those who had it before.
pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Does some work on a pool of so many threads.
pub(crate) fn on_threads<T: Send>(
    py: Python<'_>,
    threads: usize,
    work: impl FnOnce() -> Result<T> + Send,
) -> Answer<T> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| Error::Invalid(format!("no threads could be started: {e}")))?;
    Ok(py.detach(|| pool.install(work))?)
}

/// Up to a tenth of a second, less when the worker ends.
fn wait_a_little<T>(worker: &std::thread::ScopedJoinHandle<'_, T>) {
    for _ in 0..20 {
        if worker.is_finished() {
            return;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}
