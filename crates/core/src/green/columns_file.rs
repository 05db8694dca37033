//! Columns of a verified store that stay in its file, read by position.

use std::io;
use std::path::PathBuf;

use crate::positioned::{Positioned, Source};
use crate::{Error, Result};

/// The operator in a file. The file is held open: one renamed over it changes nothing here.
pub struct ColumnsFile {
    /// The file as it was when its checksums were verified.
    pub file: Source,
    /// Its name.
    pub path: PathBuf,
    /// Its length then, bytes.
    pub length: u64,
    /// Its first byte of the operator.
    pub at: u64,
    /// Bytes of a column.
    pub column: usize,
}

impl ColumnsFile {
    /// Reads bytes of a column, from its byte `from` on.
    ///
    /// # Errors
    /// A file that was cut short meanwhile, or the operating system's.
    pub fn read(&self, column: usize, from: usize, out: &mut [u8]) -> Result<()> {
        let at = self.at + (column * self.column + from) as u64;
        self.file.read_exact_at(out, at).map_err(|source| match source.kind() {
            io::ErrorKind::UnexpectedEof => self.cut_short(),
            _ => Error::Io { path: self.path.clone(), source },
        })
    }

    /// Whether the file is still as long as it was.
    pub fn is_intact(&self) -> bool {
        self.file.length().is_ok_and(|now| now >= self.length)
    }

    /// Refuses a file that is shorter than it was.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn require_intact(&self) -> Result<()> {
        if self.is_intact() { Ok(()) } else { Err(self.cut_short()) }
    }

    fn cut_short(&self) -> Error {
        Error::store(&self.path, "was cut short while in use; compute it again")
    }
}
