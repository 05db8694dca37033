//! Detection of stalls of the machine, which excuse missed ticks.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// What the thread asks for.
const SLEEP: Duration = Duration::from_millis(1);

/// What it must not get more than: the shortest time that a driver gives its own threads is 5 ms.
const LONGEST: Duration = Duration::from_millis(4);

/// A thread that sleeps and looks how long it did.
pub struct StallWatch {
    ended: Arc<AtomicBool>,
    thread: JoinHandle<bool>,
}

impl StallWatch {
    pub fn begin() -> Self {
        let ended = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&ended);
        let thread = std::thread::spawn(move || {
            let mut stalled = false;
            while !seen.load(Ordering::Relaxed) {
                let began = Instant::now();
                std::thread::sleep(SLEEP);
                stalled |= began.elapsed() > LONGEST;
            }
            stalled
        });
        Self { ended, thread }
    }

    /// Whether it has slept too long once.
    pub fn end(self) -> bool {
        self.ended.store(true, Ordering::Relaxed);
        self.thread.join().unwrap_or(true)
    }
}
