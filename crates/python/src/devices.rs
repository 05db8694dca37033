//! Haptic devices of this machine: listing them, and the self-check of one.

use std::path::PathBuf;

use palpate_devices::{Connection, FoundDevice, kinds, list};
use palpate_servo::{LARGEST_FORCE, SelfCheck, Task};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::connection::{LimitsArguments, OpenedDevice, limits_tuple};
use crate::errors::Answer;

/// Kinds of devices that there are drivers for.
#[pyfunction]
pub fn device_kinds() -> Vec<&'static str> {
    kinds().collect()
}

/// What a driver sees: `found` with name, id, limits, obstacle and facts of each device; `missing`; `facts` of the driver. What is
/// wrong and what to do about it come as a pair.
#[pyfunction]
pub fn list_devices<'py>(
    py: Python<'py>,
    kind: &str,
    address: Option<String>,
    library: Option<PathBuf>,
) -> Answer<Bound<'py, PyDict>> {
    let connection = Connection { id: None, address, library };
    let listing = py.detach(|| list(kind, &connection))?;
    let found = PyList::empty(py);
    for FoundDevice { id, name, limits, obstacle, facts } in listing.found {
        let device = PyDict::new(py);
        device.set_item("id", id)?;
        device.set_item("name", name)?;
        device.set_item("limits", limits_tuple(&limits))?;
        device.set_item("obstacle", obstacle.map(|why| (why.what, why.advice)))?;
        device.set_item("facts", facts)?;
        found.append(device)?;
    }
    let entries = PyDict::new(py);
    entries.set_item("found", found)?;
    entries.set_item("missing", listing.missing.map(|why| (why.what, why.advice)))?;
    entries.set_item("facts", listing.facts)?;
    Ok(entries)
}

/// A gentle check of one device: its readings, and small forces that pass the safety stage.
#[pyclass(module = "palpate._native")]
pub struct DeviceCheck {
    check: SelfCheck,
}

#[pymethods]
impl DeviceCheck {
    /// Begins to watch a device.
    #[new]
    fn new(py: Python<'_>, device: &mut OpenedDevice) -> Answer<Self> {
        let opened = device.take()?;
        let check = py.detach(|| SelfCheck::start(opened))?;
        Ok(Self { check })
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
    fn limits(&self) -> LimitsArguments {
        limits_tuple(&self.check.limits())
    }

    /// Pushes along a unit vector with a force, N, that rises over `seconds`, or watches along none.
    fn begin(&mut self, direction: [f64; 3], force: f64, seconds: f64) -> Answer<()> {
        let task = Task { direction: direction.into(), force, seconds };
        Ok(self.check.begin(task)?)
    }

    /// What has been seen of it so far; None before its first tick.
    fn seen<'py>(&mut self, py: Python<'py>) -> Answer<Option<Bound<'py, PyDict>>> {
        let Some(seen) = self.check.observation() else { return Ok(None) };
        let readings = PyDict::new(py);
        readings.set_item("time", seen.time)?;
        readings.set_item("readings", seen.readings)?;
        readings.set_item("fresh", seen.fresh)?;
        readings.set_item("longest_gap", seen.longest_gap)?;
        readings.set_item("deviation", seen.deviation.to_array())?;
        readings.set_item("lowest", seen.lowest.to_array())?;
        readings.set_item("highest", seen.highest.to_array())?;
        readings.set_item("moved", (seen.last - seen.first).to_array())?;
        readings.set_item("buttons", seen.buttons)?;
        readings.set_item("largest_force", seen.largest_force)?;
        readings.set_item("done", seen.done)?;
        readings.set_item("ran_away", seen.ran_away)?;
        readings.set_item("fault", seen.fault.map(|fault| fault.to_string()))?;
        Ok(Some(readings))
    }

    /// Ends the check; the device is left without a force.
    fn stop(&mut self, py: Python<'_>) {
        py.detach(|| self.check.stop());
    }
}
