//! Ranges of consecutive numbers.

use std::ops::Range;

/// Joins numbers that follow each other.
pub fn runs(numbers: impl Iterator<Item = u32>) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for number in numbers {
        let number = number as usize;
        match runs.last_mut() {
            Some(run) if run.end == number => run.end += 1,
            _ => runs.push(number..number + 1),
        }
    }
    runs
}
