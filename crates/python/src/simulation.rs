//! A simulation: the loop with simulated devices, and the same ticks offline.

use std::sync::{Arc, Mutex, PoisonError};

use glam::DVec3;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray2};
use palpate_core::simulation::{Input, Mode, Model, State};
use palpate_devices::Device;
use palpate_devices::simulated::{Handle, Target, simulated};
use palpate_servo::{SafetyLimits, Servo, Settings};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::body::vectors;
use crate::errors::to_python;
use crate::green::GreenCore;

/// Model, limits and settings of a simulation, and its loop while it runs.
#[pyclass(module = "palpate._native")]
pub struct SimulationCore {
    model: Arc<Model>,
    limits: SafetyLimits,
    settings: Settings,
    handles: Vec<Handle>,
    targets: Vec<Target>,
    /// Locked by callers from Python among themselves; the loop knows nothing of it.
    servo: Mutex<Option<Servo>>,
}

#[pymethods]
impl SimulationCore {
    /// Prepares a body's surface for contact with `tools` spherical tools.
    #[new]
    fn new(
        py: Python<'_>,
        green: &GreenCore,
        tools: usize,
        tool_radius: f64,
        contact_radius: f64,
        max_stiffness: f64,
        limits: (f64, f64, f64),
    ) -> PyResult<Self> {
        let green = green.green.clone();
        let prepare = || {
            let model = Model::new(green, tool_radius, max_stiffness)?;
            model.check_contact_radius(contact_radius)?;
            Ok(Arc::new(model))
        };
        let model = py.detach(prepare).map_err(|e| to_python(py, e))?;
        Ok(Self {
            model,
            limits: SafetyLimits { max_force: limits.0, max_slew: limits.1, ramp: limits.2 },
            settings: Settings { contact_radius, stiffness_scale: 1.0, resets: 0 },
            handles: Vec::new(),
            targets: vec![Target::default(); tools],
            servo: Mutex::new(None),
        })
    }

    /// Starts the loop.
    fn start(&mut self, py: Python<'_>) -> PyResult<()> {
        let (handles, devices): (Vec<_>, Vec<_>) = self
            .targets
            .iter()
            .map(|_| {
                let (handle, device) = simulated();
                (handle, Box::new(device) as Box<dyn Device>)
            })
            .unzip();
        self.handles = handles;
        let (model, limits, settings) = (self.model.clone(), self.limits, self.settings);
        *self.servo() = Some(py.detach(|| Servo::start(model, devices, limits, settings))?);
        Ok(())
    }

    /// Stops the loop.
    fn stop(&mut self, py: Python<'_>) {
        if let Some(mut servo) = self.servo().take() {
            py.detach(|| servo.stop());
        }
    }

    /// Sets where a simulated tool should go; `active` false takes it out of the scene.
    fn set_target(&mut self, tool: usize, position: [f64; 3], active: bool, grab: bool) {
        let target = Target { position: DVec3::from(position), active, grab };
        self.targets[tool] = target;
        if let Some(handle) = self.handles.get_mut(tool) {
            handle.set(target);
        }
    }

    /// Changes contact radius (m) and stiffness scale; `reset` lets go of everything and clears a fault.
    fn configure(&mut self, py: Python<'_>, contact_radius: f64, stiffness_scale: f64, reset: bool) -> PyResult<()> {
        if contact_radius != self.settings.contact_radius {
            self.model.check_contact_radius(contact_radius).map_err(|e| to_python(py, e))?;
        }
        let resets = self.settings.resets.wrapping_add(u32::from(reset));
        self.settings = Settings { contact_radius, stiffness_scale, resets };
        let settings = self.settings;
        if let Some(servo) = self.servo() {
            servo.set(settings);
        }
        Ok(())
    }

    /// Whether contacts of this radius (m) can be weighed everywhere on the surface.
    fn accepts_contact_radius(&self, py: Python<'_>, radius: f64) -> bool {
        py.detach(|| self.model.check_contact_radius(radius).is_ok())
    }

    /// The latest tick as a dictionary; None if the loop does not run.
    fn frame<'py>(&mut self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let tools = self.targets.len();
        let model = self.model.clone();
        let Some(servo) = self.servo() else { return Ok(None) };
        let tick = servo.latest();
        let frame = PyDict::new(py);
        let displacements = tick.state.displacements(&model);
        frame.set_item("time", tick.time)?;
        frame.set_item("forces", tick.forces[..tools].iter().map(|f| f.to_array()).collect::<Vec<_>>())?;
        frame.set_item("positions", tick.devices[..tools].iter().map(|d| d.position.to_array()).collect::<Vec<_>>())?;
        frame.set_item("displacements", displacements.into_pyarray(py))?;
        frame.set_item("contacts", contact_records(&tick.state))?;
        frame.set_item("refused", tick.state.tools[..tools].iter().map(|c| c.refused).collect::<Vec<_>>())?;
        let summary = |s: palpate_servo::Summary| [s.p50, s.p99, s.p999, s.max];
        frame.set_item("compute_us", summary(tick.compute))?;
        frame.set_item("wakeup_us", summary(tick.wakeup))?;
        frame.set_item("ticks", tick.ticks)?;
        frame.set_item("missed_deadlines", tick.missed_deadlines)?;
        frame.set_item("dropped_rows", tick.dropped_rows)?;
        let crashed = tick.crashed.then_some("the force loop stopped unexpectedly; forces are off");
        frame.set_item("fault", tick.fault.map(|f| f.message()).or(crashed))?;
        frame.set_item("realtime", (tick.realtime.priority, tick.realtime.locked_memory))?;
        Ok(Some(frame))
    }

    /// Contacts of the latest tick, as in `frame` but without the rest of it; None if the loop does not run.
    fn contacts(&mut self) -> Option<Vec<ContactRecord>> {
        self.servo().as_mut().map(|servo| contact_records(&servo.latest().state))
    }

    /// The contact of a tool at the latest tick, and displacements (3s) per unit way of the tool from its anchor along x,
    /// y and z, m/m; None for a tool that does not touch.
    #[allow(clippy::type_complexity)] // a record and three arrays; naming them would need a class nobody else uses
    fn contact_response<'py>(
        &mut self,
        py: Python<'py>,
        tool: usize,
    ) -> Option<(ContactRecord, Vec<Bound<'py, PyArray1<f64>>>)> {
        let model = self.model.clone();
        let state = self.servo().as_mut()?.latest().state.clone();
        let fields = py.detach(|| state.response(&model, tool))?;
        let record = contact_records(&state).into_iter().find(|record| record.0 == tool)?;
        Some((record, fields.map(|field| field.into_pyarray(py)).into()))
    }

    /// Rows (9 a tick) of the log since the last call: time, position, force, computing time, wake-up delay.
    fn drain_log<'py>(&mut self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let mut rows = Vec::new();
        if let Some(servo) = self.servo() {
            servo.drain_log(|row| {
                rows.push(row.time);
                rows.extend(row.position.to_array());
                rows.extend(row.force.to_array());
                rows.extend([row.compute_us, row.wakeup_us]);
            });
        }
        rows.into_pyarray(py)
    }

    /// Moves the first tool through (t, 3) positions offline: forces on the device (3t) and the fault, if one latched.
    fn run<'py>(
        &self,
        py: Python<'py>,
        positions: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<(Bound<'py, PyArray1<f64>>, Option<&'static str>)> {
        let positions = vectors(&positions).map_err(|e| to_python(py, e))?;
        let input = Input {
            contact_radius: self.settings.contact_radius,
            stiffness_scale: self.settings.stiffness_scale,
            ..Input::default()
        };
        let (model, limits) = (self.model.clone(), self.limits);
        let (forces, fault) = py.detach(|| palpate_servo::run(model, limits, &input, &positions));
        let forces: Vec<f64> = forces.iter().flat_map(|f| f.to_array()).collect();
        Ok((forces.into_pyarray(py), fault.map(|f| f.message())))
    }
}

/// Tool, mode, (point, normal, force, anchor), nodes and weights of a contact.
type ContactRecord = (usize, &'static str, [[f64; 3]; 4], Vec<usize>, Vec<f64>);

fn contact_records(state: &State) -> Vec<ContactRecord> {
    let touching = state.tools.iter().enumerate().filter(|(_, contact)| contact.mode != Mode::Free);
    touching
        .map(|(tool, contact)| {
            let mode = if contact.mode == Mode::Grab { "grab" } else { "press" };
            let (nodes, weights) = contact.patch.iter().unzip();
            let vectors = [contact.point, contact.normal, contact.force, contact.anchor].map(|v| v.to_array());
            (tool, mode, vectors, nodes, weights)
        })
        .collect()
}

impl SimulationCore {
    fn servo(&mut self) -> &mut Option<Servo> {
        self.servo.get_mut().unwrap_or_else(PoisonError::into_inner)
    }
}
