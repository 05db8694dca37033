//! Child processes end with the program that started them.
#![allow(unsafe_code)] // libc

use pyo3::prelude::*;

/// Ends this process when its parent ends, whatever ends that: the system kills it, and a thread watches standard
/// input, whose other end closes with the parent. The thread needs nothing of Python: a mesher holds the interpreter's
/// lock for minutes.
#[pyfunction]
#[pyo3(signature = (watch_input=true))]
pub(crate) fn end_with_parent(watch_input: bool) {
    // SAFETY: prctl and getppid take and return numbers only.
    unsafe {
        let parent = libc::getppid();
        libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL);
        // It may have ended between the two calls. One that ended before the first closes our input.
        if libc::getppid() != parent {
            libc::_exit(1);
        }
    }
    if watch_input {
        drop(std::thread::Builder::new().name("palpate-parent".into()).spawn(watch));
    }
}

fn watch() {
    let mut byte = 0u8;
    loop {
        // SAFETY: `byte` takes the one byte that is asked for.
        let count = unsafe { libc::read(libc::STDIN_FILENO, (&raw mut byte).cast(), 1) };
        let interrupted = || std::io::Error::last_os_error().kind() == std::io::ErrorKind::Interrupted;
        if count == 0 || (count < 0 && !interrupted()) {
            // SAFETY: ends the process without running anything else of it.
            unsafe { libc::_exit(1) };
        }
    }
}
