//! macOS, Windows and others: what the standard library has. No priority is asked for, no memory locked, threads keep to no
//! processors, and the time that a thread computes is that which passes.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use palpate_core::memory::Ranges;

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

/// None is granted.
pub fn request_realtime_priority(_priority: u8) -> bool {
    false
}

/// The system is not asked.
pub fn allowed_cpus() -> Vec<usize> {
    Vec::new()
}

/// Threads keep to no processors.
pub fn keep_to_cpus(_cpus: &[usize]) -> bool {
    false
}

/// None is locked.
pub fn lock(_memory: Ranges) -> bool {
    false
}

/// None is locked.
pub fn lock_thread() -> bool {
    false
}
