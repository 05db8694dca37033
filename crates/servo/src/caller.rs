//! Threads that work until they are stopped, and who calls a tick: such a thread, or a device's driver.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{JoinHandle, Thread};

use palpate_core::{Error, Result};
use palpate_devices::Scheduler;

use crate::clock::{next_deadline, now_ns};
use crate::platform::sleep_until_ns;

/// A thread that works until it is stopped, or this is dropped.
pub(crate) struct Worker {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    /// Starts it under a name; its work ends once the flag that it is given is raised.
    pub(crate) fn start(name: &str, work: impl FnOnce(&AtomicBool) + Send + 'static) -> Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = stop.clone();
        let thread = std::thread::Builder::new().name(name.into()).spawn(move || work(&stopped));
        let thread = thread.map_err(|source| Error::Io { path: name.into(), source })?;
        Ok(Self { stop, thread: Some(thread) })
    }

    /// To wake it by.
    pub(crate) fn thread(&self) -> Option<&Thread> {
        self.thread.as_ref().map(JoinHandle::thread)
    }

    /// Wakes it where it is parked, and waits for its end.
    fn stop(&mut self) {
        self.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            let _ = thread.join();
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Who calls the tick, until it is stopped.
pub(crate) enum Caller {
    /// A thread of this crate: see [`tick_until`].
    Thread(Worker),
    /// A driver, from its own.
    Driver(Arc<dyn Scheduler>),
}

impl Caller {
    /// A driver, which gives each tick the time of its call, ns.
    pub(crate) fn driver(driver: Arc<dyn Scheduler>, mut tick: impl FnMut(u64) + Send + 'static) -> Result<Self> {
        let started = driver.start(Box::new(move || tick(now_ns())));
        started.map_err(|error| Error::Invalid(error.to_string()))?;
        Ok(Self::Driver(driver))
    }

    /// Has it call no more.
    pub(crate) fn stop(&mut self) {
        match self {
            Caller::Thread(worker) => worker.stop(),
            Caller::Driver(driver) => driver.stop(),
        }
    }
}

/// Ticks on a grid of deadlines, ns, that are `period`, s, apart, until stopped.
pub(crate) fn tick_until(stop: &AtomicBool, period: f64, mut tick: impl FnMut(u64)) {
    let period_ns = (1e9 * period).round() as u64;
    let mut deadline = now_ns() + period_ns;
    while !stop.load(Ordering::Relaxed) {
        sleep_until_ns(deadline);
        tick(deadline);
        // Deadlines that have passed meanwhile are counted by the tick.
        deadline = next_deadline(deadline, now_ns(), period_ns);
    }
}
