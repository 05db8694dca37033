//! Checks of a device's reading before anything is computed from it.

use glam::DVec3;
use palpate_devices::Reading;

use super::{FaultReason, SafetyLimits};

/// Memory of the latest measurement; none while the tool is out of the scene.
#[derive(Clone, Debug, Default)]
pub struct ReadingCheck {
    latest: Option<Measurement>,
}

#[derive(Clone, Copy, Debug)]
struct Measurement {
    /// By the device's clock, ns.
    timestamp_ns: u64,
    /// Time of the tick that first saw it, ns.
    seen_ns: u64,
    /// Tip position, m.
    position: DVec3,
}

impl ReadingCheck {
    /// Checks a reading against the one before. A tool that has just come into the scene may be anywhere.
    ///
    /// # Errors
    /// Why it cannot be believed.
    pub fn check(
        &mut self,
        reading: &Reading,
        now_ns: u64,
        period: f64,
        limits: &SafetyLimits,
    ) -> Result<(), FaultReason> {
        if !reading.active {
            self.latest = None;
            return Ok(());
        }
        if !(reading.pose.is_finite() && reading.twist.linear.is_finite() && reading.twist.angular.is_finite()) {
            return Err(FaultReason::ReadingNotFinite);
        }
        let fresh =
            Measurement { timestamp_ns: reading.timestamp_ns, seen_ns: now_ns, position: reading.pose.position };
        let Some(before) = self.latest else {
            self.latest = Some(fresh);
            return Ok(());
        };
        // Measurements that a bus delivers in bursts lie closer than they were made: a tick apart at least.
        let between_ns = fresh.timestamp_ns.saturating_sub(before.timestamp_ns);
        let elapsed = (1e-9 * between_ns as f64).max(period);
        if fresh.position.distance(before.position) > limits.max_speed * elapsed {
            return Err(FaultReason::JumpingInput);
        }
        if between_ns > 0 {
            self.latest = Some(fresh);
            return Ok(());
        }
        let age = 1e-9 * now_ns.saturating_sub(before.seen_ns) as f64;
        if age <= limits.max_reading_age { Ok(()) } else { Err(FaultReason::StaleInput) }
    }
}
