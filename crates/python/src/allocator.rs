//! The allocator of the C library during a precomputation.
#![allow(unsafe_code)] // libc

use std::sync::Once;

/// Smallest block that is taken from the system and given back to it by itself, bytes.
#[cfg(target_env = "gnu")]
const MAPPED: libc::c_int = 4 << 20;
/// What may stay free at the end of small blocks, bytes: once the size above is set it would be 128 kB, and a fifth of the
/// time of a body of 1404 nodes went into giving pages back and taking them again.
#[cfg(target_env = "gnu")]
const KEPT: libc::c_int = 64 << 20;

/// Gives large blocks back to the system as soon as they are freed.
///
/// glibc raises the size from which it does so to that of the largest block ever freed, up to 32 MB. Fronts of a
/// factorisation then lie between what is kept of it, and what they leave is neither used nor given back. Peaks beside what
/// was planned, and seconds: 62k tetrahedra of which a second factor is made 1.50, 10.0 s; with this size 1.15, 10 to 11 s;
/// with 1 MB 1.11, 11.2 s, and with one factor of 216k tetrahedra 40 % more time for the system's part.
pub fn return_large_blocks() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // SAFETY: mallopt only sets parameters of the allocator.
        #[cfg(target_env = "gnu")]
        unsafe {
            libc::mallopt(libc::M_MMAP_THRESHOLD, MAPPED);
            libc::mallopt(libc::M_TRIM_THRESHOLD, KEPT);
        }
    });
}

/// Gives back what was freed of small blocks: most of it lies between others, and would be held beside what comes next.
pub fn return_free_pages() {
    // SAFETY: malloc_trim changes nothing that is in use.
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    unsafe {
        libc::malloc_trim(0);
    }
}
