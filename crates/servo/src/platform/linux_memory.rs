//! Linux: memory that is never swapped out: what a tick reads of its model, the stack of its thread, the code it runs.
//!
//! Not all of the process (`mlockall`): that also makes present and locks whatever the process has mapped and does not use.
//! The scratch of matrix products is twice the third level cache for each thread: 3.9 GB for a store of 0.2 GB were measured.
#![allow(unsafe_code)] // libc

use std::ops::Range;

use palpate_core::memory::Ranges;

/// Asks for the pages of `memory`; whether they were granted.
pub fn lock(memory: Ranges) -> bool {
    memory.pages(page()).into_iter().all(lock_pages)
}

/// Asks for the stack of the calling thread and for the code of this library; whether they were granted.
pub fn lock_thread() -> bool {
    let mut memory = Ranges::default();
    memory.add_addresses(stack());
    code().into_iter().for_each(|segment| memory.add_addresses(segment));
    lock(memory)
}

fn page() -> usize {
    // SAFETY: takes and returns numbers.
    usize::try_from(unsafe { libc::sysconf(libc::_SC_PAGESIZE) }).unwrap_or(4096)
}

fn lock_pages(pages: Range<usize>) -> bool {
    // SAFETY: mlock reads and writes nothing; of pages that are not mapped it returns an error.
    unsafe { libc::mlock(pages.start as *const libc::c_void, pages.len()) == 0 }
}

/// Addresses of the stack of this thread.
fn stack() -> Range<usize> {
    // SAFETY: the attributes are filled in by the first call, read by the second, and freed by the third.
    unsafe {
        let mut attributes = std::mem::zeroed();
        if libc::pthread_getattr_np(libc::pthread_self(), &mut attributes) != 0 {
            return 0..0;
        }
        let (mut lowest, mut size) = (std::ptr::null_mut(), 0);
        let known = libc::pthread_attr_getstack(&attributes, &mut lowest, &mut size) == 0;
        libc::pthread_attr_destroy(&mut attributes);
        if known { lowest.addr()..lowest.addr() + size } else { 0..0 }
    }
}

/// Addresses of the loaded segments of the library or program that holds this function.
fn code() -> Vec<Range<usize>> {
    let mut segments = Vec::new();
    // SAFETY: the function is called with the pointer given here, before the call returns.
    unsafe { libc::dl_iterate_phdr(Some(segments_of), (&raw mut segments).cast()) };
    segments
}

/// Takes the segments of an object into the vector at `found`, if this function lies in one of them; 1 ends the search.
unsafe extern "C" fn segments_of(
    object: *mut libc::dl_phdr_info,
    _size: usize,
    found: *mut libc::c_void,
) -> libc::c_int {
    // SAFETY: the system describes an object with so many headers, and `found` is what `code` gave.
    let (object, headers, found) = unsafe {
        let object = &*object;
        let headers = std::slice::from_raw_parts(object.dlpi_phdr, object.dlpi_phnum.into());
        (object, headers, &mut *found.cast::<Vec<Range<usize>>>())
    };
    let segments = headers.iter().filter(|header| header.p_type == libc::PT_LOAD).map(|header| {
        let start = (object.dlpi_addr + header.p_vaddr) as usize;
        start..start + header.p_memsz as usize
    });
    let segments: Vec<Range<usize>> = segments.collect();
    let here = (segments_of as *const ()).addr();
    if !segments.iter().any(|segment| segment.contains(&here)) {
        return 0;
    }
    *found = segments;
    1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stack_and_the_code_are_those_of_this_thread() {
        let here = 0u8;
        assert!(stack().contains(&std::ptr::from_ref(&here).addr()));
        let function = (lock_thread as *const ()).addr();
        assert!(code().iter().any(|segment| segment.contains(&function)));
    }

    #[test]
    fn only_what_is_asked_for_is_locked() {
        let locked = || -> u64 {
            let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
            let line = status.lines().find_map(|line| line.strip_prefix("VmLck:")).unwrap_or("0 kB");
            line.trim().trim_end_matches(" kB").parse().unwrap_or(0)
        };
        let (mapped, before) = (vec![0u8; 64 << 20], locked());
        let mut memory = Ranges::default();
        memory.add(&mapped[..1 << 20]);
        // A machine may refuse; then nothing is locked.
        let granted = lock(memory);
        let more = locked() - before;
        assert!(!granted && more == 0 || (1024..1100).contains(&more), "{more} kB");
    }
}
