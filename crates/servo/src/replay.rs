//! Replay of recorded ticks, and the differences from the recording.

use std::collections::VecDeque;
use std::fmt;
use std::sync::Arc;

use palpate_core::Result;
use palpate_core::dynamics::Energy;
use palpate_core::simulation::{Model, Wrench};
use palpate_devices::{Device, DeviceFault, DeviceLimits, Reading};
use rtrb::{Consumer, Producer, RingBuffer};

use crate::force_loop::ForceLoop;
use crate::handoff::{LOG_ROWS, LoopHandle, Published};
use crate::log::LogRow;
use crate::platform::computed_ns;
use crate::preparer::StrainPreparer;
use crate::record::{RecordedContact, RecordedInput, RecordedOutput, RecordedTool, StrainRequestId, TickRecord};
use crate::safety::SafetyLimits;
use crate::settings::Settings;
use crate::strain::{PreparerEnd, StrainRequest};

/// A quantity that came out otherwise than recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The tick.
    pub tick: u64,
    /// The tool or body, if it is of one.
    pub of: Owner,
    /// What it is.
    pub quantity: &'static str,
    /// Its numbers, as recorded.
    pub recorded: Vec<f64>,
    /// Its numbers now.
    pub replayed: Vec<f64>,
}

/// Whose a quantity is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Owner {
    /// Of the whole scene.
    Scene,
    /// Of a tool.
    Tool(usize),
    /// Of a body.
    Body(usize),
}

/// Empty for the scene.
impl fmt::Display for Owner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Owner::Scene => Ok(()),
            Owner::Tool(tool) => write!(f, "tool {tool}"),
            Owner::Body(body) => write!(f, "body {body}"),
        }
    }
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let of = if self.of == Owner::Scene { String::new() } else { format!("{}: ", self.of) };
        let (tick, quantity) = (self.tick, self.quantity);
        write!(f, "tick {tick}: {of}{quantity} was {:?}, is {:?}", self.recorded, self.replayed)
    }
}

/// A loop that makes recorded ticks again, in order from the first.
pub struct Replay {
    force_loop: ForceLoop,
    handle: LoopHandle,
    readings: Vec<Readings>,
    records: Consumer<TickRecord>,
    strain: StrainPreparer,
    end: PreparerEnd,
    requests: VecDeque<StrainRequest>,
    tools: usize,
    longest_ns: u64,
}

impl Replay {
    /// With what the loop of the recording was made of.
    ///
    /// # Errors
    /// See [`ForceLoop::new`].
    pub fn new(
        model: &Arc<Model>,
        devices: &[DeviceLimits],
        limits: SafetyLimits,
        settings: Settings,
        strain: StrainPreparer,
    ) -> Result<Self> {
        let (readings, devices) = devices.iter().map(|&limits| ReplayedDevice::boxed(limits)).unzip();
        let (force_loop, mut handle) = ForceLoop::without_clock(model, devices, limits, settings, &strain, LOG_ROWS)?;
        let (records, end) = (handle.begin_recording()?, handle.take_strain()?);
        let tools = model.tools.len();
        Ok(Self { force_loop, handle, readings, records, strain, end, requests: VecDeque::new(), tools, longest_ns: 0 })
    }

    /// Makes a tick again, and says what is not as recorded: nothing, if every bit is.
    ///
    /// # Errors
    /// Settings that the model refuses.
    pub fn tick(&mut self, recorded: &TickRecord) -> Result<Vec<Difference>> {
        let replayed = self.repeat_tick(&recorded.input)?;
        let Some(replayed) = replayed else { return Ok(Vec::new()) };
        let mut differences = Differences { tick: recorded.tick, of: Owner::Scene, found: Vec::new() };
        differences.compare(&recorded.output, &replayed.output, self.tools);
        Ok(differences.found)
    }

    /// What the longest tick so far took of the thread's own time, ns: what other programs take of the processor is not in it.
    pub fn longest_ns(&self) -> u64 {
        self.longest_ns
    }

    /// The latest tick.
    pub fn latest(&mut self) -> &Published {
        self.handle.latest()
    }

    /// Hands out the rows of the log since the last call, as of a running loop.
    pub fn drain_log(&mut self, each: impl FnMut(LogRow)) {
        self.handle.drain_log(each);
    }

    fn repeat_tick(&mut self, input: &RecordedInput) -> Result<Option<TickRecord>> {
        hand_over(input, input.settings, &mut self.handle, &mut self.readings)?;
        for &id in input.strain.arrived() {
            self.answer(id);
        }
        self.force_loop.prepare_replay(input);
        let begun = computed_ns();
        self.force_loop.tick(input.due_ns, input.period);
        self.longest_ns = self.longest_ns.max(computed_ns() - begun);
        while let Ok(request) = self.end.requests.pop() {
            self.requests.push_back(request);
        }
        Ok(self.records.pop().ok())
    }

    /// Answers the request that was answered then. Those before it never were, and never will be.
    fn answer(&mut self, id: StrainRequestId) {
        let answer = self.requests.iter().find(|request| request.id == id);
        if let Some(answer) = answer.and_then(|request| self.strain.prepare(request)) {
            self.end.send(answer);
        }
        self.requests.retain(|request| request.id.body != id.body || request.id.tick > id.tick);
    }
}

/// Hands recorded inputs over for the next tick, with settings that are to hold: strikes, a reset, and what the devices said.
pub(crate) fn hand_over(
    input: &RecordedInput,
    settings: Settings,
    handle: &mut LoopHandle,
    readings: &mut [Readings],
) -> Result<()> {
    handle.set(settings)?;
    if input.reset {
        handle.reset()?;
    }
    input.strike.map_or(Ok(()), |strike| handle.strike(strike))?;
    for (readings, &reading) in readings.iter_mut().zip(&input.readings) {
        let _ = readings.push(reading);
    }
    Ok(())
}

/// Where a device is given a reading before each tick.
pub(crate) type Readings = Producer<Result<Reading, DeviceFault>>;

/// A device that says what was recorded.
pub(crate) struct ReplayedDevice {
    readings: Consumer<Result<Reading, DeviceFault>>,
    limits: DeviceLimits,
}

impl ReplayedDevice {
    /// One, and where it is given its readings.
    pub(crate) fn boxed(limits: DeviceLimits) -> (Readings, Box<dyn Device>) {
        let (producer, readings) = RingBuffer::new(1);
        (producer, Box::new(Self { readings, limits }))
    }
}

impl Device for ReplayedDevice {
    fn name(&self) -> &str {
        "recording"
    }

    fn read(&mut self, _now_ns: u64, _period: f64) -> Result<Reading, DeviceFault> {
        self.readings.pop().unwrap_or(Err(DeviceFault::Disconnected))
    }

    /// What a device refused then is a fault of the next recorded tick.
    fn write(&mut self, _wrench: Wrench) -> Result<(), DeviceFault> {
        Ok(())
    }

    fn limits(&self) -> DeviceLimits {
        self.limits
    }
}

/// Compares bit by bit.
struct Differences {
    tick: u64,
    of: Owner,
    found: Vec<Difference>,
}

impl Differences {
    fn compare(&mut self, recorded: &RecordedOutput, replayed: &RecordedOutput, tools: usize) {
        for (tool, (was, is)) in recorded.tools.iter().zip(&replayed.tools).enumerate().take(tools) {
            self.of = Owner::Tool(tool);
            self.compare_tool(was, is);
        }
        self.of = Owner::Scene;
        let (was, is) = (recorded.contacts.iter(), replayed.contacts.iter());
        self.numbers("number of contacts", &[was.len() as f64], &[is.len() as f64]);
        for (was, is) in was.zip(is) {
            self.of = Owner::Tool(was.tool.into());
            self.compare_contact(was, is);
        }
        for (body, (was, is)) in recorded.bodies.iter().zip(&replayed.bodies).enumerate() {
            self.of = Owner::Body(body);
            let numbers = |energies: &Option<(f64, Energy)>| match energies {
                Some((time, e)) => vec![*time, e.kinetic, e.strain, e.coupling, e.dissipated, e.work],
                None => Vec::new(),
            };
            self.numbers("time and energies", &numbers(was), &numbers(is));
        }
    }

    fn compare_tool(&mut self, was: &RecordedTool, is: &RecordedTool) {
        let of = |wrench: &Wrench| (wrench.force.to_array(), wrench.torque.to_array());
        for (names, was, is) in [
            (["force of the contact law", "torque of the contact law"], &was.computed.law, &is.computed.law),
            (["computed force", "computed torque"], &was.computed.limited, &is.computed.limited),
            (["force on the device", "torque on the device"], &was.wrench, &is.wrench),
        ] {
            let ((force_was, torque_was), (force_is, torque_is)) = (of(was), of(is));
            self.numbers(names[0], &force_was, &force_is);
            self.numbers(names[1], &torque_was, &torque_is);
        }
        self.numbers("energy at the port", &was.port.map(f64::from), &is.port.map(f64::from));
        self.numbers("limit of strain", &[f64::from(was.limited)], &[f64::from(is.limited)]);
        self.numbers("fault", &[f64::from(was.fault.is_some())], &[f64::from(is.fault.is_some())]);
    }

    fn compare_contact(&mut self, was: &RecordedContact, is: &RecordedContact) {
        let state = |c: &RecordedContact| {
            [c.tool.into(), c.body.into(), f64::from(c.mode as u8), c.slipping.into(), c.limited.into()]
        };
        self.numbers("state of a contact", &state(was), &state(is));
        let vector = |v: [f32; 3]| v.map(f64::from);
        for (name, was, is) in [
            ("contact point", was.point, is.point),
            ("contact normal", was.normal, is.normal),
            ("contact force", was.force, is.force),
            ("contact torque", was.torque, is.torque),
            (
                "contact radius, depth and stiffness",
                [was.radius, was.depth, was.stiffness],
                [is.radius, is.depth, is.stiffness],
            ),
        ] {
            self.numbers(name, &vector(was), &vector(is));
        }
    }

    fn numbers(&mut self, quantity: &'static str, was: &[f64], is: &[f64]) {
        let bits = |numbers: &[f64]| numbers.iter().map(|number| number.to_bits()).collect::<Vec<_>>();
        if bits(was) != bits(is) {
            let (recorded, replayed) = (was.to_vec(), is.to_vec());
            self.found.push(Difference { tick: self.tick, of: self.of, quantity, recorded, replayed });
        }
    }
}
