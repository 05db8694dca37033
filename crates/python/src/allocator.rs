//! Settings of the C library's allocator during a precomputation, and a check of the memory for matrix products.
#![allow(unsafe_code)] // libc

use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

use palpate_core::{Error, Result};

/// Smallest block that is taken from the system and given back to it by itself, bytes.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const MAPPED: libc::c_int = 4 << 20;
/// What may stay free at the end of small blocks, bytes: once the size above is set it would be 128 kB, and a fifth of the
/// time of a body of 1404 nodes went into giving pages back and taking them again.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const TRIM_THRESHOLD: libc::c_int = 64 << 20;

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
        #[cfg(all(target_os = "linux", target_env = "gnu"))]
        unsafe {
            libc::mallopt(libc::M_MMAP_THRESHOLD, MAPPED);
            libc::mallopt(libc::M_TRIM_THRESHOLD, TRIM_THRESHOLD);
        }
    });
}

/// Refuses work that multiplies matrices where the system does not give the scratch of that.
///
/// The library that multiplies them takes twice the third level cache for each thread at its first product, whatever the
/// matrices, and ends the process where it does not get it. Most of it is never written: it takes addresses, not memory.
///
/// # Errors
/// [`Error::Memory`], with how much it is.
pub fn require_scratch_of_products() -> Result<()> {
    static SCRATCH_CHECKED: AtomicBool = AtomicBool::new(false);
    // The threads of the pool, and the one that calls.
    let (threads, each) = (rayon::current_num_threads() + 1, 2 * third_level_cache());
    if SCRATCH_CHECKED.load(Ordering::Relaxed) {
        return Ok(());
    }
    let mut probes = vec![Vec::<u8>::new(); threads];
    let refused = probes.iter_mut().any(|probe| probe.try_reserve_exact(each).is_err());
    drop(probes);
    if !refused {
        SCRATCH_CHECKED.store(true, Ordering::Relaxed);
        return Ok(());
    }
    let (all, each) = (threads as f64 * each as f64 / 1e9, each as f64 / 1e9);
    Err(Error::Memory(format!(
        "products of matrices reserve {all:.1} GB of addresses on this machine, {each:.1} GB a thread: raise the limit of \
         this process ('ulimit -v'), or let RAYON_NUM_THREADS ask for fewer threads"
    )))
}

/// Bytes of the third level cache, as far as the system reports it.
fn third_level_cache() -> usize {
    let text = std::fs::read_to_string("/sys/devices/system/cpu/cpu0/cache/index3/size").unwrap_or_default();
    let (number, unit) = text.trim().split_at(text.trim().find(char::is_alphabetic).unwrap_or(text.trim().len()));
    let unit = match unit {
        "G" => 1 << 30,
        "M" => 1 << 20,
        "K" => 1 << 10,
        _ => 1,
    };
    number.parse::<usize>().unwrap_or(0) * unit
}

/// Gives back what was freed of small blocks: most of it lies between others, and would be held beside what comes next.
pub fn return_free_pages() {
    // SAFETY: malloc_trim changes nothing that is in use.
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    unsafe {
        libc::malloc_trim(0);
    }
}
