//! What an interrupted computation leaves: the finished panels, in a file beside the store.
//!
//! Layout: a line of JSON that says what is being computed, padded to [`HEADER`] bytes; the row of each column in solving
//! order, four bytes each, marked where a block begins; a BLAKE3 sum for each column, used by the first of a block; the
//! panels. A panel is written before its sum, which also covers the rows of its columns: a block that is torn, missing or
//! of other columns has a sum that does not fit and is computed again. The order of columns behind the last finished block
//! may change while the file is in use. It is created under its name and never truncated: another process that holds it
//! keeps its own.

use std::fs::{self, File, OpenOptions};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use super::block::Block;
use super::layout::Layout;
use crate::{Error, Result};

/// Bytes of the description, padding included.
const HEADER: usize = 512;
/// Bytes of a checksum.
const SUM: usize = 32;
/// Added to the row of a column with which a block begins.
const BEGINS: u32 = 1 << 31;

/// Panels in a file.
pub struct Partial {
    path: PathBuf,
    file: File,
    /// Columns of the operator, its rows, and bytes of a number.
    columns: usize,
    rows: usize,
    number: usize,
    blocks: Vec<Held>,
}

/// A block and its place in the file.
struct Held {
    /// First column, in solving order, and the rows of all.
    first: usize,
    rows: Vec<u32>,
    /// First byte of its panel, and how many there are.
    start: u64,
    length: usize,
    finished: AtomicBool,
}

impl Held {
    fn sum(&self, panel: &[u8]) -> blake3::Hash {
        let mut hash = blake3::Hasher::new();
        hash.update(bytemuck::cast_slice(&self.rows));
        hash.update(panel).finalize()
    }
}

impl Partial {
    /// Opens what an interrupted computation of the same thing left at `path`, or begins anew; [`Self::arrange`] then says
    /// which blocks there are to be.
    ///
    /// `description` names everything that determines the numbers but for the order of the columns. Returns whether a file
    /// with another description had to be thrown away.
    ///
    /// # Errors
    /// The operating system's.
    pub fn open(path: &Path, description: &str, layout: &Layout, bytes_per_number: usize) -> Result<(Self, bool)> {
        let io = |source| Error::Io { path: path.to_owned(), source };
        let mut header = vec![b' '; HEADER];
        header[..description.len()].copy_from_slice(description.as_bytes());
        let existing = OpenOptions::new().read(true).write(true).open(path).ok();
        let (found, (columns, rows)) = (existing.is_some(), (layout.columns, layout.rows()));
        let of =
            |file| Self { path: path.to_owned(), file, columns, rows, number: bytes_per_number, blocks: Vec::new() };
        if let Some(file) = existing {
            let mut start = vec![0; HEADER];
            if file.read_exact_at(&mut start, 0).is_ok() && start == header {
                let mut partial = of(file);
                partial.find_blocks().map_err(io)?;
                return Ok((partial, false));
            }
            fs::remove_file(path).map_err(io)?;
        }
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(path).map_err(io)?;
        let panels = (HEADER + (size_of::<u32>() + SUM) * columns) as u64;
        match file.write_all_at(&header, 0).and_then(|()| file.set_len(panels)) {
            Ok(()) => Ok((of(file), found)),
            Err(error) => {
                let _ = fs::remove_file(path);
                Err(io(error))
            }
        }
    }

    /// Finds the blocks that the file speaks of, and those of them whose sums fit.
    fn find_blocks(&mut self) -> std::io::Result<()> {
        let (mut table, mut sums) = (vec![0u32; self.columns], vec![0; SUM * self.columns]);
        if self.file.read_exact_at(bytemuck::cast_slice_mut(&mut table), HEADER as u64).is_err()
            || self.file.read_exact_at(&mut sums, self.sum_at(0)).is_err()
        {
            return Ok(());
        }
        let mut seen = vec![false; self.rows];
        let is_new =
            |entry: &u32| seen.get_mut((entry & !BEGINS) as usize).is_some_and(|seen| !std::mem::replace(seen, true));
        if table.first().is_none_or(|entry| entry & BEGINS == 0) || !table.iter().all(is_new) {
            return Ok(());
        }
        let mut panel = Vec::new();
        for rows in table.chunk_by(|_, next| next & BEGINS == 0) {
            let held = self.next(rows.iter().map(|entry| entry & !BEGINS).collect());
            let sum = &sums[SUM * held.first..][..SUM];
            panel.resize(held.length, 0);
            let fits = sum.iter().any(|&byte| byte != 0)
                && self.file.read_exact_at(&mut panel, held.start).is_ok()
                && held.sum(&panel).as_bytes() == sum;
            held.finished.store(fits, Ordering::Release);
            self.blocks.push(held);
        }
        Ok(())
    }

    /// The block of these rows behind the last one.
    fn next(&self, rows: Vec<u32>) -> Held {
        let panels = (HEADER + (size_of::<u32>() + SUM) * self.columns) as u64;
        let (first, start) = self
            .blocks
            .last()
            .map_or((0, panels), |last| (last.first + last.rows.len(), last.start + last.length as u64));
        let length = rows.len() * (self.rows - first) * self.number;
        Held { first, rows, start, length, finished: AtomicBool::new(false) }
    }

    /// Rows of the blocks up to the last one that is finished.
    pub fn begun(&self) -> Vec<Vec<u32>> {
        let finished = |held: &Held| held.finished.load(Ordering::Acquire);
        let count = self.blocks.iter().rposition(finished).map_or(0, |last| last + 1);
        self.blocks[..count].iter().map(|held| held.rows.clone()).collect()
    }

    /// Takes other blocks. Those that are as they were stay finished.
    ///
    /// # Errors
    /// The operating system's.
    pub fn arrange(&mut self, layout: &Layout, blocks: &[Block]) -> Result<()> {
        let mut before = std::mem::take(&mut self.blocks).into_iter();
        let (mut same, mut table) = (true, Vec::with_capacity(self.columns));
        for block in blocks {
            let rows: Vec<u32> =
                (block.first..block.first + block.width).map(|place| layout.row(place) as u32).collect();
            table.extend(rows.iter().enumerate().map(|(k, &row)| if k == 0 { row | BEGINS } else { row }));
            let mut held = self.next(rows);
            if same && let Some(old) = before.next() {
                same = old.rows == held.rows;
                held = if same { old } else { held };
            }
            self.blocks.push(held);
        }
        self.file
            .write_all_at(bytemuck::cast_slice(&table), HEADER as u64)
            .map_err(|source| Error::Io { path: self.path.clone(), source })
    }

    /// Where the checksum of the block stands that begins with a column.
    fn sum_at(&self, first: usize) -> u64 {
        (HEADER + size_of::<u32>() * self.columns + SUM * first) as u64
    }

    /// Whether a block is there.
    pub fn has(&self, block: usize) -> bool {
        self.blocks[block].finished.load(Ordering::Acquire)
    }

    /// Writes a block.
    ///
    /// # Errors
    /// The operating system's.
    pub fn put(&self, block: usize, panel: &[u8]) -> Result<()> {
        let held = &self.blocks[block];
        self.file
            .write_all_at(panel, held.start)
            .and_then(|()| self.file.write_all_at(held.sum(panel).as_bytes(), self.sum_at(held.first)))
            .map_err(|source| Error::Io { path: self.path.clone(), source })?;
        held.finished.store(true, Ordering::Release);
        Ok(())
    }

    /// Reads bytes of a block, from its byte `at` on.
    ///
    /// # Errors
    /// The operating system's.
    pub fn get(&self, block: usize, at: usize, out: &mut [u8]) -> Result<()> {
        let at = self.blocks[block].start + at as u64;
        self.file.read_exact_at(out, at).map_err(|source| Error::Io { path: self.path.clone(), source })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three rows, all with columns, in this order.
    fn layout(rows: &[u32]) -> Layout {
        Layout::of_rows(rows)
    }

    #[test]
    fn torn_and_foreign_blocks_are_not_believed() {
        let path = std::env::temp_dir().join(format!("palpate-{}.partial", std::process::id()));
        let blocks = [Block { first: 0, width: 2, rows: 3 }, Block { first: 2, width: 1, rows: 1 }];
        let open = |what: &str, rows: &[u32]| {
            let layout = layout(rows);
            let (mut partial, discarded) = Partial::open(&path, what, &layout, 4).expect("a writable folder");
            let begun = partial.begun();
            partial.arrange(&layout, &blocks).expect("a writable file");
            (partial, discarded, begun)
        };
        let (partial, discarded, begun) = open("one", &[2, 0, 1]);
        assert!(!discarded && !partial.has(0) && !partial.has(1) && begun.is_empty());
        partial.put(0, &[7; 24]).expect("a writable file");
        partial.put(1, &[8; 4]).expect("a writable file");
        // The sum of the second block is there, its numbers are not.
        partial.file.write_all_at(&[9; 4], partial.blocks[1].start).expect("a writable file");
        let (resumed, discarded, begun) = open("one", &[2, 0, 1]);
        assert!(!discarded && resumed.has(0) && !resumed.has(1));
        assert_eq!(begun, [[2, 0]]);
        let mut bytes = [0; 3];
        resumed.get(0, 5, &mut bytes).expect("a readable file");
        assert_eq!(bytes, [7; 3]);
        // Panels of other columns are not those asked for, even once these are asked for again.
        let (other, discarded, _) = open("one", &[0, 2, 1]);
        assert!(!discarded && !other.has(0));
        let (other, discarded, _) = open("two", &[2, 0, 1]);
        assert!(discarded && !other.has(0));
        fs::remove_file(&path).expect("the file");
    }
}
