//! Calls of DHD with Rust's types.
#![allow(unsafe_code)] // Every call into the vendor's library is one.

use std::ffi::c_int;

use glam::DVec3;

use super::ffi::{self, Api, Id, error, result, status};
use crate::library::{Libraries, LibrarySearch, LoadedLibrary, text};
use crate::{Connection, DeviceFault, OpenError};

const SEARCH: LibrarySearch = LibrarySearch {
    product: "Force Dimension's SDK",
    variable: "PALPATE_FORCEDIMENSION_LIBRARY",
    names: &["libdrd.so", "libdrd.so.3", "libdhd.so", "libdhd.so.3"],
    // The first is what bindings of the SDK agree on.
    folders: &[("FDSDK", "lib"), ("FDSDK", "lib/release/lin-x86_64-gcc"), ("FDSDK", "bin")],
    advice: "install the Force Dimension SDK 3",
};

static LIBRARIES: Libraries<Api> = Libraries::new();

/// Earliest version of the SDK whose functions are the ones declared here.
const FIRST_VERSION: c_int = 3;

/// Facts by name.
pub type Facts = Vec<(&'static str, String)>;

/// The library, loaded.
#[derive(Clone, Copy)]
pub struct Dhd(&'static Api);

/// What a successful call says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freshness {
    /// Measured for this call.
    Fresh,
    /// What the last call had: this one came too early for the library.
    Cached,
}

impl Dhd {
    /// Finds and loads it, and looks whether it is of a version that works.
    pub fn load(connection: &Connection) -> Result<(Self, Facts), OpenError> {
        let LoadedLibrary { path, api } = LIBRARIES.get(&SEARCH, connection, Api::bind)?;
        let mut version = [0; 4];
        let [major, minor, release, revision] = &mut version;
        // SAFETY: four pointers to integers of the caller.
        unsafe { (api.sdk_version)(major, minor, release, revision) };
        let text = version.map(|number| number.to_string()).join(".");
        if version[0] < FIRST_VERSION {
            let what = format!("{} is version {text} of Force Dimension's SDK", path.display());
            return Err(OpenError::new(what, format!("install version {FIRST_VERSION} or later")));
        }
        Ok((Self(api), vec![("library", path.display().to_string()), ("SDK version", text)]))
    }

    fn check(self, returned: c_int) -> Result<Freshness, c_int> {
        match returned {
            // The error belongs to this thread until its next call.
            // SAFETY: no arguments.
            ..=-1 => Err(unsafe { (self.0.last_error)() }),
            result::TIMEGUARD => Ok(Freshness::Cached),
            // Among them that a motor is saturated: the force has its direction.
            _ => Ok(Freshness::Fresh),
        }
    }

    /// What an error's number means.
    pub fn error_text(self, code: c_int) -> String {
        // SAFETY: any number may be asked for.
        let text = unsafe { text((self.0.error_text)(code)) };
        if text.is_empty() { format!("error {code}") } else { format!("error {code}, {text}") }
    }

    /// How many devices there are.
    pub fn count(self) -> usize {
        // SAFETY: no arguments.
        let count = unsafe { (self.0.device_count)() };
        // Identities are signed bytes.
        count.clamp(0, i8::MAX.into()) as usize
    }

    /// Opens a device by its rank; -1 is the first that is free.
    pub fn open(self, rank: i8) -> Result<Id, c_int> {
        // SAFETY: any number may be asked for.
        let returned = unsafe { (self.0.open)(ffi::id(rank)) };
        self.check(returned)?;
        i8::try_from(returned).map(ffi::id).map_err(|_| error::NO_DEVICE_FOUND)
    }

    pub fn close(self, id: Id) {
        // SAFETY: identities that are not open are refused by the library; so below.
        unsafe { (self.0.close)(id) };
    }

    pub fn enable_force(self, on: bool, id: Id) -> Result<Freshness, c_int> {
        // SAFETY: as above.
        self.check(unsafe { (self.0.enable_force)(on.into(), id) })
    }

    pub fn compensate_gravity(self, id: Id) -> Result<Freshness, c_int> {
        // SAFETY: as above.
        self.check(unsafe { (self.0.gravity_compensation)(1, id) })
    }

    /// Lets the device switch its motors off by itself when it gets no force for a number of 125 microseconds.
    pub fn watch(self, ticks: u8, id: Id) {
        if let (Some(expert_mode), Some(watchdog)) = (self.0.expert_mode, self.0.watchdog) {
            // SAFETY: as above.
            unsafe {
                expert_mode();
                watchdog(ticks, id);
            }
        }
    }

    fn vector(
        self,
        get: unsafe extern "system" fn(*mut f64, *mut f64, *mut f64, Id) -> c_int,
        id: Id,
    ) -> Result<(DVec3, Freshness), c_int> {
        let mut vector = DVec3::NAN;
        let DVec3 { x, y, z } = &mut vector;
        // SAFETY: three pointers to numbers of the caller.
        let freshness = self.check(unsafe { get(x, y, z, id) })?;
        Ok((vector, freshness))
    }

    /// m, in the vendor's frame.
    pub fn position(self, id: Id) -> Result<(DVec3, Freshness), c_int> {
        self.vector(self.0.position, id)
    }

    /// m/s, in the vendor's frame.
    pub fn linear_velocity(self, id: Id) -> Result<DVec3, c_int> {
        Ok(self.vector(self.0.linear_velocity, id)?.0)
    }

    /// rad/s, in the vendor's frame; zero in libraries that do not tell it.
    pub fn angular_velocity(self, id: Id) -> Result<DVec3, c_int> {
        self.0.angular_velocity.map_or(Ok(DVec3::ZERO), |get| Ok(self.vector(get, id)?.0))
    }

    /// Rows of the rotation matrix, in the vendor's frame.
    pub fn orientation(self, id: Id) -> Result<[[f64; 3]; 3], c_int> {
        let mut rows = [[f64::NAN; 3]; 3];
        // SAFETY: nine numbers of the caller.
        self.check(unsafe { (self.0.orientation)(&mut rows, id) })?;
        Ok(rows)
    }

    pub fn buttons(self, id: Id) -> u32 {
        // SAFETY: as above.
        unsafe { (self.0.button_mask)(id) }
    }

    /// N, in the vendor's frame.
    pub fn set_force(self, force: DVec3, id: Id) -> Result<Freshness, c_int> {
        // SAFETY: numbers.
        self.check(unsafe { (self.0.set_force)(force.x, force.y, force.z, id) })
    }

    /// N and N m, in the vendor's frame.
    pub fn set_force_and_torque(self, force: DVec3, torque: DVec3, id: Id) -> Result<Freshness, c_int> {
        // SAFETY: numbers.
        let returned =
            unsafe { (self.0.set_force_and_torque)(force.x, force.y, force.z, torque.x, torque.y, torque.z, id) };
        self.check(returned)
    }

    /// No force, and where there are motors of rotation no torque.
    pub fn release(self, has_active_wrist: bool, id: Id) -> Result<Freshness, c_int> {
        match has_active_wrist {
            true => self.set_force_and_torque(DVec3::ZERO, DVec3::ZERO, id),
            false => self.set_force(DVec3::ZERO, id),
        }
    }

    pub fn status(self, id: Id) -> Result<[c_int; status::LENGTH], c_int> {
        let mut status = [0; status::LENGTH];
        // SAFETY: more integers of the caller than the vendor's header says.
        self.check(unsafe { (self.0.status)(&mut status, id) })?;
        Ok(status)
    }

    /// Number of the model.
    pub fn system_type(self, id: Id) -> c_int {
        // SAFETY: as above.
        unsafe { (self.0.system_type)(id) }
    }

    /// Of the device; none where the library or the device does not tell it.
    pub fn serial(self, id: Id) -> Option<u16> {
        let mut serial = 0;
        // SAFETY: a number of the caller.
        let returned = unsafe { (self.0.serial_number?)(&mut serial, id) };
        (returned >= 0 && serial != 0).then_some(serial)
    }

    /// Name of the model; empty if there is none.
    pub fn system_name(self, id: Id) -> String {
        // SAFETY: the library's constant string, or null.
        unsafe { text((self.0.system_name)(id)) }
    }

    /// Whether it senses orientation, and whether it has motors of rotation.
    pub fn wrist(self, id: Id) -> (bool, bool) {
        // SAFETY: as above.
        unsafe { ((self.0.has_wrist)(id) != 0, (self.0.has_active_wrist)(id) != 0) }
    }

    /// A limit of force that has been set in the library, N.
    pub fn max_force(self, id: Id) -> Option<f64> {
        // SAFETY: as above.
        let limit = unsafe { (self.0.max_force?)(id) };
        (limit > 0.0 && limit.is_finite()).then_some(limit)
    }
}

/// A fault by an error's number.
pub fn fault(code: c_int) -> DeviceFault {
    match code {
        error::COMMUNICATION | error::NO_DRIVER_FOUND | error::NO_DEVICE_FOUND | error::NOT_AVAILABLE => {
            DeviceFault::Disconnected
        }
        error::TIMEOUT => DeviceFault::Stale,
        code => DeviceFault::Driver(code),
    }
}
