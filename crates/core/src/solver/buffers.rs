//! Pool of buffers that are reused by successive fronts.
//!
//! A million tetrahedra take 100 GB of fronts one after the other, a few at a time. What is given back to the system is
//! cleared by it before it is used again, and taken from the page tables of all threads: a fifth of a factorisation's time.

use std::collections::BTreeMap;
use std::sync::Mutex;

/// Fewer numbers are left to the allocator.
const LEAST: usize = 1 << 14;

/// Numbers that a buffer for so many has: with four leading binary digits, so that others find it of use.
pub fn buffer_numbers(count: usize) -> usize {
    match count.max(1).ilog2() {
        low if count < LEAST || low < 3 => count,
        low => count.next_multiple_of(1 << (low - 3)),
    }
}

/// Buffers for reuse.
pub struct Buffers {
    pool: Mutex<Pool>,
    /// Numbers that may wait.
    limit: usize,
}

#[derive(Default)]
struct Pool {
    by_numbers: BTreeMap<usize, Vec<Vec<f64>>>,
    numbers: usize,
}

impl Pool {
    /// One of exactly so many numbers.
    fn take(&mut self, numbers: usize) -> Option<Vec<f64>> {
        let same = self.by_numbers.get_mut(&numbers)?;
        let buffer = same.pop();
        if same.is_empty() {
            self.by_numbers.remove(&numbers);
        }
        self.numbers -= buffer.as_ref().map_or(0, Vec::len);
        buffer
    }
}

impl Buffers {
    /// Of which so many numbers may wait, none so far.
    pub fn new(limit: usize) -> Self {
        Self { pool: Mutex::new(Pool::default()), limit }
    }

    /// At least so many numbers, of any value.
    pub fn take(&self, count: usize) -> Vec<f64> {
        let numbers = buffer_numbers(count);
        let pool = (numbers >= LEAST).then(|| self.pool.lock().ok()?.take(numbers)).flatten();
        pool.unwrap_or_else(|| vec![0.0; numbers])
    }

    /// Takes one back. The smallest that wait are let go of where there are too many: they cost least.
    pub fn give(&self, buffer: Vec<f64>) {
        if buffer.len() < LEAST {
            return;
        }
        let mut dropped = Vec::new();
        if let Ok(mut pool) = self.pool.lock() {
            pool.numbers += buffer.len();
            pool.by_numbers.entry(buffer.len()).or_default().push(buffer);
            while pool.numbers > self.limit {
                let smallest = pool.by_numbers.first_key_value().map(|(&numbers, _)| numbers);
                dropped.extend(smallest.and_then(|numbers| pool.take(numbers)));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_are_a_little_larger_than_asked_for_and_come_back() {
        for count in [1, 5, LEAST - 1, LEAST, LEAST + 1, 1_234_567] {
            let numbers = buffer_numbers(count);
            assert!(count <= numbers && 8 * numbers < 9 * count + 8, "{count} {numbers}");
            assert_eq!(buffer_numbers(numbers), numbers);
        }
        let buffers = Buffers::new(4 * LEAST);
        let mut marked = buffers.take(LEAST + 10);
        marked.fill(7.0);
        let place = marked.as_ptr();
        buffers.give(marked);
        let again = buffers.take(LEAST + 20);
        assert!(again.as_ptr() == place && again[0] == 7.0);
    }

    #[test]
    fn no_more_than_the_limit_waits_and_the_largest_stay() {
        let buffers = Buffers::new(4 * LEAST);
        for numbers in [LEAST, 3 * LEAST, LEAST, LEAST] {
            buffers.give(vec![1.0; numbers]);
        }
        let pool = buffers.pool.lock().unwrap();
        assert_eq!(pool.numbers, 4 * LEAST);
        assert_eq!(pool.by_numbers.keys().copied().collect::<Vec<_>>(), [LEAST, 3 * LEAST]);
    }
}
