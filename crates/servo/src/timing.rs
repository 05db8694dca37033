//! Computing times of ticks, and missed deadlines.
//!
//! A tick that is due at `D`, begins at `B` and ends at `E` misses the deadlines `D + k P <= E`, `floor((E - D) / P)` of
//! them. It would have missed `floor((E - B) / P)` had it begun on time: those are by computing, the rest by waking up late.

use crate::log::Status;
use crate::safety::{FaultReason, SafetyLimits};
use crate::statistics::Histogram;

/// Ticks between two summaries of the statistics.
const SUMMARY_TICKS: u64 = 64;

/// Reads a clock in ns. An offline run has one that stands still: its ticks take no time.
pub type Clock = fn() -> u64;

/// Times of ticks so far.
pub struct Timing {
    clock: Clock,
    due_ns: u64,
    begun_ns: u64,
    compute: Histogram,
    wakeup: Histogram,
    /// Ticks in a row, up to the last, that computed past a deadline.
    overruns: u32,
}

impl Timing {
    /// Of no ticks.
    pub fn new(clock: Clock) -> Self {
        let (compute, wakeup) = (Histogram::default(), Histogram::default());
        Self { clock, due_ns: 0, begun_ns: 0, compute, wakeup, overruns: 0 }
    }

    /// A tick that is due at `due_ns` begins.
    pub fn begin(&mut self, due_ns: u64) {
        (self.due_ns, self.begun_ns) = (due_ns, (self.clock)());
    }

    /// Delay of the tick that began last, ns.
    pub fn delay_ns(&self) -> u64 {
        self.begun_ns.saturating_sub(self.due_ns)
    }

    /// Takes up the delay of the tick that began, and every so often sums up.
    pub fn account(&mut self, status: &mut Status) {
        self.wakeup.record(self.delay_ns());
        status.ticks += 1;
        // One at a time, for the costliest tick counts.
        match status.ticks % SUMMARY_TICKS {
            1 => status.wakeup = self.wakeup.summary(),
            2 => status.compute = self.compute.summary(),
            _ => {}
        }
    }

    /// The tick has done all it does; the time it took, ns, and an overrun if it is one.
    pub fn end(&mut self, period: f64, limits: &SafetyLimits, status: &mut Status) -> (u64, Option<FaultReason>) {
        let period_ns = ((1e9 * period).round() as u64).max(1);
        let took_ns = (self.clock)().saturating_sub(self.begun_ns);
        self.compute.record(took_ns);
        let by_computing = took_ns / period_ns;
        status.missed_computing += by_computing;
        status.missed_waking += (self.delay_ns() + took_ns) / period_ns - by_computing;
        self.overruns = if by_computing > 0 { self.overruns.saturating_add(1) } else { 0 };
        let overrun = took_ns as f64 > 1e9 * limits.max_compute || self.overruns >= limits.max_overruns;
        (took_ns, overrun.then_some(FaultReason::Overrun))
    }

    /// Forgets overruns.
    pub fn reset(&mut self) {
        self.overruns = 0;
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    const PERIOD: f64 = 1e-3;

    thread_local! {
        static NOW: Cell<u64> = const { Cell::new(0) };
    }

    fn now() -> u64 {
        NOW.with(Cell::get)
    }

    fn timing() -> (Timing, Status) {
        NOW.with(|now| now.set(0));
        (Timing::new(now), Status::default())
    }

    /// A tick that is due now, begins `late_us` later and takes `took_us`.
    fn tick(timing: &mut Timing, status: &mut Status, late_us: u64, took_us: u64) -> Option<FaultReason> {
        limited_tick(timing, status, &SafetyLimits::default(), (late_us, took_us))
    }

    fn limited_tick(
        timing: &mut Timing,
        status: &mut Status,
        limits: &SafetyLimits,
        (late_us, took_us): (u64, u64),
    ) -> Option<FaultReason> {
        let due_ns = now();
        NOW.with(|now| now.set(due_ns + 1000 * late_us));
        timing.begin(due_ns);
        NOW.with(|now| now.set(now.get() + 1000 * took_us));
        timing.account(status);
        let (took_ns, overrun) = timing.end(PERIOD, limits, status);
        assert_eq!(took_ns, 1000 * took_us);
        overrun
    }

    #[test]
    fn deadlines_are_missed_by_computing_or_by_waking() {
        for (late, took, by_computing, by_waking) in
            [(0, 999, 0, 0), (0, 1000, 1, 0), (0, 2500, 2, 0), (2500, 300, 0, 2), (1500, 1600, 1, 2), (600, 600, 0, 1)]
        {
            let (mut timing, mut status) = timing();
            tick(&mut timing, &mut status, late, took);
            assert_eq!((status.missed_computing, status.missed_waking), (by_computing, by_waking), "{late} {took}");
        }
    }

    #[test]
    fn one_long_tick_or_many_late_ones_are_an_overrun() {
        let (mut timing, mut status) = timing();
        assert_eq!(tick(&mut timing, &mut status, 500_000, 100_000), None, "waking up late is none");
        assert_eq!(tick(&mut timing, &mut status, 0, 100_001), Some(FaultReason::Overrun));
        timing.reset();
        for _ in 0..3 {
            (0..19).for_each(|_| assert_eq!(tick(&mut timing, &mut status, 0, 1100), None));
            assert_eq!(tick(&mut timing, &mut status, 0, 900), None, "one in time forgives");
        }
        (0..19).for_each(|_| assert_eq!(tick(&mut timing, &mut status, 0, 1100), None));
        assert_eq!(tick(&mut timing, &mut status, 0, 1100), Some(FaultReason::Overrun));
    }

    #[test]
    fn ticks_of_any_time_are_counted_as_missed_alone() {
        let (mut timing, mut status) = timing();
        let limits = SafetyLimits::default().of_any_tick_time();
        limits.check().unwrap();
        (0..30).for_each(|_| assert_eq!(limited_tick(&mut timing, &mut status, &limits, (0, 200_000)), None));
        assert_eq!(status.missed_computing, 30 * 200);
    }
}
