//! Memory that fronts hand on to each other.
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

/// Buffers that wait for their next use.
pub struct Buffers {
    waiting: Mutex<Waiting>,
    /// Numbers that may wait.
    limit: usize,
}

#[derive(Default)]
struct Waiting {
    by_numbers: BTreeMap<usize, Vec<Vec<f64>>>,
    numbers: usize,
}

impl Waiting {
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
        Self { waiting: Mutex::new(Waiting::default()), limit }
    }

    /// At least so many numbers, of any value.
    pub fn take(&self, count: usize) -> Vec<f64> {
        let numbers = buffer_numbers(count);
        let waiting = (numbers >= LEAST).then(|| self.waiting.lock().ok()?.take(numbers)).flatten();
        waiting.unwrap_or_else(|| vec![0.0; numbers])
    }

    /// Takes one back. The smallest that wait are let go of where there are too many: they cost least.
    pub fn give(&self, buffer: Vec<f64>) {
        if buffer.len() < LEAST {
            return;
        }
        let mut dropped = Vec::new();
        if let Ok(mut waiting) = self.waiting.lock() {
            waiting.numbers += buffer.len();
            waiting.by_numbers.entry(buffer.len()).or_default().push(buffer);
            while waiting.numbers > self.limit {
                let smallest = waiting.by_numbers.first_key_value().map(|(&numbers, _)| numbers);
                dropped.extend(smallest.and_then(|numbers| waiting.take(numbers)));
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
        let waiting = buffers.waiting.lock().unwrap();
        assert_eq!(waiting.numbers, 4 * LEAST);
        assert_eq!(waiting.by_numbers.keys().copied().collect::<Vec<_>>(), [LEAST, 3 * LEAST]);
    }
}
