//! Files appear whole or not at all: written beside, then renamed.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use safetensors::SafeTensorError;

use crate::{Error, Result};

/// Gives a path beside `path` to `write`, and renames what it wrote into place.
///
/// # Errors
/// What `write` returns, or the operating system's, with nothing left behind.
pub(crate) fn write_whole(path: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let io = |source| Error::Io { path: path.to_owned(), source };
    let partial = partial_path(path);
    let written = write(&partial).and_then(|()| {
        File::open(&partial).and_then(|f| f.sync_all()).map_err(io)?;
        fs::rename(&partial, path).map_err(io)
    });
    if written.is_err() {
        let _ = fs::remove_file(&partial);
    }
    written
}

/// What safetensors says of a file that cannot be written.
pub(crate) fn unwritten(path: &Path, error: SafeTensorError) -> Error {
    match error {
        SafeTensorError::IoError(source) => Error::Io { path: path.to_owned(), source },
        other => Error::Store { path: path.to_owned(), reason: format!("cannot be written: {other}") },
    }
}

fn partial_path(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.partial", std::process::id()));
    path.with_file_name(name)
}
