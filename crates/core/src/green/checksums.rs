//! Checksums of the operator in its file, block by block, taken while the bytes are read.

use std::io::Result;

use crate::positioned::Positioned;

/// Bytes under one checksum; a multiple of every number's.
const BLOCK: usize = 1 << 24;
/// Bytes of a checksum (BLAKE3).
pub const SUM: usize = 32;

/// Number of blocks in `length` bytes.
pub fn block_count(length: usize) -> usize {
    length.div_ceil(BLOCK)
}

/// Reads bytes of a file, from its byte `at` on, and sums them.
///
/// # Errors
/// The operating system's.
pub fn sums_while_reading(file: &(impl Positioned + Sync), at: u64, bytes: &mut [u8]) -> Result<Vec<[u8; SUM]>> {
    each(bytes.chunks_mut(BLOCK).collect(), |block, piece: &mut [u8]| {
        file.read_exact_at(piece, at + (block * BLOCK) as u64)?;
        Ok(*blake3::hash(piece).as_bytes())
    })
}

/// The first bytes of every column.
#[derive(Clone, Copy, Debug, Default)]
pub struct ColumnHeads {
    /// Bytes of a column.
    pub column: usize,
    /// Bytes of its head.
    pub head: usize,
}

impl ColumnHeads {
    /// Bytes of heads before byte `at` of the columns.
    fn before(&self, at: usize) -> usize {
        if self.head == 0 { 0 } else { at / self.column * self.head + (at % self.column).min(self.head) }
    }

    /// Copies what a block of columns that begins at byte `at` has of the heads.
    fn copy(&self, at: usize, block: &[u8], mut out: &mut [u8]) {
        let mut place = at;
        while !out.is_empty() {
            let within = place % self.column;
            if within >= self.head {
                place += self.column - within;
                continue;
            }
            let count = (self.head - within).min(out.len());
            let (piece, rest) = std::mem::take(&mut out).split_at_mut(count);
            piece.copy_from_slice(&block[place - at..place - at + count]);
            (out, place) = (rest, place + count);
        }
    }
}

/// Sums `length` bytes of a file, from its byte `at` on, keeping only the heads of columns in `kept`: what is kept is what
/// was summed.
///
/// # Errors
/// The operating system's.
pub fn sums_keeping_heads(
    file: &(impl Positioned + Sync),
    at: u64,
    length: usize,
    heads: &ColumnHeads,
    mut head_bytes: &mut [u8],
) -> Result<Vec<[u8; SUM]>> {
    let mut pieces = Vec::with_capacity(block_count(length));
    for start in (0..length).step_by(BLOCK) {
        let end = length.min(start + BLOCK);
        let (piece, rest) = std::mem::take(&mut head_bytes).split_at_mut(heads.before(end) - heads.before(start));
        head_bytes = rest;
        pieces.push((end - start, piece));
    }
    each(pieces, |block, (count, piece): (usize, &mut [u8])| {
        let mut bytes = vec![0; count];
        file.read_exact_at(&mut bytes, at + (block * BLOCK) as u64)?;
        heads.copy(block * BLOCK, &bytes, piece);
        Ok(*blake3::hash(&bytes).as_bytes())
    })
}

/// `work` on every block, by all threads.
#[cfg(feature = "offline")]
fn each<T: Send>(blocks: Vec<T>, work: impl Fn(usize, T) -> Result<[u8; SUM]> + Sync + Send) -> Result<Vec<[u8; SUM]>> {
    use rayon::prelude::*;
    blocks.into_par_iter().enumerate().with_max_len(1).map(|(block, part)| work(block, part)).collect()
}

/// `work` on every block, one after the other: the online part starts no threads.
#[cfg(not(feature = "offline"))]
fn each<T>(blocks: Vec<T>, work: impl Fn(usize, T) -> Result<[u8; SUM]>) -> Result<Vec<[u8; SUM]>> {
    blocks.into_iter().enumerate().map(|(block, part)| work(block, part)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_across_blocks_are_those_of_the_columns() {
        let heads = ColumnHeads { column: 7, head: 3 };
        let bytes: Vec<u8> = (0..70).collect();
        let expected: Vec<u8> = bytes.chunks(7).flat_map(|column| &column[..3]).copied().collect();
        for block in [1, 2, 5, 9, 64, 70] {
            let mut head_bytes = Vec::new();
            for start in (0..70).step_by(block) {
                let end = 70.min(start + block);
                let mut piece = vec![0; heads.before(end) - heads.before(start)];
                heads.copy(start, &bytes[start..end], &mut piece);
                head_bytes.extend(piece);
            }
            assert_eq!(head_bytes, expected, "blocks of {block}");
        }
    }
}
