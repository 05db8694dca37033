//! Address ranges of the memory that a tick reads, which the servo locks: this crate makes no system calls.

use std::ops::Range;

/// Addresses, in any order; they may overlap.
#[derive(Default)]
pub struct Ranges(Vec<Range<usize>>);

impl Ranges {
    /// Adds what a slice holds, not what its elements point to.
    pub fn add<T>(&mut self, slice: &[T]) {
        let start = slice.as_ptr().addr();
        if !slice.is_empty() && size_of::<T>() > 0 {
            self.0.push(start..start + size_of_val(slice));
        }
    }

    /// Adds addresses, from the lower to the higher; none where the lower is not below.
    pub fn add_addresses(&mut self, addresses: Range<usize>) {
        if !addresses.is_empty() {
            self.0.push(addresses);
        }
    }

    /// The pages of `page` bytes that they touch, ascending and apart from each other.
    pub fn pages(mut self, page: usize) -> Vec<Range<usize>> {
        self.0.iter_mut().for_each(|range| *range = range.start / page * page..range.end.next_multiple_of(page));
        self.0.sort_unstable_by_key(|range| range.start);
        let mut pages: Vec<Range<usize>> = Vec::new();
        for range in self.0 {
            match pages.last_mut() {
                Some(last) if range.start <= last.end => last.end = last.end.max(range.end),
                _ => pages.push(range),
            }
        }
        pages
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_are_whole_and_apart() {
        let ranges = Ranges(vec![8193..8200, 4097..4100, 100..200, 4000..4200, 20_000..30_000]);
        assert_eq!(ranges.pages(4096), [0..12_288, 16_384..32_768]);
        let mut ranges = Ranges::default();
        ranges.add::<u64>(&[]);
        ranges.add(&[1u64, 2]);
        assert_eq!(ranges.0.len(), 1);
        assert_eq!(ranges.0[0].len(), 16);
    }
}
