//! All devices of the library, its one stack of errors, and which device is current.

use std::env;
use std::ffi::c_int;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use crate::device::Device;
use crate::numbers::{INVALID_HANDLE, error};

/// Environment variable with what is plugged in: models by commas, each with its name in the setup (`Left=PHANTOM Omni`); the
/// first without a name is the default device.
const VARIABLE: &str = "PALPATE_EMULATED_OPENHAPTICS";

/// Name of the default device.
const DEFAULT: &str = "Default Device";

/// Most errors that are kept.
const DEEPEST: usize = 64;

/// An entry of the stack, as the library returns it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct ErrorInfo {
    pub code: u32,
    pub internal: c_int,
    pub device: u32,
}

/// The library's state.
pub struct World {
    pub devices: Vec<Device>,
    /// Device of the calls that name none.
    pub current: u32,
    errors: Vec<ErrorInfo>,
    random: u64,
}

impl World {
    pub fn new(devices: &str) -> Self {
        let named = |one: &str| match one.split_once('=') {
            Some((name, model)) => Device::new(name.trim(), model.trim()),
            None => Device::new(DEFAULT, one.trim()),
        };
        let devices = devices.split(',').filter(|one| !one.trim().is_empty()).map(named).collect();
        Self { devices, current: INVALID_HANDLE, errors: Vec::new(), random: 0x9E37_79B9_7F4A_7C15 }
    }

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

    /// By its name; the default device without one.
    pub fn named(&self, name: Option<&str>) -> Option<u32> {
        let name = name.unwrap_or(DEFAULT);
        self.devices.iter().position(|device| device.name.to_str() == Ok(name)).map(|rank| rank as u32)
    }

    /// A device that is initialised, or an error on the stack.
    pub fn find(&mut self, handle: u32) -> Option<&mut Device> {
        let is_one = self.devices.get(handle as usize).is_some_and(|device| device.initialised);
        if !is_one {
            self.raise(error::BAD_HANDLE, handle);
            return None;
        }
        self.devices.get_mut(handle as usize)
    }

    /// The current device.
    pub fn current(&mut self) -> Option<&mut Device> {
        self.find(self.current)
    }

    /// Random bits (Marsaglia's xorshift).
    pub fn bits(&mut self) -> u64 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        self.random
    }

    /// Any number, with many that are none, and many of the size that is expected.
    pub fn number(&mut self) -> f64 {
        let bits = self.bits();
        match bits % 4 {
            0 => f64::from_bits(self.bits()),
            1 => [f64::NAN, f64::INFINITY, -0.0, 1e300][(bits >> 8) as usize % 4],
            _ => (bits >> 12) as f64 * 1e-14 - 20.0,
        }
    }

    /// Whether the current device talks nonsense.
    pub fn talks_nonsense(&self) -> bool {
        self.devices.get(self.current as usize).is_some_and(|device| device.nonsense)
    }
}

pub fn world() -> MutexGuard<'static, World> {
    static WORLD: OnceLock<Mutex<World>> = OnceLock::new();
    WORLD
        .get_or_init(|| Mutex::new(World::new(&env::var(VARIABLE).unwrap_or_else(|_| "Touch".to_owned()))))
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
}
