//! The emulated libraries of vendors, and how tests steer them: by functions of C that they export beside the vendor's.
//!
//! The frame of everything here is the person's: right, away, up, from the middle of the workspace; m, N, N m, rad.
#![allow(unsafe_code)] // The functions of a loaded library are called.

use std::env;
use std::ffi::{CString, c_char};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use glam::DVec3;
use libloading::Library;
use palpate_devices::{Buttons, Wrench};

use crate::conformance::{Disturbance, Motors, Tip};

/// Numbers of a tip: position, velocity, orientation as `w x y z`, angular velocity.
pub const TIP_LENGTH: usize = 13;

/// Numbers of the motors: force, torque, and how long ago they were told, s.
pub const MOTORS_LENGTH: usize = 7;

/// Everything that the library says is random.
pub const NONSENSE: u32 = 6;

/// The device has not been calibrated since it was switched on.
pub const UNCALIBRATED: u32 = 7;

/// The motors are off: too warm, or by a button that somebody holds down.
pub const MOTORS_OFF: u32 = 8;

/// Measuring fails as if the device were unplugged. It is not: its motors keep what they have been told.
pub const READS_FAIL: u32 = 9;

/// The library's scheduler does not start.
pub const NO_SCHEDULER: u32 = 10;

/// Number of a disturbance; 0 is none; [`NONSENSE`], [`UNCALIBRATED`], [`MOTORS_OFF`], [`READS_FAIL`] and [`NO_SCHEDULER`] are
/// more.
pub fn disturbance_number(disturbance: Option<Disturbance>) -> u32 {
    match disturbance {
        None => 0,
        Some(Disturbance::Unplugged) => 1,
        Some(Disturbance::DriverError) => 2,
        Some(Disturbance::WrongVersion) => 3,
        Some(Disturbance::SlowReplies) => 4,
        Some(Disturbance::NotFinite) => 5,
    }
}

/// The disturbance of a number.
pub fn disturbance(number: u32) -> Option<Disturbance> {
    match number {
        1 => Some(Disturbance::Unplugged),
        2 => Some(Disturbance::DriverError),
        3 => Some(Disturbance::WrongVersion),
        4 => Some(Disturbance::SlowReplies),
        5 => Some(Disturbance::NotFinite),
        _ => None,
    }
}

/// A tip as numbers.
pub fn tip_numbers(tip: Tip) -> [f64; TIP_LENGTH] {
    let Tip { position: p, velocity: v, orientation: q, angular_velocity: w } = tip;
    [p.x, p.y, p.z, v.x, v.y, v.z, q.w, q.x, q.y, q.z, w.x, w.y, w.z]
}

/// The tip of numbers.
pub fn tip_of_numbers(n: [f64; TIP_LENGTH]) -> Tip {
    Tip {
        position: DVec3::new(n[0], n[1], n[2]),
        velocity: DVec3::new(n[3], n[4], n[5]),
        orientation: glam::DQuat::from_xyzw(n[7], n[8], n[9], n[6]),
        angular_velocity: DVec3::new(n[10], n[11], n[12]),
    }
}

type Reset = unsafe extern "C" fn(*const c_char);
type SetTip = unsafe extern "C" fn(u32, *const [f64; TIP_LENGTH]);
type SetNumber = unsafe extern "C" fn(u32, u32);
type GetMotors = unsafe extern "C" fn(u32, *mut [f64; MOTORS_LENGTH]);
type Hurry = unsafe extern "C" fn(u32);

/// The functions by which an emulated library is steered.
#[derive(Clone, Copy)]
pub struct Steering {
    reset: Reset,
    set_tip: SetTip,
    press: SetNumber,
    motors: GetMotors,
    disturb: SetNumber,
    hurry: Hurry,
}

impl Steering {
    /// Of a library, which stays loaded.
    ///
    /// # Errors
    /// A file that is none of the emulated libraries.
    pub fn load(path: &Path) -> Result<Self, libloading::Error> {
        // SAFETY: the emulated libraries have no initialisation, and export these functions with these types.
        unsafe {
            let library: &'static Library = Box::leak(Box::new(Library::new(path)?));
            Ok(Self {
                reset: *library.get::<Reset>(c"palpate_emulator_reset")?,
                set_tip: *library.get::<SetTip>(c"palpate_emulator_set_tip")?,
                press: *library.get::<SetNumber>(c"palpate_emulator_press")?,
                motors: *library.get::<GetMotors>(c"palpate_emulator_motors")?,
                disturb: *library.get::<SetNumber>(c"palpate_emulator_disturb")?,
                hurry: *library.get::<Hurry>(c"palpate_emulator_hurry")?,
            })
        }
    }

    /// New devices of these models, by commas; those of before are gone.
    pub fn reset(&self, models: &str) {
        let models = CString::new(models).unwrap_or_default();
        // SAFETY: a string that lives for the call; so below for the arrays.
        unsafe { (self.reset)(models.as_ptr()) };
    }

    /// Puts the tip of a device.
    pub fn set_tip(&self, device: u32, tip: Tip) {
        // SAFETY: as above.
        unsafe { (self.set_tip)(device, &tip_numbers(tip)) };
    }

    /// Holds buttons of a device.
    pub fn press(&self, device: u32, buttons: Buttons) {
        // SAFETY: numbers.
        unsafe { (self.press)(device, buttons.0) };
    }

    /// What the motors of a device put out.
    pub fn motors(&self, device: u32) -> Motors {
        let mut numbers = [0.0; MOTORS_LENGTH];
        // SAFETY: as above.
        unsafe { (self.motors)(device, &mut numbers) };
        let [fx, fy, fz, tx, ty, tz, ago] = numbers;
        let at = Instant::now().checked_sub(Duration::from_secs_f64(ago)).unwrap_or_else(Instant::now);
        Motors { wrench: Wrench { force: DVec3::new(fx, fy, fz), torque: DVec3::new(tx, ty, tz) }, at }
    }

    /// Makes something go wrong with a device, by the number of [`disturbance_number`], [`NONSENSE`], [`UNCALIBRATED`],
    /// [`MOTORS_OFF`], [`READS_FAIL`] or [`NO_SCHEDULER`].
    pub fn disturb(&self, device: u32, number: u32) {
        // SAFETY: numbers.
        unsafe { (self.disturb)(device, number) };
    }

    /// Lets a scheduler tick without pauses.
    pub fn hurry(&self, as_fast_as_possible: bool) {
        // SAFETY: a number.
        unsafe { (self.hurry)(as_fast_as_possible.into()) };
    }
}

/// Where a test finds an emulated library: cargo builds it beside the test.
///
/// # Panics
/// When it is not there.
pub fn built_library(name: &str) -> PathBuf {
    let test = env::current_exe().expect("a test has a file");
    let file = libloading::library_filename(name);
    let beside = test.parent().map(|folder| folder.join(&file));
    let above = test.parent().and_then(Path::parent).map(|folder| folder.join(&file));
    let found = [beside, above].into_iter().flatten().find(|path| path.exists());
    found.unwrap_or_else(|| panic!("{} is not built beside {}", file.display(), test.display()))
}
