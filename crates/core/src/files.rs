//! Files appear whole or not at all: written beside, then renamed. A program without a file system provides the bytes of
//! the files that it reads.

use std::collections::HashMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use safetensors::SafeTensorError;

use crate::positioned::Source;
use crate::{Error, Result};

static PROVIDED: Mutex<Option<HashMap<PathBuf, Arc<[u8]>>>> = Mutex::new(None);

fn provided() -> MutexGuard<'static, Option<HashMap<PathBuf, Arc<[u8]>>>> {
    PROVIDED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Has `path` read as these bytes from now on, by all of this process: for a browser, which has no file system.
pub fn provide(path: impl Into<PathBuf>, bytes: Vec<u8>) {
    provided().get_or_insert_default().insert(path.into(), bytes.into());
}

/// Forgets what was provided, but for the paths that are to be kept. What has been opened stays.
pub fn keep_provided(keep: impl Fn(&Path) -> bool) {
    if let Some(files) = provided().as_mut() {
        files.retain(|path, _| keep(path));
    }
}

/// Opens a file for reading by position.
///
/// # Errors
/// The operating system's.
pub(crate) fn open(path: &Path) -> io::Result<Source> {
    match provided().as_ref().and_then(|files| files.get(path)) {
        Some(bytes) => Ok(Source::Memory(bytes.clone())),
        None => File::open(path).map(Source::File),
    }
}

/// All bytes of a file.
///
/// # Errors
/// The operating system's.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    match provided().as_ref().and_then(|files| files.get(path)) {
        Some(bytes) => Ok(bytes.to_vec()),
        None => fs::read(path),
    }
}

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
    // A browser has no processes.
    let process = if cfg!(target_family = "wasm") { 0 } else { std::process::id() };
    name.push(format!(".{process}.partial"));
    path.with_file_name(name)
}
