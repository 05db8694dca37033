//! Version of the C interface.

/// Raised when a program must be compiled again; part of the library's run-time name.
pub const PALPATE_ABI_MAJOR: u32 = 1;
/// Raised when something has been added.
pub const PALPATE_ABI_MINOR: u32 = 0;
