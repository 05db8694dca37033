//! Slew limit of a force or torque vector.
//!
//! Let `p` be the last output, `c` the vector asked for, already ramped, damped and clamped, and `s` the largest change. Letting go
//! is safe and passes at once; pushing harder, or elsewhere, does not. So the output is
//!
//! ```text
//! r   = a p,   a in [0, 1] such that |c - r| is least          what is released along p
//! out = r + t (c - r),   t = min(1, s / |c - r|)               what is limited
//! ```
//!
//! - `out = c` to the bit whenever `|c - r| <= s`, so small changes and every pure decrease (`c = a p`) pass unchanged.
//! - `|out| <= |c|`: `r` is the projection of `c` on `p` or nearer to zero, so `|r| <= |c|`, and a ball is convex.
//! - `out . c >= 0`: `r . c = a p . c` is not negative, for `a = 0` where `p . c < 0`. The output never pushes against what
//!   was computed, and a reversal starts again from zero.
//! - `|out - r| <= s` with `|r| <= |p|`: the magnitude grows by `s` at most, and so does what is across `p`.
//!
//! Limiting only the magnitude, with the direction of `c`, lets +8 N become -8 N within one tick. Limiting `|out - p|`
//! would hold on to a force after the contact is gone.

use glam::DVec3;

/// `share` (at most 1) of a finite vector, at most `max_magnitude` of it.
pub fn clamped(vector: DVec3, share: f64, max_magnitude: f64) -> DVec3 {
    let magnitude = vector.length();
    let allowed = (share * magnitude).min(max_magnitude);
    // Dividing first keeps a magnitude that passes unchanged unchanged to the last bit.
    if allowed == magnitude { vector } else { vector * (allowed / magnitude) }
}

/// A vector whose changes are limited.
#[derive(Clone, Copy, Debug, Default)]
pub struct LimitedVector {
    previous: DVec3,
}

impl LimitedVector {
    /// Back to zero.
    pub fn reset(&mut self) {
        self.previous = DVec3::ZERO;
    }

    /// What passes of `target`, finite: changed by at most `max_change` beyond what is released.
    pub fn pass(&mut self, target: DVec3, max_change: f64) -> DVec3 {
        let squared = self.previous.length_squared();
        let share = if squared > 0.0 { (self.previous.dot(target) / squared).clamp(0.0, 1.0) } else { 0.0 };
        let released = self.previous * share;
        let change = target - released;
        let distance = change.length();
        self.previous = if distance <= max_change { target } else { released + change * (max_change / distance) };
        self.previous
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAX_MAGNITUDE: f64 = 8.0;
    const MAX_CHANGE: f64 = 0.5;

    /// A deterministic stream of numbers in (-1, 1).
    fn noise(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (*seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn direction(seed: &mut u64) -> DVec3 {
        DVec3::new(noise(seed), noise(seed), noise(seed))
    }

    /// Least distance from the segment between zero and `end`, found by trying.
    fn distance_from_segment(point: DVec3, end: DVec3) -> f64 {
        (0..=2000).map(|k| point.distance(end * (f64::from(k) / 2000.0))).fold(f64::INFINITY, f64::min)
    }

    /// Forces that wander, jump, turn round, let go and vanish; the first rule that `limit` breaks.
    fn broken_rule(mut limit: impl FnMut(DVec3) -> DVec3) -> Option<&'static str> {
        let (mut seed, mut computed, mut previous) = (1, DVec3::ZERO, DVec3::ZERO);
        for tick in 0..20_000 {
            computed = match tick % 97 {
                0 => -computed,
                10 => 20.0 * direction(&mut seed),
                20 => DVec3::ZERO,
                30 | 31 => previous * (0.5 + 0.5 * noise(&mut seed)),
                50..70 => computed + 3.0 * direction(&mut seed),
                _ => computed + 0.1 * direction(&mut seed),
            };
            let out = limit(computed);
            let (size, within) = (computed.length(), 1e-12 * (1.0 + computed.length()));
            let small = computed.distance(previous) < MAX_CHANGE || tick % 97 == 30;
            let rules = [
                ("finite", out.is_finite()),
                ("never more than computed", out.length() <= size + within),
                ("never beyond the clamp", out.length() <= MAX_MAGNITUDE + within),
                ("never against what was computed", out.dot(computed) >= -within * size),
                ("small changes and decreases pass", !small || size > MAX_MAGNITUDE || out == computed),
                // 2000 points of a segment of 8 N find the distance to 1e-3 of the change at worst.
                ("the vector's change", distance_from_segment(out, previous) <= MAX_CHANGE * 1.001 + within),
            ];
            if let Some((name, _)) = rules.iter().find(|(_, holds)| !holds) {
                return Some(name);
            }
            previous = out;
        }
        None
    }

    #[test]
    fn rules_hold_for_any_force() {
        let mut vector = LimitedVector::default();
        assert_eq!(broken_rule(|computed| vector.pass(clamped(computed, 1.0, MAX_MAGNITUDE), MAX_CHANGE)), None);
    }

    #[test]
    fn a_limit_on_the_magnitude_alone_breaks_them() {
        let mut previous = 0.0;
        let scalar = |computed: DVec3| {
            let magnitude = computed.length();
            let allowed = magnitude.min(MAX_MAGNITUDE).min(previous + MAX_CHANGE);
            previous = allowed;
            if allowed == magnitude { computed } else { computed * (allowed / magnitude) }
        };
        assert_eq!(broken_rule(scalar), Some("the vector's change"));
    }

    #[test]
    fn a_limit_on_the_whole_change_breaks_them() {
        let mut previous = DVec3::ZERO;
        let held_on_to = |computed: DVec3| {
            let target = computed.clamp_length_max(MAX_MAGNITUDE);
            previous += (target - previous).clamp_length_max(MAX_CHANGE);
            if previous.distance(target) < 1e-12 {
                previous = target;
            }
            previous
        };
        assert!(broken_rule(held_on_to).is_some());
    }

    #[test]
    fn a_reversal_starts_from_zero_and_arrives_to_the_bit() {
        let mut vector = LimitedVector::default();
        let mut pass = |force: f64| vector.pass(force * DVec3::X, MAX_CHANGE).x;
        (0..16).for_each(|_| _ = pass(8.0));
        assert_eq!(pass(8.0), 8.0);
        for tick in 1..=15 {
            assert!((pass(-8.0) + f64::from(tick) * MAX_CHANGE).abs() < 1e-12);
        }
        assert_eq!([pass(-8.0), pass(-8.0)][1], -8.0);
    }

    /// A force turned by a right angle is let go along the old direction at once, and built up along the new one.
    #[test]
    fn a_turn_is_limited() {
        let mut vector = LimitedVector::default();
        (0..20).for_each(|_| _ = vector.pass(8.0 * DVec3::X, MAX_CHANGE));
        assert_eq!(vector.pass(8.0 * DVec3::Y, MAX_CHANGE), 0.5 * DVec3::Y);
    }
}
