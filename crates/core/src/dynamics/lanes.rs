//! Vectors over modes in groups of eight, so that one instruction takes several modes.
//!
//! Sums run in eight partial sums in a fixed order: the same bits on every processor, whatever its vector width.

/// Modes a group.
pub const LANES: usize = 8;

/// Eight modes; a cache line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(64))]
pub struct Lanes(pub [f64; LANES]);

impl Lanes {
    /// `self + a b`, each lane for itself.
    #[inline(always)]
    pub fn plus(self, a: Lanes, b: Lanes) -> Self {
        Lanes(std::array::from_fn(|l| self.0[l] + a.0[l] * b.0[l]))
    }

    /// `self + s a`.
    #[inline(always)]
    pub fn plus_scaled(self, s: f64, a: Lanes) -> Self {
        Lanes(std::array::from_fn(|l| self.0[l] + s * a.0[l]))
    }

    /// `a b`, each lane for itself.
    #[inline(always)]
    pub fn times(self, b: Lanes) -> Self {
        Lanes(std::array::from_fn(|l| self.0[l] * b.0[l]))
    }

    /// Sum of the lanes.
    #[inline(always)]
    pub fn sum(self) -> f64 {
        let [a, b, c, d, e, f, g, h] = self.0;
        ((a + e) + (c + g)) + ((b + f) + (d + h))
    }
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

/// The first `count` numbers of groups.
pub fn flat(groups: &[Lanes], count: usize) -> Vec<f64> {
    groups.iter().flat_map(|g| g.0).take(count).collect()
}

/// `a . b`.
#[inline(always)]
pub fn dot(a: &[Lanes], b: &[Lanes]) -> f64 {
    // Two chains of sums hide the latency of addition.
    let mut sums = [Lanes::default(); 2];
    let (pairs_a, pairs_b) = (a.chunks_exact(2), b.chunks_exact(2));
    if let ([last_a], [last_b]) = (pairs_a.remainder(), pairs_b.remainder()) {
        sums[0] = last_a.times(*last_b);
    }
    for (x, y) in pairs_a.zip(pairs_b) {
        sums[0] = sums[0].plus(x[0], y[0]);
        sums[1] = sums[1].plus(x[1], y[1]);
    }
    sums[0].sum() + sums[1].sum()
}
