//! What systems without real-time interfaces of their own grant: no priority, no choice of processors, no locked memory.

use palpate_core::memory::Ranges;

/// None is granted.
pub fn request_realtime_priority(_priority: u8) -> bool {
    false
}

/// The system is not asked.
pub fn allowed_cpus() -> Vec<usize> {
    Vec::new()
}

/// Threads keep to no processors.
pub fn keep_to_cpus(_cpus: &[usize]) -> bool {
    false
}

/// None is locked.
pub fn lock(_memory: Ranges) -> bool {
    false
}

/// None is locked.
pub fn lock_thread() -> bool {
    false
}
