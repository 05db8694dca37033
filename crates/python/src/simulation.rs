//! A simulation: the loop with simulated devices, and the same ticks offline.

use std::sync::{Arc, Mutex, PoisonError};

use glam::DVec3;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use palpate_core::dynamics::{Model as Modes, exact_step};
use palpate_core::simulation::{Dynamics, Energy, Input, Mode, Model, Snapshot, Strike};
use palpate_devices::Device;
use palpate_devices::simulated::{Handle, Target, simulated};
use palpate_servo::{Published, SafetyLimits, Script, Servo, Settings};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::body::vectors;
use crate::dynamics::{SchemeArguments, scheme};
use crate::errors::to_python;
use crate::green::GreenCore;

/// Eigenvalues (m), their shapes at the surface dofs (3s, m), the scheme, whether each mode is integrated exactly instead,
/// and the spring between tools and patches, N/m.
type DynamicsArguments<'py> = (PyReadonlyArray1<'py, f64>, PyReadonlyArray2<'py, f64>, SchemeArguments, bool, f64);

fn dynamics(arguments: DynamicsArguments<'_>) -> PyResult<palpate_core::Result<Dynamics>> {
    let (eigenvalues, shapes, (dt, ..), exact, coupling) = &arguments;
    let (eigenvalues, shapes) = (eigenvalues.as_slice()?, shapes.as_slice()?);
    let make = || {
        let (newmark, rayleigh) = scheme(arguments.2)?;
        let step = |k, c| if *exact { exact_step(k, c, *dt) } else { newmark.mode_step(k, c) };
        Dynamics::new(Modes::new(eigenvalues, shapes, &rayleigh, *dt, step)?, *coupling)
    };
    Ok(make())
}

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
    /// Prepares a body's surface for contact with `tools` spherical tools; with `motion` the body moves.
    #[new]
    #[allow(clippy::too_many_arguments)] // called in one place, by name
    fn new(
        py: Python<'_>,
        green: &GreenCore,
        tools: usize,
        tool_radius: f64,
        contact_radius: f64,
        max_stiffness: f64,
        limits: (f64, f64, f64),
        motion: Option<DynamicsArguments<'_>>,
    ) -> PyResult<Self> {
        let green = green.green.clone();
        let motion = motion.map(dynamics).transpose()?;
        let prepare = || {
            let mut model = Model::new(green, tool_radius, max_stiffness)?;
            if let Some(motion) = motion {
                model = model.with_dynamics(motion?)?;
            }
            model.check_contact_radius(contact_radius)?;
            Ok(Arc::new(model))
        };
        let model = py.detach(prepare).map_err(|e| to_python(py, e))?;
        Ok(Self {
            model,
            limits: SafetyLimits { max_force: limits.0, max_slew: limits.1, ramp: limits.2 },
            settings: Settings {
                contact_radius,
                stiffness_scale: 1.0,
                resets: 0,
                time_scale: 1.0,
                strike: Strike::default(),
                strikes: 0,
                watch: 0,
            },
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
        self.settings = Settings { contact_radius, stiffness_scale, resets, ..self.settings };
        self.tell();
        Ok(())
    }

    /// Seconds that a body in motion advances in a second.
    fn set_time_scale(&mut self, time_scale: f64) {
        self.settings.time_scale = time_scale;
        self.tell();
    }

    /// Gives the surface point closest to `point` (m) an impulse, N s, within a duration, s.
    fn strike(&mut self, point: [f64; 3], impulse: [f64; 3], duration: f64) {
        self.settings.strike = Strike { point: point.into(), impulse: impulse.into(), duration };
        self.settings.strikes = self.settings.strikes.wrapping_add(1);
        self.tell();
    }

    /// Surface node (rank) whose displacement is logged.
    fn watch(&mut self, rank: u32) {
        self.settings.watch = rank;
        self.tell();
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
        let Published { status: tick, state } = servo.latest();
        let frame = PyDict::new(py);
        let displacements = state.displacements(&model);
        frame.set_item("time", tick.time)?;
        frame.set_item("forces", tick.forces[..tools].iter().map(|f| f.to_array()).collect::<Vec<_>>())?;
        frame.set_item("positions", tick.devices[..tools].iter().map(|d| d.position.to_array()).collect::<Vec<_>>())?;
        frame.set_item("displacements", displacements.into_pyarray(py))?;
        frame.set_item("contacts", contact_records(state))?;
        frame.set_item("refused", state.tools[..tools].iter().map(|c| c.refused).collect::<Vec<_>>())?;
        let summary = |s: palpate_servo::Summary| [s.p50, s.p99, s.p999, s.max];
        frame.set_item("compute_us", summary(tick.compute))?;
        frame.set_item("wakeup_us", summary(tick.wakeup))?;
        frame.set_item("ticks", tick.ticks)?;
        frame.set_item("missed_deadlines", tick.missed_deadlines)?;
        frame.set_item("dropped_rows", tick.dropped_rows)?;
        let crashed = tick.crashed.then_some("the force loop stopped unexpectedly; forces are off");
        frame.set_item("fault", tick.fault.map(|f| f.message()).or(crashed))?;
        let energy = state.energy.as_ref().map(energy_array);
        frame.set_item("energy", energy)?;
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

    /// Rows (18 a tick) of the log since the last call: time, position, force, computing time, wake-up delay, displacement
    /// of the watched node, body time, energies.
    fn drain_log<'py>(&mut self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let mut rows = Vec::new();
        if let Some(servo) = self.servo() {
            servo.drain_log(|row| {
                rows.push(row.time);
                rows.extend(row.position.to_array());
                rows.extend(row.force.to_array());
                rows.extend([row.compute_us, row.wakeup_us]);
                rows.extend(row.watched.to_array());
                rows.push(row.body_time);
                rows.extend(energy_array(&row.energy));
            });
        }
        rows.into_pyarray(py)
    }

    /// Moves the first tool through (t, 3) positions offline, NaN where it is out of the scene, with blows `(tick, point,
    /// impulse, duration)` in order of time: forces on the device (3t), energies (5t; empty for a body that does not move),
    /// displacements of the watched surface ranks (3 a node and tick), and the fault, if one latched.
    #[allow(clippy::type_complexity)] // four arrays read once
    fn run<'py>(
        &self,
        py: Python<'py>,
        positions: PyReadonlyArray2<'py, f64>,
        strikes: Vec<(usize, [f64; 3], [f64; 3], f64)>,
        watch: Vec<u32>,
    ) -> PyResult<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, Option<&'static str>)>
    {
        let positions = vectors(&positions).map_err(|e| to_python(py, e))?;
        let strikes: Vec<_> = strikes
            .into_iter()
            .map(|(tick, point, impulse, duration)| {
                (tick, Strike { point: point.into(), impulse: impulse.into(), duration })
            })
            .collect();
        let input = Input {
            contact_radius: self.settings.contact_radius,
            stiffness_scale: self.settings.stiffness_scale,
            ..Input::default()
        };
        let (model, limits) = (self.model.clone(), self.limits);
        let script = Script { positions: &positions, strikes: &strikes, watch: &watch };
        let recording = py.detach(|| palpate_servo::run(model, limits, &input, &script));
        let flat = |vectors: Vec<DVec3>| vectors.iter().flat_map(|f| f.to_array()).collect::<Vec<_>>().into_pyarray(py);
        let energies: Vec<f64> = recording.energies.iter().flat_map(energy_array).collect();
        let fault = recording.fault.map(|f| f.message());
        Ok((flat(recording.forces), energies.into_pyarray(py), flat(recording.displacements), fault))
    }
}

/// Kinetic, strain, coupling, dissipated, work; J.
fn energy_array(e: &Energy) -> [f64; 5] {
    [e.kinetic, e.strain, e.coupling, e.dissipated, e.work]
}

/// Tool, mode, (point, normal, force, anchor), nodes and weights of a contact.
type ContactRecord = (usize, &'static str, [[f64; 3]; 4], Vec<usize>, Vec<f64>);

fn contact_records(state: &Snapshot) -> Vec<ContactRecord> {
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
    /// Hands the settings to the loop, if it runs.
    fn tell(&mut self) {
        let settings = self.settings;
        if let Some(servo) = self.servo() {
            servo.set(settings);
        }
    }

    fn servo(&mut self) -> &mut Option<Servo> {
        self.servo.get_mut().unwrap_or_else(PoisonError::into_inner)
    }
}
