//! macOS, Windows and others: the clock of the standard library. The time that a thread computes is that which passes.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// The end of a wait is spun away: timers of these systems wake late by up to so much.
const SPIN: Duration = Duration::from_micros(1500);

fn start() -> Instant {
    static START: OnceLock<Instant> = OnceLock::new();
    *START.get_or_init(Instant::now)
}

/// Nanoseconds of the monotonic clock.
pub fn now_ns() -> u64 {
    // Not zero: a deadline before the first reading is none.
    start().elapsed().as_nanos() as u64 + 1
}

/// Nanoseconds that have passed.
pub fn computed_ns() -> u64 {
    now_ns()
}

/// Waits until an absolute time of the monotonic clock.
pub fn sleep_until_ns(deadline: u64) {
    let left = Duration::from_nanos(deadline.saturating_sub(now_ns()));
    std::thread::sleep(left.saturating_sub(SPIN));
    while now_ns() < deadline {
        std::hint::spin_loop();
    }
}
