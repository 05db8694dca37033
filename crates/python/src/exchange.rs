//! Two names of a folder exchanged in one step.
#![allow(unsafe_code)] // libc

use std::path::{Path, PathBuf};

use pyo3::prelude::*;

/// Exchanges two files or folders of one file system; `false` where the system cannot.
#[pyfunction]
pub(crate) fn exchange(one: PathBuf, other: PathBuf) -> bool {
    exchanged(&one, &other)
}

#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn exchanged(one: &Path, other: &Path) -> bool {
    use std::os::unix::ffi::OsStrExt;
    let name = |path: &Path| std::ffi::CString::new(path.as_os_str().as_bytes());
    let (Ok(one), Ok(other)) = (name(one), name(other)) else { return false };
    let here = libc::AT_FDCWD;
    // SAFETY: both names end with a zero and outlive the call.
    unsafe { libc::renameat2(here, one.as_ptr(), here, other.as_ptr(), libc::RENAME_EXCHANGE) == 0 }
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn exchanged(_one: &Path, _other: &Path) -> bool {
    false
}
