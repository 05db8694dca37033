//! Haptic devices of this machine: what their drivers find, and a check of one by itself.

use std::path::PathBuf;

use palpate_devices::{Connection, FoundDevice, Listing, OpenError, Opened};
use palpate_servo::{LARGEST_FORCE, SelfCheck, Task};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::errors::{device_error, to_python};
use crate::programmed::{LimitArguments, ProgrammedDevice, limit_arguments};

/// What a driver does.
struct Driver {
    kind: &'static str,
    list: fn(&Connection) -> Listing,
    open: fn(&Connection) -> Result<Opened, OpenError>,
}

/// All of them, by the kind that a scene names.
const DRIVERS: [Driver; 0] = [];

fn driver(kind: &str) -> PyResult<&'static Driver> {
    let found = DRIVERS.iter().find(|driver| driver.kind == kind);
    found.ok_or_else(|| PyValueError::new_err(format!("no driver of kind '{kind}'")))
}

/// Id, address and library, each None for the driver's default.
type ConnectionArguments = (Option<String>, Option<String>, Option<PathBuf>);

fn connection((id, address, library): ConnectionArguments) -> Connection {
    Connection { id, address, library }
}

/// Kinds of devices that there are drivers for.
#[pyfunction]
pub fn device_kinds() -> Vec<&'static str> {
    DRIVERS.iter().map(|driver| driver.kind).collect()
}

/// What a driver sees: `found` with name, id, limits, obstacle and facts of each device; `missing`; `facts` of the driver. What is
/// wrong and what to do about it come as a pair.
#[pyfunction]
pub fn list_devices<'py>(
    py: Python<'py>,
    kind: &str,
    given: ConnectionArguments,
) -> PyResult<Bound<'py, PyDict>> {
    let (driver, connection) = (driver(kind)?, connection(given));
    let listing = py.detach(|| (driver.list)(&connection));
    let found = PyList::empty(py);
    for FoundDevice { id, name, limits, obstacle, facts } in listing.found {
        let device = PyDict::new(py);
        device.set_item("id", id)?;
        device.set_item("name", name)?;
        device.set_item("limits", limit_arguments(&limits))?;
        device.set_item("obstacle", obstacle.map(|why| (why.what, why.advice)))?;
        device.set_item("facts", facts)?;
        found.append(device)?;
    }
    let told = PyDict::new(py);
    told.set_item("found", found)?;
    told.set_item("missing", listing.missing.map(|why| (why.what, why.advice)))?;
    told.set_item("facts", listing.facts)?;
    Ok(told)
}

/// A gentle check of one device: its readings, and small forces that pass the safety stage.
#[pyclass(module = "palpate._native")]
pub struct DeviceCheck {
    check: SelfCheck,
}

#[pymethods]
impl DeviceCheck {
    /// Opens a device and begins to watch it.
    #[staticmethod]
    fn of_driver(py: Python<'_>, kind: &str, given: ConnectionArguments) -> PyResult<Self> {
        let (driver, connection) = (driver(kind)?, connection(given));
        let opened = py.detach(|| (driver.open)(&connection)).map_err(|error| device_error(py, &error))?;
        Self::start(py, opened)
    }

    /// Begins to watch the device of a program.
    #[staticmethod]
    fn of_program(py: Python<'_>, device: &mut ProgrammedDevice) -> PyResult<Self> {
        let taken = device.take().ok_or_else(|| PyValueError::new_err("a loop has taken the device already"))?;
        Self::start(py, taken.0)
    }

    /// Largest force that it can be asked for, N.
    #[classattr]
    #[allow(non_upper_case_globals)]
    const largest_force: f64 = LARGEST_FORCE;

    #[getter]
    fn name(&self) -> &str {
        self.check.name()
    }

    #[getter]
    fn limits(&self) -> LimitArguments {
        limit_arguments(&self.check.limits())
    }

    /// Pushes along a unit vector with a force, N, that rises over `seconds`, or watches along none.
    fn begin(&mut self, py: Python<'_>, direction: [f64; 3], force: f64, seconds: f64) -> PyResult<()> {
        let task = Task { direction: direction.into(), force, seconds };
        self.check.begin(task).map_err(|error| to_python(py, error))
    }

    /// What has been seen of it so far; None before its first tick.
    fn seen<'py>(&mut self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(seen) = self.check.seen() else { return Ok(None) };
        let told = PyDict::new(py);
        told.set_item("time", seen.time)?;
        told.set_item("readings", seen.readings)?;
        told.set_item("fresh", seen.fresh)?;
        told.set_item("longest_gap", seen.longest_gap)?;
        told.set_item("deviation", seen.deviation.to_array())?;
        told.set_item("lowest", seen.lowest.to_array())?;
        told.set_item("highest", seen.highest.to_array())?;
        told.set_item("moved", (seen.last - seen.first).to_array())?;
        told.set_item("buttons", seen.buttons)?;
        told.set_item("largest_force", seen.largest_force)?;
        told.set_item("done", seen.done)?;
        told.set_item("ran_away", seen.ran_away)?;
        told.set_item("fault", seen.fault.map(|fault| fault.to_string()))?;
        Ok(Some(told))
    }

    /// Ends the check; the device is left without a force.
    fn stop(&mut self, py: Python<'_>) {
        py.detach(|| self.check.stop());
    }
}

impl DeviceCheck {
    fn start(py: Python<'_>, opened: Opened) -> PyResult<Self> {
        let check = py.detach(|| SelfCheck::start(opened)).map_err(|error| to_python(py, error))?;
        Ok(Self { check })
    }
}
