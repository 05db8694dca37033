//! 3D Systems Touch and the PHANTOM devices before it, by the vendor's library of OpenHaptics' HD interface.
//!
//! The library owns the loop: its scheduler calls the tick ([`crate::Scheduler`]), at 1000 Hz.
//!
//! Not verified on hardware, therefore said here: what an unplugged device answers (an error of communication, a fault of the
//! device or a bad handle is taken for it); the polarity of the inkwell's switch, which is told and not used; the unit of the
//! nominal stiffness, told and not used; the unit of torques, taken as N mm, and the frame of angular velocities, taken as that
//! of positions.

mod device;
mod errors;
mod ffi;
mod library;
mod models;
mod scheduler;

use std::ffi::CString;

use self::device::TouchDevice;
use self::ffi::{Enum, Handle, calibration, capability, error, parameter};
use self::library::Hd;
use self::scheduler::HdScheduler;
use crate::{Connection, DeviceLimits, FoundDevice, Listing, OpenError, ReadyDevice};

/// Earliest version of OpenHaptics whose functions are the ones declared here.
const FIRST_VERSION: u32 = 3;

/// Name by which the default device is listed.
const DEFAULT: &str = "Default Device";

/// The devices of this program, and the default one: the library tells no others, which are opened by the name that they
/// have in the vendor's setup.
pub fn list(connection: &Connection) -> Listing {
    let (hd, path) = match Hd::load(connection) {
        Ok(loaded) => loaded,
        Err(error) => return Listing { found: Vec::new(), missing: Some(error), facts: Vec::new() },
    };
    let scheduler = HdScheduler::of(hd);
    let mut listing = Listing { found: Vec::new(), missing: None, facts: vec![("library", path)] };
    for slot in scheduler.open() {
        let id = slot.name.as_ref().map_or(DEFAULT.into(), |name| name.to_string_lossy().into_owned());
        listing.found.push(FoundDevice {
            id,
            name: slot.traits.name.clone(),
            limits: slot.traits.limits,
            obstacle: Some(OpenError::new("it is in use by this program", "close it first")),
            facts: Vec::new(),
        });
    }
    // While the scheduler runs nobody else may call the library.
    if listing.found.iter().all(|found| found.id != DEFAULT) {
        match scheduler.while_idle(|| describe_default(hd)) {
            Some(Ok((found, version))) => {
                listing.found.push(found);
                listing.facts.push(("version", version));
            }
            Some(Err(error)) => listing.missing = Some(error),
            None => (),
        }
    }
    listing
}

/// Opens a device by its name in the vendor's setup, by default the default one. The scheduler of the result is the same for
/// all devices of the library.
///
/// # Errors
/// A library that is not there or too old; no such device, or one that is in use or not calibrated.
pub fn open(connection: &Connection) -> Result<ReadyDevice, OpenError> {
    let (hd, _) = Hd::load(connection)?;
    let name = match connection.id.as_deref().filter(|name| *name != DEFAULT) {
        Some(name) => Some(CString::new(name).map_err(|_| {
            OpenError::new(format!("{name:?} is no name of a device"), "give the one of the vendor's setup")
        })?),
        None => None,
    };
    let scheduler = HdScheduler::of(hd);
    let slot = scheduler.add(name)?;
    let device = TouchDevice::new(scheduler, slot);
    Ok(ReadyDevice { device: Box::new(device), scheduler: Some(scheduler.handout()) })
}

/// What does not change of an open device.
#[derive(Clone, Debug, PartialEq)]
struct Traits {
    name: String,
    limits: DeviceLimits,
}

/// Of the current device.
fn traits(hd: Hd) -> Traits {
    let model = hd.string(parameter::DEVICE_MODEL_TYPE);
    let [nominal_force] = hd.doubles(parameter::NOMINAL_MAX_FORCE);
    let mut limits = models::limits(&model, nominal_force);
    // Three motors of translation, or six.
    if hd.integer(parameter::OUTPUT_DOF) < 6 {
        (limits.max_torque, limits.max_angular_damping) = (0.0, 0.0);
    }
    let serial = hd.string(parameter::DEVICE_SERIAL_NUMBER);
    let model = if model.is_empty() { "device of OpenHaptics".to_owned() } else { model };
    let name = if serial.is_empty() { model } else { format!("{model} {serial}") };
    hd.first_error();
    Traits { name, limits }
}

/// Initialises a device and readies it for forces: these are off until a frame has one. The scheduler is stopped.
fn prepared(hd: Hd, name: Option<&CString>) -> Result<(Handle, Traits), OpenError> {
    let handle = hd.init(name).map_err(|code| open_error(hd, name, code))?;
    hd.make_current(handle);
    let prepare_for_forces = || {
        let traits = traits(hd);
        check_version(&hd.string(parameter::VERSION))?;
        check_calibration(hd, &traits.name)?;
        hd.enable(capability::FORCE_OUTPUT);
        match hd.first_error() {
            None => Ok((handle, traits)),
            Some(code) => Err(open_error(hd, name, code)),
        }
    };
    prepare_for_forces().inspect_err(|_: &OpenError| hd.disable_device(handle))
}

/// A version whose number cannot be read is not refused: how the vendor writes it is not documented.
fn check_version(version: &str) -> Result<(), OpenError> {
    let digits: String = version.chars().skip_while(|c| !c.is_ascii_digit()).take_while(char::is_ascii_digit).collect();
    match digits.parse::<u32>() {
        Ok(major) if major < FIRST_VERSION => {
            let what = format!("the library of OpenHaptics is of version {version}");
            Err(OpenError::new(what, format!("install version {FIRST_VERSION} or later")))
        }
        _ => Ok(()),
    }
}

/// Positions of a device that is not calibrated are wrong, and forces on them dangerous.
fn check_calibration(hd: Hd, name: &str) -> Result<(), OpenError> {
    if hd.calibration() == calibration::NEEDS_UPDATE {
        hd.calibrate();
    }
    if hd.calibration() == calibration::OK {
        return Ok(());
    }
    let what = format!("{name} is not calibrated");
    let inkwell = hd.integer(parameter::CALIBRATION_STYLE) as Enum & calibration::STYLE_INKWELL != 0;
    let advice = match inkwell {
        true => "put its stylus into the inkwell for some seconds, then try again",
        false => "hold it in its rest position, as the vendor's setup shows, then try again",
    };
    Err(OpenError::new(what, advice))
}

fn open_error(hd: Hd, name: Option<&CString>, code: Enum) -> OpenError {
    let device = name.map_or(DEFAULT.into(), |name| name.to_string_lossy());
    let what = format!("the Touch device {device:?} does not open ({})", hd.error_text(code));
    match code {
        error::DEVICE_ALREADY_INITIATED => OpenError::new(what, "close the program that uses it"),
        error::WARM_MOTORS => OpenError::new(what, "let it cool"),
        _ => OpenError::new(what, "plug it in, switch it on, and pair it in the vendor's Touch Setup under that name"),
    }
}

/// The default device and the library's version.
fn describe_default(hd: Hd) -> Result<(FoundDevice, String), OpenError> {
    let handle = hd.init(None).map_err(|code| open_error(hd, None, code))?;
    hd.make_current(handle);
    let Traits { name, limits } = traits(hd);
    let version = hd.string(parameter::VERSION);
    let obstacle = check_version(&version).and_then(|()| check_calibration(hd, &name)).err();
    let [stiffness] = hd.doubles(parameter::NOMINAL_MAX_STIFFNESS);
    let [continuous] = hd.doubles(parameter::NOMINAL_MAX_CONTINUOUS_FORCE);
    let facts = vec![
        ("driver", hd.string(parameter::DEVICE_DRIVER_VERSION)),
        ("nominal stiffness, as the library says", stiffness.to_string()),
        ("continuous force, N", continuous.to_string()),
        ("inkwell switch", u8::from(hd.boolean(parameter::CURRENT_INKWELL_SWITCH)).to_string()),
    ];
    hd.disable_device(handle);
    hd.first_error();
    Ok((FoundDevice { id: DEFAULT.to_owned(), name, limits, obstacle, facts }, version))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn old_versions_are_refused_and_unreadable_ones_are_not() {
        for refused in ["2.0.5", "OpenHaptics 1.9", "0"] {
            assert!(check_version(refused).is_err(), "{refused}");
        }
        for fine in ["3.4.0", "HD 3.5", "10", "", "unknown"] {
            assert!(check_version(fine).is_ok(), "{fine}");
        }
    }
}
