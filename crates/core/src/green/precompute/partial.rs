//! Partial file: the finished panels of an unfinished computation, beside the store.
//!
//! Layout: a line of JSON that describes the computation, padded to [`HEADER`] bytes; the row of each column in solving
//! order, four bytes each, marked where a block begins; a BLAKE3 sum for each column, used by the first of a block; the
//! panels. A panel is written before its sum. The sum also covers the rows of its columns and of all columns before them,
//! for these determine the rows of a panel: a block that is torn, missing or of another order has a wrong sum and is computed
//! again. The order of columns behind the last finished block may change while the file is in use. One
//! process writes it at a time ([`Claim`]); before a store made of its panels gets its name, they are compared with their
//! sums once more ([`Partial::verify`]).

use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;

use super::claim::Claim;
use super::layout::{Block, Layout};
use crate::positioned::Positioned;
use crate::{Error, Result};

/// Bytes of the description, padding included.
const HEADER: usize = 512;
/// Bytes of a checksum.
const SUM: usize = 32;
/// Added to the row of a column with which a block begins.
const BLOCK_START: u32 = 1 << 31;

/// Panels in a file.
pub struct Partial {
    claim: Arc<Claim>,
    /// Columns of the operator, its rows, and bytes of a number.
    columns: usize,
    rows: usize,
    number: usize,
    blocks: Vec<FileBlock>,
}

/// A block and its place in the file.
struct FileBlock {
    /// First column, in solving order, and the rows of all.
    first: usize,
    rows: Vec<u32>,
    /// Hash of the rows of all columns up to its last.
    order: blake3::Hash,
    /// First byte of its panel, and how many there are.
    start: u64,
    length: usize,
    /// Sum of the finished panel.
    sum: Mutex<Option<blake3::Hash>>,
}

impl FileBlock {
    fn sum_of(&self, panel: &[u8]) -> blake3::Hash {
        let mut hash = blake3::Hasher::new();
        hash.update(self.order.as_bytes());
        hash.update(panel).finalize()
    }

    fn sum(&self) -> MutexGuard<'_, Option<blake3::Hash>> {
        self.sum.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn is_finished(&self) -> bool {
        self.sum().is_some()
    }
}

impl Partial {
    /// Resumes the file of an interrupted computation of the same problem, or begins a new one; [`Self::arrange`] then sets the
    /// blocks.
    ///
    /// `description` names everything that determines the numbers but for the order of the columns. Returns whether
    /// a file with another description was discarded.
    ///
    /// # Errors
    /// The operating system's.
    pub fn open(
        claim: Arc<Claim>,
        description: &str,
        layout: &Layout,
        bytes_per_number: usize,
    ) -> Result<(Self, bool)> {
        let mut header = vec![b' '; HEADER];
        header[..description.len()].copy_from_slice(description.as_bytes());
        let mut start = vec![0; HEADER];
        let same = claim.file.read_exact_at(&mut start, 0).is_ok() && start == header;
        let (columns, rows, blocks) = (layout.columns, layout.rows(), Vec::new());
        let mut partial = Self { claim, columns, rows, number: bytes_per_number, blocks };
        if same {
            partial.find_blocks().map_err(|error| partial.io(error))?;
            return Ok((partial, false));
        }
        let file = &partial.claim.file;
        let found = file.metadata().is_ok_and(|now| now.len() > 0);
        let begun = file.set_len(0).and_then(|()| file.write_all_at(&header, 0));
        if let Err(error) = begun.and_then(|()| file.set_len(partial.panels())) {
            drop(file.set_len(0));
            return Err(partial.io(error));
        }
        Ok((partial, found))
    }

    /// Errors name the store, for the user has not named the file beside it.
    fn io(&self, source: io::Error) -> Error {
        Error::Io { path: self.claim.target.clone(), source }
    }

    /// First byte of the panels.
    fn panels(&self) -> u64 {
        (HEADER + (size_of::<u32>() + SUM) * self.columns) as u64
    }

    /// Finds the blocks listed in the file, and those of them with correct sums.
    fn find_blocks(&mut self) -> io::Result<()> {
        let (mut table, mut sums) = (vec![0u32; self.columns], vec![0; SUM * self.columns]);
        if self.claim.file.read_exact_at(bytemuck::cast_slice_mut(&mut table), HEADER as u64).is_err()
            || self.claim.file.read_exact_at(&mut sums, self.sum_at(0)).is_err()
        {
            return Ok(());
        }
        let mut seen = vec![false; self.rows];
        let is_new = |entry: &u32| {
            seen.get_mut((entry & !BLOCK_START) as usize).is_some_and(|seen| !std::mem::replace(seen, true))
        };
        if table.first().is_none_or(|entry| entry & BLOCK_START == 0) || !table.iter().all(is_new) {
            return Ok(());
        }
        let mut panel = Vec::new();
        for rows in table.chunk_by(|_, next| next & BLOCK_START == 0) {
            let block = self.next(rows.iter().map(|entry| entry & !BLOCK_START).collect());
            let sum = &sums[SUM * block.first..][..SUM];
            panel.resize(block.length, 0);
            if sum.iter().any(|&byte| byte != 0) && self.claim.file.read_exact_at(&mut panel, block.start).is_ok() {
                *block.sum() = Some(block.sum_of(&panel)).filter(|found| found.as_bytes() == sum);
            }
            self.blocks.push(block);
        }
        Ok(())
    }

    /// The block of these rows after the last one.
    fn next(&self, rows: Vec<u32>) -> FileBlock {
        let mut order = blake3::Hasher::new();
        let (mut first, mut start) = (0, self.panels());
        if let Some(last) = self.blocks.last() {
            (first, start) = (last.first + last.rows.len(), last.start + last.length as u64);
            order.update(last.order.as_bytes());
        }
        let order = order.update(bytemuck::cast_slice(&rows)).finalize();
        let length = rows.len() * (self.rows - first) * self.number;
        FileBlock { first, rows, order, start, length, sum: Mutex::new(None) }
    }

    /// Rows of the blocks up to the last one that is finished.
    pub fn begun(&self) -> Vec<Vec<u32>> {
        let count = self.blocks.iter().rposition(FileBlock::is_finished).map_or(0, |last| last + 1);
        self.blocks[..count].iter().map(|block| block.rows.clone()).collect()
    }

    /// Sets other blocks. Unchanged ones stay finished.
    ///
    /// # Errors
    /// The operating system's.
    pub fn arrange(&mut self, layout: &Layout, blocks: &[Block]) -> Result<()> {
        let mut before = std::mem::take(&mut self.blocks).into_iter();
        let (mut same, mut table) = (true, Vec::with_capacity(self.columns));
        for block in blocks {
            let rows: Vec<u32> =
                (block.first..block.first + block.width).map(|place| layout.row(place) as u32).collect();
            table.extend(rows.iter().enumerate().map(|(k, &row)| if k == 0 { row | BLOCK_START } else { row }));
            let mut block = self.next(rows);
            if same && let Some(old) = before.next() {
                same = old.order == block.order && old.rows.len() == block.rows.len();
                block = if same { old } else { block };
            }
            self.blocks.push(block);
        }
        let table = bytemuck::cast_slice(&table);
        self.claim.file.write_all_at(table, HEADER as u64).map_err(|error| self.io(error))
    }

    /// Offset of the checksum of the block that begins with a column.
    fn sum_at(&self, first: usize) -> u64 {
        (HEADER + size_of::<u32>() * self.columns + SUM * first) as u64
    }

    /// Whether a block is finished.
    pub fn has(&self, block: usize) -> bool {
        self.blocks[block].is_finished()
    }

    /// Writes a block.
    ///
    /// # Errors
    /// The operating system's.
    pub fn put(&self, block: usize, panel: &[u8]) -> Result<()> {
        let block = &self.blocks[block];
        let sum = block.sum_of(panel);
        self.claim
            .file
            .write_all_at(panel, block.start)
            .and_then(|()| self.claim.file.write_all_at(sum.as_bytes(), self.sum_at(block.first)))
            .map_err(|error| self.io(error))?;
        *block.sum() = Some(sum);
        Ok(())
    }

    /// Reads bytes of a block, from its byte `at` on.
    ///
    /// # Errors
    /// The operating system's.
    pub fn get(&self, block: usize, at: usize, out: &mut [u8]) -> Result<()> {
        let at = self.blocks[block].start + at as u64;
        self.claim.file.read_exact_at(out, at).map_err(|error| self.io(error))
    }

    /// Compares the first blocks with the sums that they had when they were finished. Called after they were read,
    /// so that the read numbers are the computed ones. A changed block counts as missing.
    ///
    /// # Errors
    /// A block that another program has changed, or the operating system's.
    pub fn verify(&self, blocks: usize) -> Result<()> {
        self.blocks[..blocks].par_iter().try_for_each_init(Vec::new, |panel, block| {
            panel.resize(block.length, 0);
            self.claim.file.read_exact_at(panel, block.start).map_err(|error| self.io(error))?;
            let mut sum = block.sum();
            if *sum == Some(block.sum_of(panel)) {
                return Ok(());
            }
            *sum = None;
            let reason = format!(
                "another program has changed its finished columns in {}; run the same command again to compute them anew",
                self.claim.path.display()
            );
            Err(Error::store(&self.claim.target, reason))
        })
    }

    /// Removes the file.
    pub fn discard(&self) {
        self.claim.discard();
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    const BLOCKS: [Block; 2] = [Block { first: 0, width: 2, rows: 3 }, Block { first: 2, width: 1, rows: 1 }];

    /// The file for three rows in an order, all with columns; whether another file was discarded; and the blocks found.
    fn open(path: &Path, what: &str, rows: &[u32]) -> (Partial, bool, Vec<Vec<u32>>) {
        let layout = Layout::of_rows(rows);
        let claim = Claim::take(path).expect("a writable folder").expect("nobody else's store");
        let (mut partial, discarded) = Partial::open(Arc::new(claim), what, &layout, 4).expect("a writable folder");
        let begun = partial.begun();
        partial.arrange(&layout, &BLOCKS).expect("a writable file");
        (partial, discarded, begun)
    }

    fn store(name: &str) -> std::path::PathBuf {
        std::env::temp_dir().join(format!("palpate-{}-{name}", std::process::id()))
    }

    fn put_both(partial: &Partial) {
        partial.put(0, &[7; 24]).expect("a writable file");
        partial.put(1, &[8; 4]).expect("a writable file");
    }

    #[test]
    fn torn_and_foreign_blocks_are_not_believed() {
        let path = store("torn");
        let (partial, discarded, begun) = open(&path, "one", &[2, 0, 1]);
        assert!(!discarded && !partial.has(0) && !partial.has(1) && begun.is_empty());
        put_both(&partial);
        // The file has the sum of the second block, but not its numbers.
        partial.claim.file.write_all_at(&[9; 4], partial.blocks[1].start).expect("a writable file");
        drop(partial);
        let (resumed, discarded, begun) = open(&path, "one", &[2, 0, 1]);
        assert!(!discarded && resumed.has(0) && !resumed.has(1));
        assert_eq!(begun, [[2, 0]]);
        let mut bytes = [0; 3];
        resumed.get(0, 5, &mut bytes).expect("a readable file");
        assert_eq!(bytes, [7; 3]);
        drop(resumed);
        // Panels of other columns are not those asked for, even once these are asked for again.
        let (other, discarded, _) = open(&path, "one", &[0, 2, 1]);
        assert!(!discarded && !other.has(0));
        drop(other);
        let (other, discarded, _) = open(&path, "two", &[2, 0, 1]);
        assert!(discarded && !other.has(0));
        other.discard();
    }

    #[test]
    fn a_block_behind_others_than_it_was_computed_behind_is_not_believed() {
        let path = store("behind");
        let (partial, ..) = open(&path, "one", &[0, 1, 2]);
        put_both(&partial);
        drop(partial);
        // The last block keeps its row and its place; the rows of its panel are others'.
        drop(open(&path, "one", &[1, 0, 2]));
        let (partial, _, begun) = open(&path, "one", &[1, 0, 2]);
        assert!(begun.is_empty() && !partial.has(1));
        partial.discard();
    }

    #[test]
    fn a_block_that_is_changed_after_it_was_finished_is_refused() {
        let path = store("changed");
        let (partial, ..) = open(&path, "one", &[0, 1, 2]);
        put_both(&partial);
        partial.verify(2).expect("the panels as they were written");
        partial.claim.file.write_all_at(&[9; 4], partial.blocks[0].start).expect("a writable file");
        assert!(partial.verify(2).is_err() && !partial.has(0) && partial.has(1));
        partial.discard();
    }

    #[test]
    fn a_store_is_claimed_once_until_its_claim_is_dropped() {
        let path = store("claimed");
        let claim = Claim::take(&path).expect("a writable folder").expect("nobody else's store");
        assert!(Claim::take(&path).expect("a writable folder").is_none());
        drop(claim);
        assert!(!super::super::claim::partial_path(&path).exists(), "nothing was begun");
        let claim = Claim::take(&path).expect("a writable folder").expect("nobody else's store");
        claim.file.set_len(1).expect("a writable file");
        claim.discard();
        // A removed file excludes no other process, and dropping it removes no other file.
        let next = Claim::take(&path).expect("a writable folder").expect("nobody else's store");
        drop(claim);
        assert!(Claim::take(&path).expect("a writable folder").is_none());
        drop(next);
    }
}
