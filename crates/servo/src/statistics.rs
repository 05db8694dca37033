//! Histogram of times with fixed buckets: 64 to an octave from 1 ns up, so that a percentile is right to 1.6 % and costs no memory.

/// Buckets to an octave.
const PER_OCTAVE: usize = 64;
/// Octaves: up to 2^36 ns, over a minute.
const OCTAVES: usize = 36;

/// Counts of durations.
#[derive(Clone)]
pub struct Histogram {
    counts: Box<[u32; PER_OCTAVE * OCTAVES]>,
    total: u64,
    max_ns: u64,
    /// The first bucket in use.
    least: usize,
}

/// Percentiles in microseconds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Summary {
    /// Half are below.
    pub p50: f64,
    /// 99 % are below.
    pub p99: f64,
    /// 99.9 % are below.
    pub p999: f64,
    /// The largest.
    pub max: f64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { counts: Box::new([0; PER_OCTAVE * OCTAVES]), total: 0, max_ns: 0, least: PER_OCTAVE * OCTAVES - 1 }
    }
}

impl Histogram {
    /// Counts one duration; never allocates.
    pub fn record(&mut self, nanoseconds: u64) {
        let index = bucket(nanoseconds);
        self.counts[index] = self.counts[index].saturating_add(1);
        self.least = self.least.min(index);
        self.total += 1;
        self.max_ns = self.max_ns.max(nanoseconds);
    }

    /// Percentiles so far, by one pass over the buckets in use.
    pub fn summary(&self) -> Summary {
        let shares = [0.5, 0.99, 0.999];
        let ranks = shares.map(|share| (share * self.total as f64).ceil() as u64);
        let (mut seen, mut found, mut next) = (0, [0.0; 3], 0);
        for index in self.least..=bucket(self.max_ns) {
            seen += u64::from(self.counts[index]);
            while next < ranks.len() && seen >= ranks[next] && seen > 0 {
                found[next] = upper_edge(index).min(self.max_ns as f64) / 1000.0;
                next += 1;
            }
        }
        let [p50, p99, p999] = found;
        Summary { p50, p99, p999, max: self.max_ns as f64 / 1000.0 }
    }
}

fn bucket(nanoseconds: u64) -> usize {
    let octave = nanoseconds.max(1).ilog2() as usize;
    let part = ((nanoseconds as u128 * PER_OCTAVE as u128) >> octave) as usize % PER_OCTAVE;
    (octave * PER_OCTAVE + part).min(PER_OCTAVE * OCTAVES - 1)
}

fn upper_edge(index: usize) -> f64 {
    let (octave, part) = (index / PER_OCTAVE, index % PER_OCTAVE);
    (1u64 << octave) as f64 * (1.0 + (part + 1) as f64 / PER_OCTAVE as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_agree_with_sorting() {
        let mut histogram = Histogram::default();
        let mut times: Vec<u64> = (1..20_000u64).map(|k| 500 + (k * k * 7919) % 1_000_003).collect();
        times.iter().for_each(|&t| histogram.record(t));
        times.sort_unstable();
        let summary = histogram.summary();
        for (share, found) in [(0.5, summary.p50), (0.99, summary.p99), (0.999, summary.p999)] {
            let exact = times[(share * times.len() as f64) as usize] as f64 / 1000.0;
            assert!((found / exact - 1.0).abs() < 1.0 / PER_OCTAVE as f64 + 1e-3, "{share}: {found} {exact}");
        }
        assert_eq!(summary.max, times[times.len() - 1] as f64 / 1000.0);
    }

    #[test]
    fn extremes_have_a_bucket() {
        let mut histogram = Histogram::default();
        [0, 1, u64::MAX].into_iter().for_each(|t| histogram.record(t));
        assert_eq!(histogram.summary().max, u64::MAX as f64 / 1000.0);
    }
}
