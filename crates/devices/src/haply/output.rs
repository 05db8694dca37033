//! Choice of the force that is sent to the motors.

use glam::DVec3;

use super::handoff::ForceRequest;

/// Largest force, N. UNVERIFIED: the vendor publishes none, other programs take 10 N an axis. The scene's `max_force` lowers it.
pub const MAX_FORCE: f64 = 10.0;
/// Longest time for which the force of a slow loop stays on the motors, ns.
const LONGEST_HOLD_NS: u64 = 50_000_000;
/// After a force was withheld it comes back at this rate, N/s: the default of the safety stage, which does not know of it.
const RETURN: f64 = 500.0;

/// How long the force of a loop with this period, s, stays on the motors, ns: `least_ns`, or where a tick is late by two.
pub fn hold_ns(least_ns: u64, period: f64) -> u64 {
    ((3e9 * period) as u64).clamp(least_ns, LONGEST_HOLD_NS)
}

/// Withholds forces that are too old, and lets them come back gently.
#[derive(Clone, Copy, Debug)]
pub struct Output {
    /// Largest force now, N; infinite when nothing has been withheld lately.
    allowance: f64,
    /// When a force was last chosen, ns.
    chosen_ns: u64,
}

impl Default for Output {
    fn default() -> Self {
        Self { allowance: f64::INFINITY, chosen_ns: 0 }
    }
}

impl Output {
    /// The force to put out at `now_ns`: what the loop asked for if it did so lately, knowing of all `faults`, and with
    /// measurements that go on; zero otherwise.
    pub fn choose(&mut self, request: &ForceRequest, faults: u64, measured: bool, now_ns: u64) -> DVec3 {
        let elapsed = 1e-9 * now_ns.saturating_sub(self.chosen_ns) as f64;
        self.chosen_ns = now_ns;
        let is_late = now_ns.saturating_sub(request.written_ns) > request.hold_ns;
        if request.force == DVec3::ZERO {
            // The next one comes in as the loop wants it.
            self.allowance = f64::INFINITY;
            return DVec3::ZERO;
        }
        if !measured || request.known_fault != Some(faults) || is_late || !request.force.is_finite() {
            self.withhold();
            return DVec3::ZERO;
        }
        self.allowance += RETURN * elapsed;
        if self.allowance > MAX_FORCE {
            self.allowance = f64::INFINITY;
        }
        request.force.clamp_length_max(MAX_FORCE.min(self.allowance))
    }

    /// A force is taken off: the next one comes in from zero.
    pub fn withhold(&mut self) {
        self.allowance = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn request(force: f64, written_ms: u64) -> ForceRequest {
        ForceRequest {
            force: DVec3::Z * force,
            known_fault: Some(0),
            written_ns: written_ms * MS,
            hold_ns: hold_ns(5 * MS, 1e-3),
        }
    }

    #[test]
    fn a_force_stays_for_a_few_milliseconds() {
        let mut output = Output::default();
        assert_eq!(output.choose(&request(3.0, 100), 0, true, 105 * MS).z, 3.0);
        assert_eq!(output.choose(&request(3.0, 100), 0, true, 105 * MS + 1).z, 0.0);
        let hold_of = |period| hold_ns(5 * MS, period);
        assert_eq!((hold_of(1e-3), hold_of(1e-2), hold_of(1.0)), (5 * MS, 30 * MS, 50 * MS));
        assert_eq!(hold_of(f64::NAN), 5 * MS);
    }

    #[test]
    fn what_knew_not_of_a_fault_is_withheld() {
        let mut output = Output::default();
        assert_eq!(output.choose(&request(3.0, 0), 1, true, 0), DVec3::ZERO);
        assert_eq!(output.choose(&request(3.0, 0), 0, false, 0), DVec3::ZERO);
        let never_read = ForceRequest { known_fault: None, ..request(3.0, 0) };
        assert_eq!(output.choose(&never_read, 0, true, 0), DVec3::ZERO);
    }

    #[test]
    fn a_force_that_was_withheld_comes_back_by_half_a_newton_a_millisecond() {
        let mut output = Output::default();
        output.choose(&request(8.0, 0), 0, false, 0);
        for ms in 1..=15 {
            let out = output.choose(&request(8.0, ms), 0, true, ms * MS).z;
            assert!((out - 0.5 * ms as f64).abs() < 1e-9, "{ms} {out}");
        }
        assert_eq!(output.choose(&request(8.0, 16), 0, true, 16 * MS).z, 8.0);
        assert_eq!(output.choose(&request(80.0, 30), 0, true, 30 * MS).z, MAX_FORCE);
        // A loop that asked for none knows of its next one.
        output.choose(&request(0.0, 40), 0, false, 40 * MS);
        assert_eq!(output.choose(&request(8.0, 41), 0, true, 41 * MS).z, 8.0);
    }
}
