//! How long ticks take, and which deadlines pass meanwhile.
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
        if status.ticks % SUMMARY_TICKS == 1 {
            (status.wakeup, status.compute) = (self.wakeup.summary(), self.compute.summary());
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
        self.overruns = if by_computing > 0 { self.overruns + 1 } else { 0 };
        let overrun = took_ns as f64 > 1e9 * limits.max_compute || self.overruns >= limits.max_overruns;
        (took_ns, overrun.then_some(FaultReason::Overrun))
    }

    /// Forgets overruns.
    pub fn reset(&mut self) {
        self.overruns = 0;
    }
}
