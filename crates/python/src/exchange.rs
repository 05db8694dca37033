//! Two names of a folder exchanged in one step.
#![allow(unsafe_code)] // libc

use std::ffi::CString;
use std::os::unix::ffi::OsStrExt;
use std::path::PathBuf;

use pyo3::prelude::*;

/// Exchanges two files or folders of one file system; `false` where the system cannot.
#[pyfunction]
pub(crate) fn exchange(one: PathBuf, other: PathBuf) -> bool {
    let name = |path: PathBuf| CString::new(path.as_os_str().as_bytes());
    let (Ok(one), Ok(other)) = (name(one), name(other)) else { return false };
    exchanged(&one, &other)
}

#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn exchanged(one: &CString, other: &CString) -> bool {
    let here = libc::AT_FDCWD;
    // SAFETY: both names end with a zero and outlive the call.
    unsafe { libc::renameat2(here, one.as_ptr(), here, other.as_ptr(), libc::RENAME_EXCHANGE) == 0 }
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn exchanged(_one: &CString, _other: &CString) -> bool {
    false
}
