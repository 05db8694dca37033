//! Files appear whole or not at all: written beside, then renamed. A program without a file system provides the bytes of
//! the files that it reads.

use std::collections::HashMap;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

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

/// Writes bytes, piece after piece, beside `path`, and renames the file into place.
///
/// # Errors
/// The operating system's, with nothing left behind.
pub(crate) fn write_whole<'a>(path: &Path, pieces: impl Iterator<Item = &'a [u8]>) -> Result<()> {
    let partial = partial_path(path);
    let written = File::create(&partial).and_then(|mut file| {
        pieces.into_iter().try_for_each(|piece| file.write_all(piece))?;
        file.sync_all()?;
        fs::rename(&partial, path)
    });
    written.map_err(|source| {
        let _ = fs::remove_file(&partial);
        Error::Io { path: path.to_owned(), source }
    })
}

fn partial_path(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    // A browser has no processes.
    let process = if cfg!(target_family = "wasm") { 0 } else { std::process::id() };
    name.push(format!(".{process}.partial"));
    path.with_file_name(name)
}
