//! Steering of an emulated library by a test: its loaded functions, and changes to its devices.
#![allow(unsafe_code)] // The functions of a loaded library are called.

use std::collections::BTreeMap;
use std::env;
use std::ffi::{CString, c_char};
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use glam::DVec3;
use libloading::Library;
use palpate_devices::{Buttons, Connection, Wrench};

use crate::conformance::Disturbance;
use crate::tip::Tip;

/// The functions by which an emulated library is steered; devices are named by their rank.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Steering {
    pub(super) reset: unsafe extern "C" fn(*const c_char),
    pub(super) set_tip: extern "C" fn(u32, Tip),
    pub(super) press: extern "C" fn(u32, u32),
    pub(super) motors: extern "C" fn(u32) -> Motors,
    pub(super) disturb: extern "C" fn(u32, u32),
    pub(super) run_fast: extern "C" fn(bool),
}

/// What the motors put out, N and N m.
#[repr(C)]
pub(super) struct Motors {
    pub force: DVec3,
    pub torque: DVec3,
}

impl Steering {
    /// Replaces the devices by new ones, named by commas as in the library's environment variable.
    pub fn reset(&self, devices: &str) {
        let devices = CString::new(devices).unwrap_or_default();
        // SAFETY: a string that lives for the call.
        unsafe { (self.reset)(devices.as_ptr()) };
    }

    /// Puts the tip of a device.
    pub fn set_tip(&self, device: u32, tip: Tip) {
        (self.set_tip)(device, tip);
    }

    /// Holds buttons of a device.
    pub fn press(&self, device: u32, buttons: Buttons) {
        (self.press)(device, buttons.0);
    }

    /// What the motors of a device put out.
    pub fn motors(&self, device: u32) -> Wrench {
        let Motors { force, torque } = (self.motors)(device);
        Wrench { force, torque }
    }

    /// Makes something go wrong with a device, instead of what went wrong before; `None`: all is well again.
    pub fn disturb(&self, device: u32, disturbance: Option<Disturbance>) {
        (self.disturb)(device, Disturbance::number(disturbance));
    }

    /// Lets a scheduler tick without pauses.
    pub fn run_fast(&self, as_fast_as_possible: bool) {
        (self.run_fast)(as_fast_as_possible);
    }
}

/// An emulated library in one test: the tests of a process share its devices, and use them one after another.
pub struct EmulatedLibrary {
    steering: Steering,
    path: PathBuf,
    _alone: MutexGuard<'static, ()>,
}

impl EmulatedLibrary {
    /// Loads a library that cargo has built beside the test, and plugs in devices as its environment variable names them. It
    /// stays loaded. Other tests that use it wait until this one is dropped.
    ///
    /// # Panics
    /// When the library is not there, or is not an emulated one.
    pub fn with_devices(name: &str, devices: &str) -> Self {
        let path = built_library(name);
        let alone = lock_of(&path).lock().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: the emulated libraries have no initialisation, and export a value of this type under this name.
        let steering = unsafe {
            let library: &'static Library = Box::leak(Box::new(Library::new(&path).expect("a library that loads")));
            **library.get::<*const Steering>(c"PALPATE_EMULATOR").expect("an emulated library")
        };
        steering.reset(devices);
        Self { steering, path, _alone: alone }
    }

    /// Its functions, also for another thread than the test's.
    pub fn steering(&self) -> Steering {
        self.steering
    }

    /// The connection by which a driver opens one of its devices.
    pub fn connection(&self, id: Option<&str>) -> Connection {
        Connection { id: id.map(str::to_owned), library: Some(self.path.clone()), ..Connection::default() }
    }
}

impl Deref for EmulatedLibrary {
    type Target = Steering;

    fn deref(&self) -> &Steering {
        &self.steering
    }
}

/// The lock of a library.
fn lock_of(path: &Path) -> &'static Mutex<()> {
    static LOCKS: Mutex<BTreeMap<PathBuf, &'static Mutex<()>>> = Mutex::new(BTreeMap::new());
    let mut locks = LOCKS.lock().unwrap_or_else(PoisonError::into_inner);
    locks.entry(path.to_owned()).or_insert_with(|| Box::leak(Box::default()))
}

/// File of a library that cargo has built beside the test.
fn built_library(name: &str) -> PathBuf {
    let test = env::current_exe().expect("a test has a file");
    let file = libloading::library_filename(name);
    let beside = test.parent().map(|folder| folder.join(&file));
    let above = test.parent().and_then(Path::parent).map(|folder| folder.join(&file));
    let found = [beside, above].into_iter().flatten().find(|path| path.exists());
    found.unwrap_or_else(|| panic!("{} is not built beside {}", file.display(), test.display()))
}
