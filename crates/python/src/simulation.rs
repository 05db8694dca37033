//! A simulation: the loop with simulated devices, and the same ticks offline.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use glam::DVec3;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use palpate_core::simulation::{MAX_BODIES, Strike};
use palpate_devices::simulated::{Handle, Target};
use palpate_recording::{Recorder, RecordingInMemory};
use palpate_scene::{BodyId, PreparedScene, Scene, unit_quaternion};
use palpate_servo::{SafetyLimits, Scheduling, Script, Servo, Settings, TickRecord};
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use pyo3::types::{PyBytes, PyDict};

use crate::connection::{Connected, common_scheduler};
use crate::errors::Answer;
use crate::frame::{frame, push_row};
use crate::recording::{self, RecordingStatus, header};
use crate::scene::{
    BodyArguments, ContactRecord, ToolArguments, contact_records, energy_array, poses, scene_body, scene_tool,
    settings_dict,
};

/// Tick, body, point (m), impulse (N s) and duration (s) of a strike on a patch of the first tool's contact radius.
type StrikeArguments = (usize, usize, [f64; 3], [f64; 3], f64);

/// A simulation, and its loop while it runs. Any threads may call at the same time: they wait for each other, for moments.
#[pyclass(frozen, module = "palpate._native")]
pub struct SimulationCore {
    parts: Mutex<RunningParts>,
    /// Held while bodies, tools and devices change, and while the loop starts or stops, which takes up to seconds; frames
    /// and settings go on meanwhile. Taken before `parts`.
    changing: Mutex<()>,
}

/// What is in a simulation, what its loop reads of that, and the loop.
pub(crate) struct RunningParts {
    pub scene: Scene,
    pub prepared: PreparedScene,
    /// Devices for the next start; a tool without one is moved by its target.
    pub connected: Vec<Option<Connected>>,
    /// Of tools that a target moves.
    pub handles: Vec<Option<Handle>>,
    pub targets: Vec<Target>,
    /// Raised whenever bodies or tools change: a frame states of which it is.
    pub number: u64,
    pub servo: Option<Servo>,
    /// Blocks of series that a loop may still have: body, radius (m), which blocks.
    pub earlier_series: Vec<(BodyId, f64, Vec<bool>)>,
    recording: Option<Recorder>,
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
    ) -> Answer<Self> {
        let bodies = bodies.iter().map(scene_body).collect::<Answer<Vec<_>>>()?;
        let mut scene = Scene::default();
        scene.limits = SafetyLimits { max_force: limits.0, max_slew: limits.1, ramp: limits.2, ..scene.limits };
        scene.scheduling = Scheduling { rate: scheduling.0, cpus: scheduling.1, priority: scheduling.2 };
        scene.strain_limit = strain_limit;
        let prepare = || {
            bodies.into_iter().try_for_each(|body| scene.add_body(body).map(|_| ()))?;
            tools.into_iter().try_for_each(|tool| scene.add_tool(scene_tool(tool)?).map(|_| ()))?;
            scene.prepare()
        };
        let prepared = py.detach(prepare)?;
        let parts = RunningParts {
            connected: prepared.tools.iter().map(|_| None).collect(),
            handles: prepared.tools.iter().map(|_| None).collect(),
            targets: vec![Target::default(); prepared.tools.len()],
            number: 0,
            servo: None,
            earlier_series: Vec::new(),
            recording: None,
            scene,
            prepared,
        };
        Ok(Self { parts: Mutex::new(parts), changing: Mutex::new(()) })
    }

    /// Starts the loop; whether the system granted its priority, and locked memory.
    fn start(&self, py: Python<'_>) -> Answer<(bool, bool)> {
        let _alone = self.changing(py);
        let mut parts = self.parts(py);
        let connected: Vec<_> = parts.connected.iter_mut().map(Option::take).collect();
        let devices = connected.into_iter().enumerate().map(|(tool, device)| parts.device_of(tool, device));
        let devices: Vec<_> = devices.collect();
        let scheduler = common_scheduler(&devices, parts.prepared.scheduling.rate)?;
        let (handles, devices): (Vec<_>, Vec<_>) = devices.into_iter().map(|part| (part.handle, part.device)).unzip();
        parts.handles = handles;
        drop(parts);
        let PreparedScene { model, limits, settings, scheduling, strain, .. } = self.prepared(py);
        let start = || Servo::start(model, devices, limits, settings, scheduling, strain, scheduler);
        let mut servo = py.detach(start)?;
        let realtime = servo.realtime();
        let mut parts = self.parts(py);
        // Others may have changed them meanwhile.
        servo.set(parts.prepared.settings)?;
        parts.servo = Some(servo);
        Ok((realtime.priority, realtime.locked_memory))
    }

    /// Stops the loop.
    fn stop(&self, py: Python<'_>) {
        let _alone = self.changing(py);
        let mut parts = self.parts(py);
        let (recording, servo) = (parts.recording.take(), parts.servo.take());
        drop(parts);
        if let Some(mut servo) = servo {
            py.detach(|| {
                recording.map(|recorder| recording::end(recorder, servo.end_recording()));
                servo.stop();
            });
        }
    }

    /// Sends a simulated tool to a position (m) that moves on with a velocity (m/s), and an orientation (w x y z); what is None
    /// stays as it is. `active` false takes it out of the scene.
    fn set_target(
        &self,
        py: Python<'_>,
        tool: usize,
        place: (Option<[f64; 3]>, Option<[f64; 4]>),
        velocity: [f64; 3],
        active: bool,
        grab: Option<bool>,
    ) {
        let mut parts = self.parts(py);
        let RunningParts { targets, handles, .. } = &mut *parts;
        let Some(target) = targets.get_mut(tool) else { return };
        place.0.into_iter().for_each(|position| target.pose.position = position.into());
        place.1.into_iter().for_each(|turned| target.pose.orientation = unit_quaternion(turned));
        (target.velocity, target.active, target.grab) = (velocity.into(), active, grab.unwrap_or(target.grab));
        handles[tool].iter_mut().for_each(|handle| handle.set(*target));
    }

    /// Changes a setting of a tool or a body, or of the scene (rank 0).
    fn set(&self, py: Python<'_>, name: &str, rank: usize, value: f64) -> Answer<()> {
        if name == "contact_radius" {
            let model = self.parts(py).prepared.model.clone();
            py.detach(|| model.check_contact_radius(value))?;
        }
        self.change_settings(py, |settings| settings.set(name, rank, value))
    }

    /// The settings by their names: a number, or a list with one for each tool or body.
    fn settings<'py>(&self, py: Python<'py>) -> Answer<Bound<'py, PyDict>> {
        let PreparedScene { settings, tools, bodies, .. } = &self.parts(py).prepared;
        settings_dict(py, settings, tools.len(), bodies.len())
    }

    /// Closest points of the smooth surface of a body (n, 7): position (m), outward normal, signed distance (m), in the
    /// body's frame; NaN where there is none.
    fn feet<'py>(
        &self,
        py: Python<'py>,
        body: usize,
        points: PyReadonlyArray2<'py, f64>,
    ) -> Answer<Bound<'py, PyArray1<f64>>> {
        let points = points.as_slice()?.to_vec();
        let model = self.parts(py).prepared.model.clone();
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

    /// Lets go of everything and clears faults.
    fn reset(&self, py: Python<'_>) -> Answer<()> {
        Ok(self.parts(py).servo.as_mut().map_or(Ok(()), Servo::reset)?)
    }

    /// Gives the surface point of a body closest to `point` (m) an impulse, N s, within a duration, s, on a patch of the
    /// contact radius of the first tool.
    fn strike(&self, py: Python<'_>, body: usize, point: [f64; 3], impulse: [f64; 3], duration: f64) -> Answer<()> {
        let mut parts = self.parts(py);
        let radius = parts.prepared.settings.contact_radius[0];
        let strike = Strike { body, point: point.into(), impulse: impulse.into(), radius, duration };
        Ok(parts.servo.as_mut().map_or(Ok(()), |servo| servo.strike(strike))?)
    }

    /// A body and its surface node (rank) whose displacement is logged.
    fn watch(&self, py: Python<'_>, body: usize, node: u32) -> Answer<()> {
        self.change_settings(py, |settings| {
            settings.watch = Some((body, node));
            Ok(())
        })
    }

    /// The latest tick as a dictionary; None if the loop does not run. It is worked out after the tick has been taken.
    fn frame<'py>(&self, py: Python<'py>) -> Answer<Option<Bound<'py, PyDict>>> {
        let (model, number, published) = {
            let mut parts = self.parts(py);
            let (model, number) = (parts.prepared.model.clone(), parts.number);
            let Some(servo) = &mut parts.servo else { return Ok(None) };
            (model, number, servo.latest().clone())
        };
        let frame = frame(py, &model, published)?;
        frame.set_item("scene", number)?;
        Ok(Some(frame))
    }

    /// Number of the scene, and contacts of the latest tick as in `frame`; None if the loop does not run.
    fn contacts(&self, py: Python<'_>) -> Option<(u64, Vec<ContactRecord>)> {
        let mut parts = self.parts(py);
        let (model, number) = (parts.prepared.model.clone(), parts.number);
        parts.servo.as_mut().map(|servo| (number, contact_records(&model, &servo.latest().state)))
    }

    /// Rows (18 a tick) of the log since the last call: time, position and force of the first tool, computing time, wake-up
    /// delay, displacement of the watched node, and time and energies of the watched body.
    fn drain_log<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let mut rows = Vec::new();
        let mut parts = self.parts(py);
        let body = parts.prepared.settings.watch.map_or(0, |(body, _)| body).min(MAX_BODIES - 1);
        if let Some(servo) = &mut parts.servo {
            servo.drain_log(|row| push_row(&mut rows, &row, body));
        }
        rows.into_pyarray(py)
    }

    /// Has the running loop begin anew and records it in a new file, with what is known of it.
    fn begin_recording(&self, py: Python<'_>, path: PathBuf, about: BTreeMap<String, String>) -> Answer<()> {
        let mut parts = self.parts(py);
        let header = header(about, &parts.prepared.model, parts.prepared.scheduling.rate, true);
        let RunningParts { servo: Some(servo), recording, .. } = &mut *parts else { return Ok(()) };
        *recording = Some(py.detach(|| recording::begin(&path, header, servo))?);
        Ok(())
    }

    /// File, ticks, bytes, ticks dropped and why nothing is written any more, of a recording under way.
    fn recording(&self, py: Python<'_>) -> Option<RecordingStatus> {
        let mut parts = self.parts(py);
        let progress = parts.servo.as_mut()?.latest().status.recording;
        parts.recording.as_ref().map(|recorder| recording::status(recorder, progress.dropped))
    }

    /// Ends the recording: the same of it as a whole.
    fn end_recording(&self, py: Python<'_>) -> Option<RecordingStatus> {
        let mut parts = self.parts(py);
        let recorder = parts.recording.take()?;
        let servo = parts.servo.as_mut()?;
        let ticks = py.detach(|| servo.end_recording());
        drop(parts);
        Some(py.detach(|| recording::end(recorder, ticks)))
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
    ) -> Answer<Bound<'py, PyDict>> {
        let poses = poses(positions.as_slice()?, orientations.as_slice()?);
        let grabs = grabs.as_slice()?.to_vec();
        let ticks = positions.shape()[0];
        let (strikes, watch) = extras;
        let PreparedScene { model, limits, settings, strain, devices, scheduling, .. } = self.prepared(py);
        let (settings, rate, radius) =
            (Settings { watch: None, ..settings }, scheduling.rate, settings.contact_radius[0]);
        let strike = |(tick, body, point, impulse, duration): StrikeArguments| {
            (tick, Strike { body, point: point.into(), impulse: impulse.into(), radius, duration })
        };
        let strikes: Vec<_> = strikes.into_iter().map(strike).collect();
        let script = Script {
            period: 1.0 / rate,
            poses: &poses,
            grabs: &grabs,
            strikes: &strikes,
            watch: &watch,
            devices: &devices,
        };
        let begin = |about| RecordingInMemory::new(header(about, &model, rate, false));
        let mut file = about.map(begin).transpose()?;
        let each = |record: &TickRecord| file.iter_mut().for_each(|file| file.push(record));
        let recording = py.detach(|| palpate_servo::run(&model, limits, settings, &strain, &script, each))?;
        let file = file.map(RecordingInMemory::finish).transpose()?;
        let flat = |vectors: Vec<DVec3>| vectors.iter().flat_map(|f| f.to_array()).collect::<Vec<_>>().into_pyarray(py);
        let mut energies: Vec<Vec<f64>> = vec![Vec::new(); model.bodies.len()];
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
        answer.set_item("refused", recording.refused.map(|(tick, refusal)| (tick, refusal.message())))?;
        debug_assert_eq!(poses.len(), ticks * model.tools.len());
        Ok(answer)
    }
}

impl SimulationCore {
    /// Its parts, for a moment. The interpreter is let go of while others have them.
    pub(crate) fn parts(&self, py: Python<'_>) -> MutexGuard<'_, RunningParts> {
        self.parts.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner)
    }

    /// The right to change bodies, tools and devices, and to start and stop the loop, for as long as it takes.
    pub(crate) fn changing(&self, py: Python<'_>) -> MutexGuard<'_, ()> {
        self.changing.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner)
    }

    /// What its loop reads.
    pub(crate) fn prepared(&self, py: Python<'_>) -> PreparedScene {
        self.parts(py).prepared.clone()
    }

    /// Changes the settings, of the running loop too; a value that is refused changes nothing.
    fn change_settings(
        &self,
        py: Python<'_>,
        change: impl FnOnce(&mut Settings) -> palpate_core::Result<()>,
    ) -> Answer<()> {
        let mut parts = self.parts(py);
        let RunningParts { prepared, servo, .. } = &mut *parts;
        let mut settings = prepared.settings;
        change(&mut settings)?;
        settings.check(&prepared.model)?;
        servo.as_mut().map_or(Ok(()), |servo| servo.set(settings))?;
        prepared.settings = settings;
        Ok(())
    }
}
