//! The allocator of the C library, told how a precomputation uses memory: in blocks of up to gigabytes, each used whole
//! and then given back.
#![allow(unsafe_code)] // libc

use std::sync::Once;

/// Smallest block that is taken from the system and given back to it by itself, bytes.
const MAPPED: usize = 4 << 20;

/// Gives large blocks back to the system as soon as they are freed.
///
/// glibc raises the size from which it does so to that of the largest block ever freed, up to 32 MB. Fronts of a
/// factorisation then lie between what is kept of it, and what they leave is neither used nor given back. Peaks beside what
/// was planned, and seconds: 62k tetrahedra of which a second factor is made 1.50, 10.0 s; with this size 1.15, 10 to 11 s;
/// with 1 MB 1.11, 11.2 s, and with one factor of 216k tetrahedra 40 % more time for the system's part.
pub fn return_large_blocks() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // SAFETY: mallopt only sets a parameter of the allocator.
        #[cfg(target_env = "gnu")]
        unsafe {
            libc::mallopt(libc::M_MMAP_THRESHOLD, MAPPED as libc::c_int);
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

/// The system's allocator, which asks for huge pages where a block is large.
///
/// A block that is given back is cleared by the system page by page when its memory is next used: of 4 kB each, that is a
/// fault for every 512 numbers of a front.
#[cfg(target_os = "linux")]
mod huge_pages {
    use std::alloc::{GlobalAlloc, Layout, System};

    use super::MAPPED;

    struct HugePages;

    #[global_allocator]
    static ALLOCATOR: HugePages = HugePages;

    /// Asks for huge pages within a block; where there are none it stays as it is.
    fn advise(block: *mut u8, size: usize) -> *mut u8 {
        const PAGE: usize = 2 << 20;
        if size >= MAPPED && !block.is_null() {
            let skipped = block.align_offset(PAGE);
            let length = size.saturating_sub(skipped) / PAGE * PAGE;
            // SAFETY: the range lies within the block; the advice changes no contents.
            unsafe { libc::madvise(block.wrapping_add(skipped).cast(), length, libc::MADV_HUGEPAGE) };
        }
        block
    }

    // SAFETY: all that is handed out comes from the system's allocator and goes back to it, with the same layout.
    unsafe impl GlobalAlloc for HugePages {
        unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
            // SAFETY: the caller's promise.
            advise(unsafe { System.alloc(layout) }, layout.size())
        }

        unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
            // SAFETY: the caller's promise.
            advise(unsafe { System.alloc_zeroed(layout) }, layout.size())
        }

        unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
            // SAFETY: the caller's promise.
            advise(unsafe { System.realloc(block, layout, size) }, size)
        }

        unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
            // SAFETY: the caller's promise.
            unsafe { System.dealloc(block, layout) }
        }
    }
}
