//! Calls of HD with Rust's types.
#![allow(unsafe_code)] // Every call into the vendor's library is one.

use std::ffi::{CString, c_void};

use super::ffi::{self, Api, Callback, Enum, Handle, INVALID_HANDLE, SchedulerHandle, error, parameter};
use crate::library::{Libraries, LibrarySearch, LoadedLibrary, text};
use crate::{Connection, OpenError};

const SEARCH: LibrarySearch = LibrarySearch {
    product: "OpenHaptics (HD)",
    variable: "PALPATE_OPENHAPTICS_LIBRARY",
    names: &["libHD.so", "libHD.so.3.5", "libHD.so.3.4", "libHD.so.3.0", "libHD.so.3"],
    folders: &[("GTDD_HOME", "lib"), ("OH_SDK_BASE", "lib")],
    advice: "install 3D Systems' device driver and OpenHaptics 3",
};

static LIBRARIES: Libraries<Api> = Libraries::new();

/// Most errors that are taken off the stack at once: it is the library's, and may be of any length.
const MOST_ERRORS: usize = 32;

/// The library, loaded.
#[derive(Clone, Copy)]
pub struct Hd(&'static Api);

impl Hd {
    /// Finds and loads it; and the name of its file.
    pub fn load(connection: &Connection) -> Result<(Self, String), OpenError> {
        let LoadedLibrary { path, api } = LIBRARIES.get(&SEARCH, connection, Api::bind)?;
        Ok((Self(api), path.display().to_string()))
    }

    /// Whether it is the same library.
    pub fn is(self, other: Hd) -> bool {
        std::ptr::eq(self.0, other.0)
    }

    /// Takes errors off the stack, the newest first, and gives them to `each`.
    pub fn drain_errors(self, mut each: impl FnMut(Enum, Handle)) {
        for _ in 0..MOST_ERRORS {
            // SAFETY: no arguments.
            let info = unsafe { (self.0.get_error)() };
            if info.code == error::SUCCESS {
                return;
            }
            each(info.code, info.device);
        }
    }

    /// The oldest error on the stack, which is then empty: what came first is why the others came.
    pub fn first_error(self) -> Option<Enum> {
        let mut first = None;
        self.drain_errors(|code, _| first = Some(code));
        first
    }

    /// What an error's number means.
    pub fn error_text(self, code: Enum) -> String {
        // SAFETY: any number may be asked for.
        let text = unsafe { text((self.0.error_string)(code)) };
        if text.is_empty() { format!("error 0x{code:04X}") } else { format!("error 0x{code:04X}, {text}") }
    }

    /// Initialises a device by its name, or the default one.
    pub fn init(self, name: Option<&CString>) -> Result<Handle, Enum> {
        let name = name.map_or(std::ptr::null(), |name| name.as_ptr());
        self.first_error();
        // SAFETY: null or a string that lives for the call.
        let handle = unsafe { (self.0.init_device)(name) };
        match self.first_error() {
            None if handle != INVALID_HANDLE => Ok(handle),
            None => Err(error::DEVICE_FAULT),
            Some(code) => {
                if handle != INVALID_HANDLE {
                    self.disable_device(handle);
                }
                Err(code)
            }
        }
    }

    pub fn disable_device(self, handle: Handle) {
        // SAFETY: handles that are none are refused by the library; so below.
        unsafe { (self.0.disable_device)(handle) };
    }

    /// The device of all calls without a handle.
    pub fn make_current(self, handle: Handle) {
        // SAFETY: as above.
        unsafe { (self.0.make_current)(handle) };
    }

    pub fn enable(self, capability: Enum) {
        // SAFETY: a number.
        unsafe { (self.0.enable)(capability) };
    }

    pub fn begin_frame(self, handle: Handle) {
        // SAFETY: as above.
        unsafe { (self.0.begin_frame)(handle) };
    }

    pub fn end_frame(self, handle: Handle) {
        // SAFETY: as above.
        unsafe { (self.0.end_frame)(handle) };
    }

    /// Of the current device; not a number where the library writes nothing.
    pub fn doubles<const N: usize>(self, parameter: Enum) -> [f64; N] {
        // The longest of all parameters has sixteen: a library that writes more than was asked for meets memory of ours.
        const LONGEST: usize = 16;
        let mut values = [f64::NAN; LONGEST];
        // SAFETY: at least as many numbers as any parameter has.
        unsafe { (self.0.get_doubles)(parameter, values.as_mut_ptr()) };
        std::array::from_fn(|entry| values[entry])
    }

    /// Of the current device; zero where the library writes nothing.
    pub fn integer(self, parameter: Enum) -> i32 {
        let mut values = [0; 16];
        // SAFETY: as above.
        unsafe { (self.0.get_integers)(parameter, values.as_mut_ptr()) };
        values[0]
    }

    /// Of the current device.
    pub fn boolean(self, parameter: Enum) -> bool {
        let mut values = [0; 16];
        // SAFETY: as above.
        unsafe { (self.0.get_booleans)(parameter, values.as_mut_ptr()) };
        values[0] != 0
    }

    /// Of the current device, on one line; empty if there is none.
    pub fn string(self, parameter: Enum) -> String {
        // SAFETY: the library's string or null.
        unsafe { text((self.0.get_string)(parameter)) }
    }

    /// For the current device.
    pub fn set_doubles(self, parameter: Enum, values: [f64; 3]) {
        // SAFETY: three numbers, as forces and torques have.
        unsafe { (self.0.set_doubles)(parameter, values.as_ptr()) };
    }

    /// Whether the current device is calibrated.
    pub fn calibration(self) -> Enum {
        // SAFETY: no arguments.
        unsafe { (self.0.check_calibration)() }
    }

    /// Calibrates the current device in the ways that it knows.
    pub fn calibrate(self) {
        let style = self.integer(parameter::CALIBRATION_STYLE) as Enum;
        // SAFETY: a number.
        unsafe { (self.0.update_calibration)(style) };
    }

    /// Has the scheduler call a function at each of its ticks.
    ///
    /// # Safety
    /// `data` is what `callback` expects, until it is unscheduled and the scheduler has stopped.
    pub unsafe fn schedule(self, callback: Callback, data: *mut c_void) -> SchedulerHandle {
        // SAFETY: by the caller.
        unsafe { (self.0.schedule)(callback, data, ffi::DEFAULT_PRIORITY) }
    }

    pub fn unschedule(self, handle: SchedulerHandle) {
        // SAFETY: handles that are none are refused by the library.
        unsafe { (self.0.unschedule)(handle) };
    }

    pub fn start_scheduler(self) {
        // SAFETY: no arguments.
        unsafe { (self.0.start_scheduler)() };
    }

    /// When it returns, no callback runs.
    pub fn stop_scheduler(self) {
        // SAFETY: no arguments.
        unsafe { (self.0.stop_scheduler)() };
    }
}
