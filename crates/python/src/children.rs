//! Child processes end with the program that started them.
#![allow(unsafe_code)] // libc

use std::io::{ErrorKind, Read};

use pyo3::prelude::*;

/// Ends this process when its parent ends, whatever ends that: Linux kills it, and a thread watches standard
/// input, whose other end closes with the parent. The thread needs nothing of Python: a mesher holds the interpreter's
/// lock for minutes.
#[pyfunction]
#[pyo3(signature = (watch_input=true))]
pub(crate) fn end_with_parent(watch_input: bool) {
    #[cfg(target_os = "linux")]
    be_killed_with_parent();
    if watch_input {
        drop(std::thread::Builder::new().name("palpate-parent".into()).spawn(watch));
    }
}

#[cfg(target_os = "linux")]
fn be_killed_with_parent() {
    // SAFETY: prctl and getppid take and return numbers only.
    unsafe {
        let parent = libc::getppid();
        libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL);
        // It may have ended between the two calls. One that ended before the first closes our input.
        if libc::getppid() != parent {
            libc::_exit(1);
        }
    }
}

fn watch() {
    let mut byte = [0u8];
    loop {
        let ended = match std::io::stdin().read(&mut byte) {
            Ok(count) => count == 0,
            Err(error) => error.kind() != ErrorKind::Interrupted,
        };
        if ended {
            // SAFETY: ends the process without running anything else of it.
            unsafe { libc::_exit(1) };
        }
    }
}
