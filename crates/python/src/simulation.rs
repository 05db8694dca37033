//! A simulation: the loop with simulated devices, and the same ticks offline.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use glam::DVec3;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use palpate_core::simulation::{MAX_BODIES, Model, Pose, Strike, ToolModel};
use palpate_devices::DeviceLimits;
use palpate_devices::simulated::{Handle, Target};
use palpate_servo::{SafetyLimits, Scheduling, Script, Servo, Settings, StrainPreparer, TickRecord};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::connection::{Connected, common_scheduler};
use crate::errors::to_python;
use crate::frame::{frame, push_row};
use crate::recording::{Recorded, Recording, RecordingStatus, header};
use crate::scene::{
    BodyArguments, ContactRecord, ToolArguments, contact_records, energy_array, poses, quaternion, scene_body, tool,
};
use crate::strain::StrainMeasure;

/// Tick, body, point (m), impulse (N s), duration (s) and radius of the patch (m) of a strike.
type StrikeArguments = (usize, usize, [f64; 3], [f64; 3], f64, f64);

/// Model, limits and settings of a simulation, and its loop while it runs.
#[pyclass(module = "palpate._native")]
pub struct SimulationCore {
    pub(crate) model: Arc<Model>,
    pub(crate) limits: SafetyLimits,
    pub(crate) settings: Settings,
    pub(crate) scheduling: Scheduling,
    pub(crate) strain: StrainPreparer,
    /// What the device of each tool can render, in the scene.
    pub(crate) device_limits: Vec<DeviceLimits>,
    /// As the scene asks for them, whatever devices hold.
    pub(crate) asked: Vec<ToolModel>,
    /// Devices for the next start; a tool without one is moved by its target.
    pub(crate) connected: Vec<Option<Connected>>,
    /// Of tools that a target moves.
    pub(crate) handles: Vec<Option<Handle>>,
    pub(crate) targets: Vec<Target>,
    /// Locked by callers from Python among themselves; the loop knows nothing of it.
    servo: Mutex<Option<Servo>>,
    recording: Option<Recording>,
}

#[pymethods]
impl SimulationCore {
    /// Prepares bodies and tools, with limits of force (N), slew (N/s) and ramp (s), and the loop's rate, Hz, processors and
    /// priority.
    #[new]
    fn new(
        py: Python<'_>,
        bodies: Vec<BodyArguments<'_>>,
        tools: Vec<ToolArguments>,
        limits: (f64, f64, f64),
        strain_limit: f64,
        scheduling: (f64, Vec<usize>, u8),
    ) -> PyResult<Self> {
        let parts = bodies.iter().map(scene_body).collect::<PyResult<Vec<_>>>()?;
        let prepare = || {
            let bodies = parts.iter().map(|part| part.model()).collect::<palpate_core::Result<Vec<_>>>()?;
            let tools = tools.into_iter().map(tool).collect::<palpate_core::Result<Vec<_>>>()?;
            let mut settings = Settings { strain_limit, ..Settings::default() };
            settings.contact_radius.iter_mut().zip(&tools).for_each(|(to, (_, radius, _))| *to = *radius);
            settings.friction.iter_mut().zip(&tools).for_each(|(to, (_, _, friction))| *to = *friction);
            let model = Model::new(bodies, tools.into_iter().map(|(tool, _, _)| tool).collect())?;
            settings.contact_radius[..model.tools.len()].iter().try_for_each(|&r| model.check_contact_radius(r))?;
            Ok((Arc::new(model), settings))
        };
        let (model, settings) = py.detach(prepare).map_err(|e| to_python(py, e))?;
        Ok(Self {
            limits: SafetyLimits { max_force: limits.0, max_slew: limits.1, ramp: limits.2, ..SafetyLimits::default() },
            settings,
            scheduling: Scheduling { rate: scheduling.0, cpus: scheduling.1, priority: scheduling.2 },
            strain: StrainPreparer::new(&model),
            device_limits: vec![DeviceLimits::UNLIMITED; model.tools.len()],
            asked: model.tools.clone(),
            connected: model.tools.iter().map(|_| None).collect(),
            handles: Vec::new(),
            targets: vec![Target::default(); model.tools.len()],
            servo: Mutex::new(None),
            recording: None,
            model,
        })
    }

    /// What measures the strain of a body; before the loop starts.
    fn set_strain_measure(&mut self, body: usize, measure: &StrainMeasure) {
        self.strain.set_measure(body, measure.measure.clone());
    }

    /// Starts the loop; whether the system granted its priority, and locked memory.
    fn start(&mut self, py: Python<'_>) -> PyResult<(bool, bool)> {
        let connected = std::mem::replace(&mut self.connected, self.asked.iter().map(|_| None).collect());
        let mut parts = Vec::new();
        for (tool, device) in connected.into_iter().enumerate() {
            parts.push(self.device_of(tool, device));
        }
        let scheduler = common_scheduler(&parts, self.scheduling.rate).map_err(|e| to_python(py, e))?;
        let (handles, devices): (Vec<_>, Vec<_>) = parts.into_iter().map(|part| (part.handle, part.device)).unzip();
        self.handles = handles;
        let (model, limits, settings, scheduling, strain) =
            (self.model.clone(), self.limits, self.settings, self.scheduling.clone(), self.strain.clone());
        let start = || Servo::start(model, devices, limits, settings, scheduling, strain, scheduler);
        let servo = py.detach(start).map_err(|e| to_python(py, e))?;
        let realtime = servo.realtime();
        *self.servo() = Some(servo);
        Ok((realtime.priority, realtime.locked_memory))
    }

    /// Stops the loop.
    fn stop(&mut self, py: Python<'_>) {
        let recording = self.recording.take();
        if let Some(mut servo) = self.servo().take() {
            py.detach(|| {
                recording.map(|recording| recording.end(&mut servo));
                servo.stop();
            });
        }
    }

    /// Sets where a simulated tool should go, and its velocity there; `active` false takes it out of the scene.
    fn set_target(
        &mut self,
        tool: usize,
        position: [f64; 3],
        orientation: [f64; 4],
        velocity: [f64; 3],
        active: bool,
        grab: bool,
    ) {
        let pose = Pose { position: position.into(), orientation: quaternion(orientation) };
        let target = Target { pose, velocity: velocity.into(), active, grab };
        let Some(place) = self.targets.get_mut(tool) else { return };
        *place = target;
        if let Some(Some(handle)) = self.handles.get_mut(tool) {
            handle.set(target);
        }
    }

    /// Changes the contact radius (m) of a tool.
    fn set_contact_radius(&mut self, py: Python<'_>, tool: usize, radius: f64) -> PyResult<()> {
        let model = self.model.clone();
        py.detach(|| model.check_contact_radius(radius)).map_err(|e| to_python(py, e))?;
        self.change(py, |settings| {
            settings.contact_radius.iter_mut().skip(tool).take(1).for_each(|to| *to = radius);
        })
    }

    /// Changes the coefficient of friction of a tool.
    fn set_friction(&mut self, py: Python<'_>, tool: usize, friction: f64) -> PyResult<()> {
        self.change(py, |settings| {
            settings.friction.iter_mut().skip(tool).take(1).for_each(|to| *to = friction);
        })
    }

    /// Closest points of the smooth surface of a body (n, 7): position (m), outward normal, signed distance (m), in the
    /// body's frame; NaN where there is none.
    fn feet<'py>(
        &self,
        py: Python<'py>,
        body: usize,
        points: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let points = points.as_slice()?.to_vec();
        let model = self.model.clone();
        let feet = py.detach(|| {
            let of_point = |&point: &[f64; 3]| match model.bodies.get(body).and_then(|body| body.foot(point.into())) {
                Some(foot) => {
                    let (x, n) = (foot.position, foot.normal);
                    [x.x, x.y, x.z, n.x, n.y, n.z, foot.distance]
                }
                None => [f64::NAN; 7],
            };
            points.as_chunks::<3>().0.iter().flat_map(of_point).collect::<Vec<_>>()
        });
        Ok(feet.into_pyarray(py))
    }

    /// Young's modulus of a body over that of its Green's function.
    fn set_stiffness_scale(&mut self, py: Python<'_>, body: usize, scale: f64) -> PyResult<()> {
        self.change(py, |settings| {
            settings.stiffness_scale.iter_mut().skip(body).take(1).for_each(|to| *to = scale);
        })
    }

    /// Largest strain to which tools may take the bodies; zero for any.
    fn set_strain_limit(&mut self, py: Python<'_>, limit: f64) -> PyResult<()> {
        self.change(py, |settings| settings.strain_limit = limit)
    }

    /// Lets go of everything and clears faults.
    fn reset(&mut self, py: Python<'_>) -> PyResult<()> {
        self.change(py, |settings| settings.resets = settings.resets.wrapping_add(1))
    }

    /// Seconds that a body in motion advances in a second.
    fn set_time_scale(&mut self, py: Python<'_>, time_scale: f64) -> PyResult<()> {
        self.change(py, |settings| settings.time_scale = time_scale)
    }

    /// Gives the surface point of a body closest to `point` (m) an impulse, N s, within a duration, s, on a patch of a
    /// radius, m.
    fn strike(
        &mut self,
        py: Python<'_>,
        body: usize,
        point: [f64; 3],
        impulse: [f64; 3],
        duration: f64,
        radius: f64,
    ) -> PyResult<()> {
        self.change(py, |settings| {
            settings.strike = Strike { body, point: point.into(), impulse: impulse.into(), radius, duration };
            settings.strikes = settings.strikes.wrapping_add(1);
        })
    }

    /// A body and its surface node (rank) whose displacement is logged.
    fn watch(&mut self, py: Python<'_>, body: usize, node: u32) -> PyResult<()> {
        self.change(py, |settings| settings.watch = Some((body, node)))
    }

    /// The latest tick as a dictionary; None if the loop does not run. Others may call meanwhile: it is worked out after the
    /// tick has been taken.
    fn frame<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let (model, tools, published) = {
            let mut core = slf.try_borrow_mut()?;
            let (model, tools) = (core.model.clone(), core.targets.len());
            let Some(servo) = core.servo() else { return Ok(None) };
            (model, tools, servo.latest().clone())
        };
        frame(slf.py(), &model, tools, published).map(Some)
    }

    /// Contacts of the latest tick, as in `frame` but without the rest of it; None if the loop does not run.
    fn contacts(&mut self) -> Option<Vec<ContactRecord>> {
        let model = self.model.clone();
        self.servo().as_mut().map(|servo| contact_records(&model, &servo.latest().state))
    }

    /// Rows (18 a tick) of the log since the last call: time, position and force of the first tool, computing time, wake-up
    /// delay, displacement of the watched node, and time and energies of the watched body.
    fn drain_log<'py>(&mut self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let mut rows = Vec::new();
        let body = self.settings.watch.map_or(0, |(body, _)| body).min(MAX_BODIES - 1);
        if let Some(servo) = self.servo() {
            servo.drain_log(|row| push_row(&mut rows, &row, body));
        }
        rows.into_pyarray(py)
    }

    /// Has the running loop begin anew and records it in a new file, with what is known of it.
    fn begin_recording(&mut self, py: Python<'_>, path: PathBuf, about: BTreeMap<String, String>) -> PyResult<()> {
        let header = header(about, &self.model, self.scheduling.rate, true);
        let Some(servo) = self.servo() else { return Ok(()) };
        let begun = py.detach(|| Recording::begin(&path, header, servo));
        self.recording = Some(begun.map_err(|e| to_python(py, e))?);
        Ok(())
    }

    /// File, ticks, bytes, ticks dropped and why nothing is written any more, of a recording under way.
    fn recording(&mut self) -> Option<RecordingStatus> {
        let progress = self.servo().as_mut()?.latest().status.recording;
        self.recording.as_ref().map(|recording| recording.status(progress.dropped))
    }

    /// Ends the recording: the same of it as a whole.
    fn end_recording(&mut self, py: Python<'_>) -> Option<RecordingStatus> {
        let recording = self.recording.take()?;
        let servo = self.servo().as_mut()?;
        Some(py.detach(|| recording.end(servo)))
    }

    /// Moves the tools through positions (ticks, tools, 3), NaN where one is out of the scene, orientations (ticks, tools,
    /// 4) and grabs (ticks, tools) offline, with strikes in order of time and watched nodes as pairs of body and rank; `about` is
    /// what a recording of it says of itself, None for no recording.
    fn run<'py>(
        &self,
        py: Python<'py>,
        positions: PyReadonlyArray3<'py, f64>,
        orientations: PyReadonlyArray3<'py, f64>,
        grabs: PyReadonlyArray2<'py, bool>,
        extras: (Vec<StrikeArguments>, Vec<(usize, u32)>),
        about: Option<BTreeMap<String, String>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let poses = poses(positions.as_slice()?, orientations.as_slice()?);
        let grabs = grabs.as_slice()?.to_vec();
        let ticks = positions.shape()[0];
        let (strikes, watch) = extras;
        let strikes: Vec<_> = strikes
            .into_iter()
            .map(|(tick, body, point, impulse, duration, radius)| {
                (tick, Strike { body, point: point.into(), impulse: impulse.into(), radius, duration })
            })
            .collect();
        let script = Script {
            period: 1.0 / self.scheduling.rate,
            poses: &poses,
            grabs: &grabs,
            strikes: &strikes,
            watch: &watch,
            devices: &self.device_limits,
        };
        let settings = Settings { resets: 0, strikes: 0, watch: None, ..self.settings };
        let (model, limits, strain) = (self.model.clone(), self.limits, self.strain.clone());
        let begin = |about| Recorded::new(header(about, &self.model, self.scheduling.rate, false));
        let mut file = about.map(begin).transpose().map_err(|e| to_python(py, e))?;
        let each = |record: &TickRecord| file.iter_mut().for_each(|file| file.push(record));
        let recording = py.detach(|| palpate_servo::run(&model, limits, settings, &strain, &script, each));
        let recording = recording.map_err(|e| to_python(py, e))?;
        let file = file.map(Recorded::finish).transpose().map_err(|e| to_python(py, e))?;
        let flat = |vectors: Vec<DVec3>| vectors.iter().flat_map(|f| f.to_array()).collect::<Vec<_>>().into_pyarray(py);
        let mut energies: Vec<Vec<f64>> = vec![Vec::new(); self.model.bodies.len()];
        for (body, of_body) in recording.energies {
            energies[body] = of_body.iter().flat_map(energy_array).collect();
        }
        let answer = PyDict::new(py);
        answer.set_item("forces", flat(recording.forces))?;
        answer.set_item("torques", flat(recording.torques))?;
        answer.set_item("watched", flat(recording.displacements))?;
        answer.set_item("limited", recording.limited.into_pyarray(py))?;
        answer.set_item("energies", energies.into_iter().map(|e| e.into_pyarray(py)).collect::<Vec<_>>())?;
        answer.set_item("compute_ns", recording.compute_ns.into_pyarray(py))?;
        answer.set_item("file", file.map(|file| PyBytes::new(py, &file)))?;
        answer.set_item("fault", recording.fault.map(|fault| fault.to_string()))?;
        debug_assert_eq!(poses.len(), ticks * self.model.tools.len());
        Ok(answer)
    }
}

impl SimulationCore {
    pub(crate) fn servo(&mut self) -> &mut Option<Servo> {
        self.servo.get_mut().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the settings, and hands them to the loop if it runs; a value that is refused changes nothing.
    fn change(&mut self, py: Python<'_>, change: impl FnOnce(&mut Settings)) -> PyResult<()> {
        let mut settings = self.settings;
        change(&mut settings);
        settings.check(&self.model).map_err(|e| to_python(py, e))?;
        self.settings = settings;
        match self.servo() {
            Some(servo) => servo.set(settings).map_err(|e| to_python(py, e)),
            None => Ok(()),
        }
    }
}
