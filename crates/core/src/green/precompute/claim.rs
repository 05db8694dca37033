//! Lock on a store: one process at a time writes it.
//!
//! The panels lie in `<store>.partial`. The process that computes the store holds an exclusive lock on that file; the
//! system releases it when the process ends, however that ends. Two writers with different first regions would put
//! different panels in the same places.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use crate::{Error, Result};

/// The right to write a store, until it is released or dropped.
pub struct Claim {
    /// The store.
    pub(super) target: PathBuf,
    /// The file of panels.
    pub(super) path: PathBuf,
    pub(super) file: File,
    released: AtomicBool,
}

impl Claim {
    /// Claims the store at `target`; `None` while another process, or another thread of this one, has it.
    ///
    /// If the file system has no locks, the store is claimed without one: two writers are then detected by their checksums
    /// ([`super::partial::Partial::verify`]).
    ///
    /// # Errors
    /// The operating system's.
    pub fn take(target: &Path) -> Result<Option<Self>> {
        let path = partial_path(target);
        let io = |source| Error::Io { path: target.to_owned(), source };
        loop {
            let file =
                OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path).map_err(io)?;
            match file.try_lock() {
                Err(TryLockError::WouldBlock) => return Ok(None),
                // A file system without locks.
                Ok(()) | Err(TryLockError::Error(_)) => {}
            }
            let claim = Self { target: target.to_owned(), path: path.clone(), file, released: AtomicBool::new(false) };
            // The previous writer removes its file at its end: a lock on a removed file excludes no other process.
            if claim.has_its_name() {
                return Ok(Some(claim));
            }
        }
    }

    /// Removes the file of panels.
    pub fn discard(&self) {
        if self.has_its_name() {
            drop(fs::remove_file(&self.path));
        }
    }

    /// Releases the store for other writers. A computation that has not begun leaves no file.
    pub fn release(&self) {
        if self.released.swap(true, Ordering::Relaxed) {
            return;
        }
        if self.file.metadata().is_ok_and(|now| now.len() == 0) {
            self.discard();
        }
        drop(self.file.unlock());
    }

    fn has_its_name(&self) -> bool {
        let named = fs::metadata(&self.path).map(identity);
        self.file.metadata().map(identity).is_ok_and(|ours| named.is_ok_and(|named| named == ours))
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        self.release();
    }
}

/// What tells one file from another that has its name now: device and inode.
#[cfg(unix)]
fn identity(metadata: fs::Metadata) -> (u64, u64) {
    use std::os::unix::fs::MetadataExt;
    (metadata.dev(), metadata.ino())
}

/// The same where the system tells no such numbers: the moment it was made.
#[cfg(windows)]
fn identity(metadata: fs::Metadata) -> u64 {
    use std::os::windows::fs::MetadataExt;
    metadata.creation_time()
}

/// Path of the unfinished work on a store.
pub fn partial_path(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(".partial");
    path.with_file_name(name)
}
