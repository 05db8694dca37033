//! Vectors over modes in groups of eight, so that one instruction takes several modes.
//!
//! Sums run in eight partial sums in a fixed order: the same bits on every processor, whatever its vector width.
//! A kernel is a struct with `call` inlined into a function compiled for the processor's vectors (`pulp`); a closure in
//! its place may be left outside and run on the narrowest ones.

use crate::math::sum_lanes;

/// Modes a group.
pub const LANES: usize = 8;

/// A mode whose displacement (m sqrt(kg)) or velocity is smaller has come to rest.
///
/// A decaying motion would end in subnormal numbers, with which an operation takes a hundred times as long on many
/// processors. The squares of larger numbers, which energies are made of, are normal too, times any stiffness or damping.
const AT_REST: f64 = 1e-140;

/// Eight modes; a cache line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(64))]
pub struct Lanes(pub [f64; LANES]);

impl Lanes {
    /// `self + a b`, each lane for itself.
    #[inline(always)]
    pub fn plus(mut self, a: &Lanes, b: &Lanes) -> Self {
        for l in 0..LANES {
            self.0[l] += a.0[l] * b.0[l];
        }
        self
    }

    /// Zero in place of what has come to rest.
    #[inline(always)]
    pub fn settled(mut self) -> Self {
        for l in 0..LANES {
            self.0[l] = if self.0[l].abs() < AT_REST { 0.0 } else { self.0[l] };
        }
        self
    }

    /// `self + s a`.
    #[inline(always)]
    pub fn plus_scaled(mut self, s: f64, a: &Lanes) -> Self {
        for l in 0..LANES {
            self.0[l] += s * a.0[l];
        }
        self
    }

    /// `a b`, each lane for itself.
    #[inline(always)]
    pub fn times(mut self, b: &Lanes) -> Self {
        for l in 0..LANES {
            self.0[l] *= b.0[l];
        }
        self
    }

    /// Sum of the lanes.
    #[inline(always)]
    pub fn sum(self) -> f64 {
        sum_lanes(self.0)
    }
}

/// `a . b` of as many groups, in two chains of sums that hide the latency of addition.
#[inline(always)]
pub fn dot(a: &[Lanes], b: &[Lanes]) -> f64 {
    let mut sums = [Lanes::default(); 2];
    for (g, (a, b)) in a.iter().zip(b).enumerate() {
        sums[g % 2] = sums[g % 2].plus(a, b);
    }
    sums[0].sum() + sums[1].sum()
}

/// `x` in groups, filled up with zeros.
pub fn grouped(x: &[f64]) -> Vec<Lanes> {
    x.chunks(LANES)
        .map(|chunk| {
            let mut lanes = Lanes::default();
            lanes.0[..chunk.len()].copy_from_slice(chunk);
            lanes
        })
        .collect()
}
