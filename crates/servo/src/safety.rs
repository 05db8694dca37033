//! The one stage between a computed force and a device. It is always on.
//!
//! In order: a force that is not finite latches a fault; a latched fault is zero force until an explicit reset; the
//! magnitude is ramped in after the start, clamped, and its increases held to a slew limit. The result never exceeds the
//! computed magnitude, and its direction is always that of the computed force. Decreases pass at once.

use glam::DVec3;

/// Limits of one device.
#[derive(Clone, Copy, Debug)]
pub struct SafetyLimits {
    /// Largest force, N.
    pub max_force: f64,
    /// Fastest increase of the magnitude, N/s.
    pub max_slew: f64,
    /// Time over which the force is let in after the start, s.
    pub ramp: f64,
}

impl Default for SafetyLimits {
    /// A desktop device: 8 N; from zero to full in 16 ms; a quarter of a second to come in.
    fn default() -> Self {
        Self { max_force: 8.0, max_slew: 500.0, ramp: 0.25 }
    }
}

/// Why a device gets no force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// A computed force was not finite.
    ForceNotFinite,
    /// A device reported a position that is not finite.
    PositionNotFinite,
}

impl Fault {
    /// One line for people.
    pub fn message(self) -> &'static str {
        match self {
            Fault::ForceNotFinite => "a computed force was not finite; forces are off until a reset",
            Fault::PositionNotFinite => {
                "the device reported a position that is not finite; forces are off until a reset"
            }
        }
    }
}

/// The stage's memory.
#[derive(Clone, Debug)]
pub struct Safety {
    limits: SafetyLimits,
    age: f64,
    previous: f64,
    fault: Option<Fault>,
}

impl Safety {
    /// A stage at the start of its ramp.
    pub fn new(limits: SafetyLimits) -> Self {
        Self { limits, age: 0.0, previous: 0.0, fault: None }
    }

    /// The latched fault, if any.
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// Latches a fault; the first one stays.
    pub fn latch(&mut self, fault: Fault) {
        self.fault.get_or_insert(fault);
    }

    /// Clears the fault and ramps in anew.
    pub fn reset(&mut self) {
        (self.age, self.previous, self.fault) = (0.0, 0.0, None);
    }

    /// The force to put out for `computed` (N), `period` seconds after the last call.
    pub fn apply(&mut self, computed: DVec3, period: f64) -> DVec3 {
        self.age += period;
        let magnitude = computed.length();
        if !magnitude.is_finite() {
            self.latch(Fault::ForceNotFinite);
        }
        if self.fault.is_some() || magnitude == 0.0 {
            self.previous = 0.0;
            return DVec3::ZERO;
        }
        let ramp = if self.age < self.limits.ramp { self.age / self.limits.ramp } else { 1.0 };
        let allowed = (ramp * magnitude).min(self.limits.max_force).min(self.previous + self.limits.max_slew * period);
        self.previous = allowed;
        // Dividing first keeps a magnitude that passes unchanged unchanged to the last bit.
        if allowed == magnitude { computed } else { computed * (allowed / magnitude) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: f64 = 1e-3;

    fn settled(limits: SafetyLimits) -> Safety {
        let mut safety = Safety::new(limits);
        for _ in 0..1000 {
            safety.apply(DVec3::ZERO, PERIOD);
        }
        safety
    }

    /// A deterministic stream of numbers in (-1, 1).
    fn noise(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (*seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    #[test]
    fn never_more_than_computed_never_beyond_the_clamp_never_faster_up_than_the_slew() {
        let limits = SafetyLimits::default();
        let (mut safety, mut seed, mut previous) = (Safety::new(limits), 1, 0.0);
        for _ in 0..20_000 {
            let computed =
                20.0 * noise(&mut seed).powi(3) * DVec3::new(noise(&mut seed), noise(&mut seed), noise(&mut seed));
            let out = safety.apply(computed, PERIOD);
            let tolerance = 1e-12 * computed.length();
            assert!(out.length() <= computed.length() + tolerance);
            assert!(out.length() <= limits.max_force + 1e-12);
            assert!(out.length() <= previous + limits.max_slew * PERIOD + 1e-12);
            assert!(out.cross(computed).length() <= 1e-12 * computed.length_squared());
            assert!(out.dot(computed) >= 0.0);
            previous = out.length();
        }
    }

    #[test]
    fn decreases_and_small_forces_pass_unchanged() {
        let mut safety = settled(SafetyLimits::default());
        let force = DVec3::new(0.1, -0.2, 0.3);
        for scale in [1.0, 0.5, 0.25] {
            assert_eq!(safety.apply(scale * force, PERIOD), scale * force);
        }
    }

    #[test]
    fn ramps_in_at_the_start() {
        let mut safety = Safety::new(SafetyLimits { max_slew: 1e9, ..SafetyLimits::default() });
        let out: Vec<f64> = (0..300).map(|_| safety.apply(DVec3::X, PERIOD).x).collect();
        assert!((out[124] - 0.5).abs() < 1e-9);
        assert_eq!(out[299], 1.0);
    }

    #[test]
    fn a_force_that_is_not_finite_latches_until_reset() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e200] {
            let mut safety = settled(SafetyLimits::default());
            assert_eq!(safety.apply(DVec3::new(0.0, bad, 0.0), PERIOD), DVec3::ZERO);
            assert_eq!(safety.apply(DVec3::X, PERIOD), DVec3::ZERO);
            assert_eq!(safety.fault(), Some(Fault::ForceNotFinite));
            safety.reset();
            assert!(safety.apply(DVec3::X, PERIOD).x > 0.0);
        }
    }
}
