//! What an interrupted computation leaves: the finished panels, in a file beside the store.
//!
//! Layout: a line of JSON that says what is being computed, padded to [`HEADER`] bytes; a BLAKE3 sum for each block, zero
//! while the block is missing; the panels. A panel is written before its sum, so a block that is torn or missing has a
//! sum that does not fit and is computed again. The file is created under its name and never truncated: another process
//! that holds it keeps its own.

use std::fs::{self, File, OpenOptions};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use super::block::Block;
use crate::{Error, Result};

/// Bytes of the description, padding included.
const HEADER: usize = 512;
/// Bytes of a checksum.
const SUM: usize = 32;

/// Panels in a file.
pub struct Partial {
    path: PathBuf,
    file: File,
    /// First byte of each panel, and the end.
    starts: Vec<u64>,
    finished: Vec<AtomicBool>,
}

impl Partial {
    /// Opens what an interrupted computation of the same thing left at `path`, or begins anew.
    ///
    /// `description` names everything that determines the numbers and their layout. Returns whether a file with another
    /// description had to be thrown away.
    ///
    /// # Errors
    /// The operating system's.
    pub fn open(path: &Path, description: &str, blocks: &[Block], bytes_per_number: usize) -> Result<(Self, bool)> {
        let mut starts = vec![(HEADER + SUM * blocks.len()) as u64];
        starts.extend(blocks.iter().scan(starts[0], |end, block| {
            *end += (block.len() * bytes_per_number) as u64;
            Some(*end)
        }));
        let io = |source| Error::Io { path: path.to_owned(), source };
        let mut header = vec![b' '; HEADER];
        header[..description.len()].copy_from_slice(description.as_bytes());
        let existing = OpenOptions::new().read(true).write(true).open(path).ok();
        let found = existing.is_some();
        if let Some(file) = existing {
            let mut start = vec![0; HEADER];
            if file.read_exact_at(&mut start, 0).is_ok() && start == header {
                let partial = Self::new(path, file, starts);
                partial.verify().map_err(io)?;
                return Ok((partial, false));
            }
            fs::remove_file(path).map_err(io)?;
        }
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(path).map_err(io)?;
        header.resize(HEADER + SUM * blocks.len(), 0);
        let partial = match file.write_all_at(&header, 0) {
            Ok(()) => Self::new(path, file, starts),
            Err(error) => {
                let _ = fs::remove_file(path);
                return Err(io(error));
            }
        };
        Ok((partial, found))
    }

    fn new(path: &Path, file: File, starts: Vec<u64>) -> Self {
        let finished = starts[1..].iter().map(|_| AtomicBool::new(false)).collect();
        Self { path: path.to_owned(), file, starts, finished }
    }

    /// Finds the blocks whose sums fit.
    fn verify(&self) -> std::io::Result<()> {
        let mut sums = vec![0; SUM * self.finished.len()];
        if self.file.read_exact_at(&mut sums, HEADER as u64).is_err() {
            return Ok(());
        }
        let mut panel = Vec::new();
        for (block, sum) in sums.chunks_exact(SUM).enumerate().filter(|(_, sum)| sum.iter().any(|&b| b != 0)) {
            panel.resize((self.starts[block + 1] - self.starts[block]) as usize, 0);
            let fits = self.file.read_exact_at(&mut panel, self.starts[block]).is_ok()
                && blake3::hash(&panel).as_bytes() == sum;
            self.finished[block].store(fits, Ordering::Release);
        }
        Ok(())
    }

    /// Whether a block is there.
    pub fn has(&self, block: usize) -> bool {
        self.finished[block].load(Ordering::Acquire)
    }

    /// Writes a block.
    ///
    /// # Errors
    /// The operating system's.
    pub fn put(&self, block: usize, panel: &[u8]) -> Result<()> {
        let sum = blake3::hash(panel);
        self.file
            .write_all_at(panel, self.starts[block])
            .and_then(|()| self.file.write_all_at(sum.as_bytes(), (HEADER + SUM * block) as u64))
            .map_err(|source| Error::Io { path: self.path.clone(), source })?;
        self.finished[block].store(true, Ordering::Release);
        Ok(())
    }

    /// Reads bytes of a block, from its byte `at` on.
    ///
    /// # Errors
    /// The operating system's.
    pub fn get(&self, block: usize, at: usize, out: &mut [u8]) -> Result<()> {
        let at = self.starts[block] + at as u64;
        self.file.read_exact_at(out, at).map_err(|source| Error::Io { path: self.path.clone(), source })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torn_and_foreign_blocks_are_not_believed() {
        let path = std::env::temp_dir().join(format!("palpate-{}.partial", std::process::id()));
        let blocks = [Block { first: 0, width: 2, rows: 3 }, Block { first: 2, width: 1, rows: 1 }];
        let open = |what: &str| Partial::open(&path, what, &blocks, 4).expect("a writable folder");
        let (partial, discarded) = open("one");
        assert!(!discarded && !partial.has(0) && !partial.has(1));
        partial.put(0, &[7; 24]).expect("a writable file");
        partial.put(1, &[8; 4]).expect("a writable file");
        // The sum of the second block is there, its numbers are not.
        partial.file.write_all_at(&[9; 4], partial.starts[1]).expect("a writable file");
        let (resumed, discarded) = open("one");
        assert!(!discarded && resumed.has(0) && !resumed.has(1));
        let mut bytes = [0; 3];
        resumed.get(0, 5, &mut bytes).expect("a readable file");
        assert_eq!(bytes, [7; 3]);
        let (other, discarded) = open("two");
        assert!(discarded && !other.has(0));
        fs::remove_file(&path).expect("the file");
    }
}
