//! The change of a force or torque vector from tick to tick.
//!
//! Let `p` be the last output, `c` the computed vector, already ramped and clamped, and `s` the largest change. Letting go
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

    /// What passes of `computed`, all of it finite: `share` (at most 1) of its magnitude, at most `max_magnitude`, changed by
    /// at most `max_change` beyond what is released.
    pub fn pass(&mut self, computed: DVec3, share: f64, max_magnitude: f64, max_change: f64) -> DVec3 {
        let magnitude = computed.length();
        let allowed = (share * magnitude).min(max_magnitude);
        // Dividing first keeps a magnitude that passes unchanged unchanged to the last bit.
        let target = if allowed == magnitude { computed } else { computed * (allowed / magnitude) };
        let squared = self.previous.length_squared();
        let kept = if squared > 0.0 { (self.previous.dot(target) / squared).clamp(0.0, 1.0) } else { 0.0 };
        let released = self.previous * kept;
        let change = target - released;
        let distance = change.length();
        self.previous = if distance <= max_change { target } else { released + change * (max_change / distance) };
        self.previous
    }
}
