//! The monotonic clock, and deadlines on it.

use crate::platform;

/// Nanoseconds of the monotonic clock: what [`crate::ForceLoop::tick`] is told.
pub fn now_ns() -> u64 {
    platform::now_ns()
}

/// The next deadline on the grid of `period` after `deadline` that is not yet past.
pub fn next_deadline(deadline: u64, now: u64, period: u64) -> u64 {
    deadline + period * (now.saturating_sub(deadline) / period + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::platform::sleep_until_ns;

    #[test]
    fn deadlines_stay_on_the_grid() {
        for (now, next) in [(900, 1100), (1000, 1100), (1099, 1100), (1100, 1200), (1350, 1400)] {
            assert_eq!(next_deadline(1000, now, 100), next);
        }
    }

    #[test]
    fn sleeping_reaches_the_deadline() {
        let deadline = now_ns() + 2_000_000;
        sleep_until_ns(deadline);
        assert!(now_ns() >= deadline);
    }
}
