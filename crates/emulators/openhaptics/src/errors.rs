//! The library's one stack of errors, and the device of the calls that name none.

use std::ffi::c_int;

use palpate_emulators::library::World;

use crate::device::Device;
use crate::numbers::{INVALID_HANDLE, error};

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
    errors: Vec<ErrorInfo>,
}

impl Default for Library {
    fn default() -> Self {
        Self { current: INVALID_HANDLE, errors: Vec::new() }
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

/// Does something with an initialised device; errors lie on the stack.
pub fn with<R>(world: &mut World<Device>, handle: u32, act: impl FnOnce(&mut Device) -> Result<R, u32>) -> Option<R> {
    let device = world.devices.get_mut(handle as usize).filter(|device| device.is_initialised());
    match device.ok_or(error::BAD_HANDLE).and_then(act) {
        Ok(result) => Some(result),
        Err(code) => {
            world.library.raise(code, handle);
            None
        }
    }
}
