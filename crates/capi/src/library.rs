//! Version of the library, its clock, and the last error.
#![allow(unsafe_code)] // exported by name

use std::ffi::{CStr, c_char};

use crate::abi::{PALPATE_ABI_MAJOR, PALPATE_ABI_MINOR};
use crate::status::last_error;

/// The interface that the library was built with: PALPATE_ABI_MAJOR * 65536 + PALPATE_ABI_MINOR.
#[unsafe(no_mangle)]
pub extern "C" fn palpate_abi_version() -> u32 {
    PALPATE_ABI_MAJOR << 16 | PALPATE_ABI_MINOR
}

/// Version of the library, such as "0.1.0".
#[unsafe(no_mangle)]
pub extern "C" fn palpate_version() -> *const c_char {
    const VERSION: Option<&CStr> = match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes())
    {
        Ok(version) => Some(version),
        Err(_) => None,
    };
    VERSION.unwrap_or(c"").as_ptr()
}

/// What was wrong with the calling thread's last refused call, in one line; empty if there was none. Valid until the next
/// refused call of that thread.
#[unsafe(no_mangle)]
pub extern "C" fn palpate_last_error() -> *const c_char {
    last_error()
}

/// Nanoseconds of the monotonic clock by which ticks are timed (CLOCK_MONOTONIC).
#[unsafe(no_mangle)]
pub extern "C" fn palpate_now_ns() -> u64 {
    palpate_servo::now_ns()
}
