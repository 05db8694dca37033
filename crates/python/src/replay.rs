//! Recordings as columns, and their replay tick by tick.

use std::fs::File;
use std::io::{BufReader, Cursor, Read};
use std::path::PathBuf;
use std::sync::Mutex;

use numpy::{IntoPyArray, PyArray1};
use palpate_core::simulation::{MAX_BODIES, Mode, Strike};
use palpate_core::{Error, Result};
use palpate_recording::{Ticks, same_settings};
use palpate_scene::{PreparedScene, wxyz};
use palpate_servo::{Settings, TickRecord};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::Answer;
use crate::frame::{frame, push_row};
use crate::interruptible::locked;
use crate::scene::{energy_array, settings_dict};
use crate::simulation::SimulationCore;

/// Ticks between two looks for an interrupt.
pub const INTERRUPT_TICKS: usize = 256;

/// A recording's place: a file, or its bytes.
#[derive(FromPyObject)]
pub enum Source {
    /// A file.
    Path(PathBuf),
    /// Bytes.
    Bytes(Vec<u8>),
}

type RecordedTicks = Ticks<Box<dyn Read + Send>>;

/// Opens a recording.
///
/// # Errors
/// The system's; what is no recording.
pub fn open(source: Source) -> Result<RecordedTicks> {
    let (read, name): (Box<dyn Read + Send>, String) = match source {
        Source::Path(path) => {
            let file = File::open(&path).map_err(|source| Error::Io { path: path.clone(), source })?;
            (Box::new(BufReader::new(file)), format!("{}: ", path.display()))
        }
        Source::Bytes(bytes) => (Box::new(Cursor::new(bytes)), String::new()),
    };
    Ticks::new(read).map_err(|reason| Error::Invalid(format!("{name}{reason}")))
}

/// Columns under construction.
#[derive(Default)]
struct Columns {
    number: Vec<u64>,
    due_ns: Vec<u64>,
    /// Numbers of all tools, a tick after the other.
    vectors: [Vec<f64>; 10],
    buttons: Vec<u32>,
    active: Vec<bool>,
    limited: Vec<bool>,
    faults: Vec<Option<String>>,
    events: Vec<(u64, String)>,
    /// Settings and the latest strike, and the ticks from which they hold.
    settings: Vec<(u64, Settings, Strike)>,
    delay_us: Vec<f64>,
    compute_us: Vec<f64>,
    /// Tick, tool, body, mode (2 holds on), whether it slips and is limited.
    contact_state: Vec<u64>,
    contact_numbers: Vec<f32>,
    /// Tick, body, time and energies.
    bodies: Vec<f64>,
}

/// Names of the vectors of tools, in order.
const VECTORS: [&str; 10] = [
    "positions",
    "orientations",
    "velocities",
    "angular_velocities",
    "forces",
    "torques",
    "computed_forces",
    "computed_torques",
    "law_forces",
    "port_energy",
];

impl Columns {
    fn push(&mut self, record: &TickRecord, tools: usize) {
        self.number.push(record.tick);
        self.due_ns.push(record.input.due_ns);
        self.delay_us.push(1e-3 * record.delay_ns as f64);
        self.compute_us.push(1e-3 * record.took_ns as f64);
        for (reading, got) in record.input.readings.iter().zip(&record.output.tools).take(tools) {
            let reading = reading.unwrap_or_default();
            let (pose, twist, computed) = (&reading.pose, &reading.twist, &got.computed);
            let port = got.port.map(f64::from);
            let numbers: [&[f64]; 10] = [
                &pose.position.to_array(),
                &wxyz(pose.orientation),
                &twist.linear.to_array(),
                &twist.angular.to_array(),
                &got.wrench.force.to_array(),
                &got.wrench.torque.to_array(),
                &computed.limited.force.to_array(),
                &computed.limited.torque.to_array(),
                &computed.law.force.to_array(),
                &port,
            ];
            self.vectors.iter_mut().zip(numbers).for_each(|(to, numbers)| to.extend(numbers));
            self.buttons.push(reading.buttons.0);
            self.active.push(reading.active);
            self.limited.push(got.limited);
        }
        self.note_events(record, tools);
        let (tick, settings) = (record.tick, &record.input.settings);
        let (before, last) = self.settings.last().map_or((None, Strike::default()), |(_, s, k)| (Some(s), *k));
        let strike = record.input.strike.unwrap_or(last);
        if before.is_none_or(|before| !same_settings(before, settings)) || strike != last {
            self.settings.push((tick, *settings, strike));
        }
        for c in record.output.contacts.iter() {
            let grab = if c.mode == Mode::Grab { 2 } else { 1 };
            self.contact_state.extend([tick, c.tool.into(), c.body.into(), grab, c.slipping.into(), c.limited.into()]);
            for vector in [c.point, c.normal, c.force, c.torque, [c.radius, c.depth, c.stiffness]] {
                self.contact_numbers.extend(vector);
            }
            self.contact_numbers.push(c.error);
        }
        for (body, state) in record.output.bodies.iter().enumerate() {
            if let Some((time, energy)) = state {
                self.bodies.extend([tick as f64, body as f64, *time]);
                self.bodies.extend(energy_array(energy));
            }
        }
    }

    /// What people want to know of a tick.
    fn note_events(&mut self, record: &TickRecord, tools: usize) {
        let of_tools = record.output.tools.iter().take(tools).enumerate();
        let now = of_tools.map(|(tool, output)| output.fault.map(|fault| format!("tool {tool}: {fault}")));
        let now: Vec<_> = now.chain([record.input.fault.map(|fault| fault.to_string())]).collect();
        let input = &record.input;
        let mut note = |what: String| self.events.push((record.tick, what));
        if input.reset {
            note("reset".into());
        }
        if let Some(strike) = input.strike {
            note(format!("strike of {} N s on body {}", strike.impulse.length(), strike.body));
        }
        for (rank, fault) in now.iter().enumerate() {
            if let Some(fault) = fault.as_ref().filter(|_| self.faults.get(rank) != Some(fault)) {
                note(fault.clone());
            }
        }
        self.faults = now;
    }
}

/// Columns of a recording: what was recorded, numbers of the ticks and of their contacts, and how it ended.
#[pyfunction]
pub fn read_recording(py: Python<'_>, source: Source) -> Answer<Bound<'_, PyDict>> {
    let mut ticks = open(source)?;
    let tools = ticks.about.get("tools").and_then(|tools| tools.parse().ok()).unwrap_or(1);
    let mut columns = Columns::default();
    in_parts(py, usize::MAX, |count| {
        let mut pushed = 0;
        for record in ticks.by_ref().take(count) {
            columns.push(&record?, tools);
            pushed += 1;
        }
        Ok(pushed)
    })?;
    let answer = PyDict::new(py);
    answer.set_item("about", &ticks.about)?;
    answer.set_item("dropped", ticks.ending.map(|ending| ending.dropped))?;
    answer.set_item("number", columns.number.into_pyarray(py))?;
    answer.set_item("due_ns", columns.due_ns.into_pyarray(py))?;
    for (name, numbers) in VECTORS.into_iter().zip(columns.vectors) {
        answer.set_item(name, numbers.into_pyarray(py))?;
    }
    answer.set_item("buttons", columns.buttons.into_pyarray(py))?;
    answer.set_item("active", columns.active.into_pyarray(py))?;
    answer.set_item("limited", columns.limited.into_pyarray(py))?;
    answer.set_item("delay_us", columns.delay_us.into_pyarray(py))?;
    answer.set_item("compute_us", columns.compute_us.into_pyarray(py))?;
    answer.set_item("events", columns.events)?;
    let settings = columns.settings.iter().map(|settings| settings_from(py, settings, tools));
    answer.set_item("settings", settings.collect::<Answer<Vec<_>>>()?)?;
    answer.set_item("contact_state", columns.contact_state.into_pyarray(py))?;
    answer.set_item("contact_numbers", columns.contact_numbers.into_pyarray(py))?;
    answer.set_item("bodies", columns.bodies.into_pyarray(py))?;
    Ok(answer)
}

/// Works through up to so many ticks in parts, with looks for an interrupt between them: `part` is given how many to make, and
/// makes fewer where they end. How many there were.
fn in_parts(py: Python<'_>, count: usize, mut part: impl FnMut(usize) -> Result<usize> + Send) -> Answer<usize> {
    let mut done = 0;
    while done < count {
        let asked = INTERRUPT_TICKS.min(count - done);
        let made = py.detach(|| part(asked));
        py.check_signals()?;
        let made = made?;
        done += made;
        if made < asked {
            break;
        }
    }
    Ok(done)
}

/// Settings from a tick on, with a stiffness scale for each body there could be, and the latest strike.
fn settings_from<'py>(
    py: Python<'py>,
    (tick, settings, strike): &(u64, Settings, Strike),
    tools: usize,
) -> Answer<Bound<'py, PyDict>> {
    let answer = settings_dict(py, settings, tools, MAX_BODIES)?;
    answer.set_item("tick", tick)?;
    answer.set_item("strike_body", strike.body)?;
    answer.set_item("strike_point", strike.point.to_array())?;
    answer.set_item("strike_impulse", strike.impulse.to_array())?;
    answer.set_item("strike_radius", strike.radius)?;
    answer.set_item("strike_duration", strike.duration)?;
    Ok(answer)
}

/// Tick, whose, quantity, numbers recorded and now.
type DifferenceRecord = (u64, String, &'static str, Vec<f64>, Vec<f64>);

/// A recording made again, tick by tick.
#[pyclass(module = "palpate._native")]
pub struct Replay {
    parts: Mutex<(RecordedTicks, palpate_servo::Replay)>,
    model: std::sync::Arc<palpate_core::simulation::Model>,
}

#[pymethods]
impl Replay {
    /// Of a recording, with the simulation that it was made with.
    #[new]
    fn new(py: Python<'_>, core: &SimulationCore, source: Source) -> Answer<Self> {
        let ticks = open(source)?;
        let PreparedScene { model, limits, settings, strain, devices, .. } = core.prepared(py);
        let replay = palpate_servo::Replay::new(&model, &devices, limits, settings, strain)?;
        Ok(Self { parts: Mutex::new((ticks, replay)), model })
    }

    /// Makes up to so many ticks again: how many there were, and what is not as recorded.
    fn step(&self, py: Python<'_>, count: usize) -> Answer<(usize, Vec<DifferenceRecord>)> {
        let mut differences = Vec::new();
        let done = in_parts(py, count, |count| {
            let mut parts = locked(&self.parts);
            let (recorded, replay) = &mut *parts;
            let mut made = 0;
            for record in recorded.take(count) {
                differences.extend(replay.tick(&record?)?);
                made += 1;
            }
            Ok(made)
        })?;
        let record = |d: palpate_servo::Difference| (d.tick, d.of.to_string(), d.quantity, d.recorded, d.replayed);
        Ok((done, differences.into_iter().map(record).collect()))
    }

    /// What the longest tick so far took of the thread's own time, us.
    #[getter]
    fn longest_us(&self) -> f64 {
        1e-3 * locked(&self.parts).1.longest_ns() as f64
    }

    /// The latest tick made again, as a dictionary.
    fn frame<'py>(&self, py: Python<'py>) -> Answer<Bound<'py, PyDict>> {
        let published = locked(&self.parts).1.latest().clone();
        frame(py, &self.model, published)
    }

    /// Rows of the log since the last call, as of a running loop; their computing times are not those of the recording.
    fn drain_log<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let mut rows = Vec::new();
        let mut parts = locked(&self.parts);
        let replay = &mut parts.1;
        let body = replay.latest().status.settings.watch.map_or(0, |(body, _)| body).min(MAX_BODIES - 1);
        replay.drain_log(|row| push_row(&mut rows, &row, body));
        rows.into_pyarray(py)
    }

    /// Settings of the latest tick, and the body and rank of the node that was watched.
    fn settings<'py>(&self, py: Python<'py>) -> Answer<Bound<'py, PyDict>> {
        let mut parts = locked(&self.parts);
        let settings = parts.1.latest().status.settings;
        let answer = settings_dict(py, &settings, self.model.tools.len(), self.model.bodies.len())?;
        answer.set_item("watched", settings.watch)?;
        Ok(answer)
    }
}
