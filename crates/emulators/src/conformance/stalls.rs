//! Detection of stalls of the machine, which excuse missed ticks.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use core_affinity::CoreId;

/// What the thread asks for.
const SLEEP: Duration = Duration::from_millis(1);

/// What it must not get more than: the shortest time that a driver gives its own threads is 5 ms.
const LONGEST: Duration = Duration::from_millis(4);

/// A thread on each core that sleeps and measures how long it did: one core may stall while another is idle.
pub struct StallWatch {
    ended: Arc<AtomicBool>,
    threads: Vec<JoinHandle<bool>>,
}

impl StallWatch {
    pub fn begin() -> Self {
        let ended = Arc::new(AtomicBool::new(false));
        let cores = core_affinity::get_core_ids().unwrap_or_default();
        let cores = cores.into_iter().map(Some).chain(std::iter::once(None));
        let watch = |core: Option<CoreId>| {
            let ended = Arc::clone(&ended);
            std::thread::spawn(move || sleeps_too_long(core, &ended))
        };
        let threads = cores.map(watch).collect();
        Self { ended, threads }
    }

    /// Whether one of the threads has slept too long.
    pub fn end(self) -> bool {
        self.ended.store(true, Ordering::Relaxed);
        self.threads.into_iter().map(|thread| thread.join().unwrap_or(true)).fold(false, |any, stalled| any | stalled)
    }
}

/// Sleeps on a core, or on any, until the watch has ended; returns whether it was ever too long.
fn sleeps_too_long(core: Option<CoreId>, ended: &AtomicBool) -> bool {
    core.map(core_affinity::set_for_current);
    let mut stalled = false;
    while !ended.load(Ordering::Relaxed) {
        let began = Instant::now();
        std::thread::sleep(SLEEP);
        stalled |= began.elapsed() > LONGEST;
    }
    stalled
}
