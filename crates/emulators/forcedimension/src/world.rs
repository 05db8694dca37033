//! All devices of the library and the errors of its threads.

use std::cell::Cell;
use std::env;
use std::ffi::{c_char, c_int};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use crate::device::Device;
use crate::error;
use crate::models::{USUAL, model};

/// Environment variable with the models that are plugged in, by commas.
const VARIABLE: &str = "PALPATE_EMULATED_FORCEDIMENSION";

/// The library's state.
pub struct World {
    pub devices: Vec<Device>,
    pub expert: bool,
    /// Of the random numbers of nonsense.
    random: u64,
}

impl World {
    pub fn new(models: &str) -> Self {
        let devices = models.split(',').filter_map(|name| model(name.trim())).map(Device::new).collect();
        Self { devices, expert: false, random: 0x9E37_79B9_7F4A_7C15 }
    }

    /// Ranks of what is plugged in.
    pub fn plugged(&self) -> Vec<usize> {
        (0..self.devices.len()).filter(|rank| self.devices[*rank].is_plugged()).collect()
    }

    /// An open device by its number; -1 is the first that is open.
    pub fn find(&self, id: c_char) -> Option<usize> {
        match i8::from_ne_bytes(id.to_ne_bytes()) {
            -1 => self.devices.iter().position(|device| device.open),
            id => usize::try_from(id).ok().filter(|id| *id < self.devices.len()),
        }
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
            _ => (bits >> 12) as f64 * 1e-17 - 0.02,
        }
    }
}

pub fn world() -> MutexGuard<'static, World> {
    static WORLD: OnceLock<Mutex<World>> = OnceLock::new();
    WORLD
        .get_or_init(|| Mutex::new(World::new(&env::var(VARIABLE).unwrap_or_else(|_| USUAL.to_owned()))))
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
}

thread_local! {
    static LAST_ERROR: Cell<c_int> = const { Cell::new(error::NONE) };
}

/// The error of this thread's last call.
pub fn last_error() -> c_int {
    LAST_ERROR.get()
}

/// What a call returns; its error is kept for the thread.
pub fn returned(result: Result<c_int, c_int>) -> c_int {
    LAST_ERROR.set(result.err().unwrap_or(error::NONE));
    result.unwrap_or(-1)
}

/// Something with a device, as the library's functions do it.
pub fn with(id: c_char, act: impl FnOnce(&mut Device) -> Result<c_int, c_int>) -> c_int {
    let mut world = world();
    returned(match world.find(id) {
        Some(rank) => {
            let device = &mut world.devices[rank];
            device.begin_call().and_then(|()| act(device))
        }
        None => Err(error::INVALID_INDEX),
    })
}

/// The same for three numbers of the caller, that become nonsense where it is asked for.
pub fn vector(id: c_char, get: impl FnOnce(&mut Device) -> Result<([f64; 3], c_int), c_int>) -> (c_int, [f64; 3]) {
    let mut values = [0.0; 3];
    let result = with(id, |device| {
        let (vector, code) = get(device)?;
        values = vector;
        Ok(code)
    });
    (result, values)
}

/// Random numbers in the place of these, if the device talks nonsense.
pub fn perhaps_nonsense(id: c_char, code: c_int, values: &mut [f64]) -> c_int {
    let mut world = world();
    if !world.find(id).is_some_and(|rank| world.devices[rank].nonsense) {
        return code;
    }
    for value in values {
        *value = world.number();
    }
    [0, 0, 0, 1, 2, -1, i32::MIN, i32::MAX][world.bits() as usize % 8]
}
