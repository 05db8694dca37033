//! State of the library beside its devices: one stack of errors, the device of the calls that name none.

use std::ffi::c_int;

use crate::numbers::INVALID_HANDLE;

/// Most errors on the stack.
const DEEPEST: usize = 64;

/// An entry of the stack, as the library returns it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct ErrorInfo {
    pub code: u32,
    pub internal: c_int,
    pub device: u32,
}

/// What the library has beside its devices.
pub struct Library {
    /// Device of the calls that name none.
    pub current: u32,
    /// Ticks without pauses.
    pub fast: bool,
    errors: Vec<ErrorInfo>,
}

impl Default for Library {
    fn default() -> Self {
        Self { current: INVALID_HANDLE, fast: false, errors: Vec::new() }
    }
}

impl Library {
    pub fn raise(&mut self, code: u32, device: u32) {
        if self.errors.len() == DEEPEST {
            self.errors.remove(0);
        }
        self.errors.push(ErrorInfo { code, internal: code as c_int, device });
    }

    /// The newest error.
    pub fn pop(&mut self) -> ErrorInfo {
        self.errors.pop().unwrap_or(ErrorInfo { device: self.current, ..ErrorInfo::default() })
    }
}
