//! State of an emulated library: its devices, and the functions that steering calls.
#![allow(unsafe_code)] // The names of devices come as a string of C.

use std::env;
use std::ffi::{CStr, c_char};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use palpate_devices::Wrench;

use super::hardware::Hardware;
use super::steering::{Motors, Steering};
use crate::conformance::Disturbance;
use crate::tip::Tip;

/// A device of an emulated library.
pub trait Emulated: Sized + Send + 'static {
    /// What the library has beside its devices.
    type Library: Default + Send;

    /// Environment variable with the devices that are plugged in, by commas.
    const VARIABLE: &str;

    /// Devices that are plugged in when it is not set.
    const DEFAULT_DEVICES: &str;

    /// Where the library keeps its world.
    fn world() -> &'static OnceLock<Mutex<World<Self>>>;

    /// The device that an entry of [`Emulated::VARIABLE`] names.
    fn named(entry: &str) -> Option<Self>;

    /// Its part that does not depend on the library.
    fn hardware(&mut self) -> &mut Hardware;

    /// Changes what goes wrong with it.
    fn disturb(&mut self, disturbance: Option<Disturbance>);

    /// What its motors put out now.
    fn motors(&mut self) -> Wrench;

    /// Lets the library's scheduler tick without pauses, if it has one.
    fn run_fast(_as_fast_as_possible: bool) {}
}

/// The state of a library.
pub struct World<D: Emulated> {
    /// Its devices, unplugged ones too.
    pub devices: Vec<D>,
    /// What it has beside them.
    pub library: D::Library,
    /// For devices that answer with random numbers.
    pub random: Random,
}

impl<D: Emulated> World<D> {
    fn new(devices: &str) -> Self {
        let devices = devices.split(',').map(str::trim).filter(|entry| !entry.is_empty()).filter_map(D::named);
        Self { devices: devices.collect(), library: D::Library::default(), random: Random::default() }
    }

    /// Whether this goes wrong with any of the devices.
    pub fn has(&mut self, disturbance: Disturbance) -> bool {
        self.devices.iter_mut().any(|device| device.hardware().has(disturbance))
    }
}

/// Random numbers, the same in every run.
pub struct Random(u64);

impl Default for Random {
    fn default() -> Self {
        Self(0x9E37_79B9_7F4A_7C15)
    }
}

impl Random {
    /// Random bits (Marsaglia's xorshift).
    pub fn bits(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    /// Any number, with many that are none, and many of some centimetres in a unit that is so many to the metre.
    pub fn number(&mut self, units_per_metre: f64) -> f64 {
        let bits = self.bits();
        match bits % 4 {
            0 => f64::from_bits(self.bits()),
            1 => [f64::NAN, f64::INFINITY, -0.0, 1e300][(bits >> 8) as usize % 4],
            _ => units_per_metre * ((bits >> 12) as f64 * 1e-17 - 0.02),
        }
    }
}

/// The world of a library. Its first devices are those that the environment names.
pub fn world<D: Emulated>() -> MutexGuard<'static, World<D>> {
    let plugged_in = || env::var(D::VARIABLE).unwrap_or_else(|_| D::DEFAULT_DEVICES.to_owned());
    D::world().get_or_init(|| Mutex::new(World::new(&plugged_in()))).lock().unwrap_or_else(PoisonError::into_inner)
}

/// The functions by which tests steer the devices of a library, which exports them as `PALPATE_EMULATOR`.
pub const fn steering<D: Emulated>() -> Steering {
    Steering {
        reset: reset::<D>,
        set_tip: set_tip::<D>,
        press: press::<D>,
        motors: motors::<D>,
        disturb: disturb::<D>,
        run_fast: run_fast::<D>,
    }
}

fn with_device<D: Emulated, R: Default>(rank: u32, act: impl FnOnce(&mut D) -> R) -> R {
    world::<D>().devices.get_mut(rank as usize).map(act).unwrap_or_default()
}

unsafe extern "C" fn reset<D: Emulated>(devices: *const c_char) {
    // SAFETY: by the caller a string.
    let devices = unsafe { CStr::from_ptr(devices) }.to_string_lossy();
    *world() = World::<D>::new(&devices);
}

extern "C" fn set_tip<D: Emulated>(rank: u32, tip: Tip) {
    with_device(rank, |device: &mut D| {
        let held = &mut device.hardware().tip;
        held.put(tip, held.time());
    });
}

extern "C" fn press<D: Emulated>(rank: u32, buttons: u32) {
    with_device(rank, |device: &mut D| device.hardware().buttons = buttons);
}

extern "C" fn motors<D: Emulated>(rank: u32) -> Motors {
    let Wrench { force, torque } = with_device(rank, D::motors);
    Motors { force, torque }
}

extern "C" fn disturb<D: Emulated>(rank: u32, number: u32) {
    with_device(rank, |device: &mut D| device.disturb(Disturbance::numbered(number)));
}

extern "C" fn run_fast<D: Emulated>(as_fast_as_possible: bool) {
    D::run_fast(as_fast_as_possible);
}
