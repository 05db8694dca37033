//! Start and end of a recording in a running loop.
//!
//! A recording can be made again bit for bit if it begins from a known state: at rest, nothing touched, at the start of the
//! safety ramp. That state is made beside the loop, and exchanged for the loop's own within one tick. The same way the ring
//! of records comes in and goes out.

use palpate_core::simulation::{Model, State};
use palpate_core::{Error, Result};
use rtrb::{Consumer, Producer, RingBuffer};

use crate::exchange::{ExchangeEnd, ExchangeHandle, exchange_ends};
use crate::record::{RecordedContacts, RecordedInput, RecordedTool, TickRecord, recorded_bodies};
use crate::safety::{FaultReason, SafetyStage};

/// Ticks that a recorder may be behind: four seconds at 1 kHz, about 20 MB.
const RECORDS: usize = 4096;
/// Exchanges that may be under way.
const EXCHANGES: usize = 16;

/// The state that a recording starts from: at rest, without contacts.
pub(crate) struct StartState {
    pub state: State,
    pub stages: Vec<SafetyStage>,
    pub records: Option<Producer<TickRecord>>,
}

/// Requests to the loop; each goes back with the memory that it replaced.
pub(crate) enum Request {
    Begin(Box<StartState>),
    End,
    /// On its way to where its memory may be freed.
    Ended(#[expect(dead_code)] Producer<TickRecord>),
}

/// The loop's end.
pub(crate) struct RecorderEnd {
    exchange: ExchangeEnd<Request>,
    records: Option<Producer<TickRecord>>,
    /// The record of the tick under way.
    record: TickRecord,
    /// Number of the tick under way, since the loop was made, and of the first one recorded.
    pub number: u64,
    first: u64,
    /// How far the recording has come.
    pub progress: RecordingProgress,
}

/// How far a recording has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecordingProgress {
    /// Whether ticks are being recorded.
    pub records: bool,
    /// Ticks since it began.
    pub ticks: u64,
    /// Those of them that found no room, for the recorder was too far behind.
    pub dropped: u64,
}

/// The other threads' end.
pub(crate) struct RecorderHandle {
    exchange: ExchangeHandle<Request>,
    /// As at the start of a loop.
    stages: Vec<SafetyStage>,
    /// Whether a recording has begun, and not been ended.
    pub is_recording: bool,
}

/// Both ends.
pub(crate) fn recorder_ends(stages: &[SafetyStage]) -> (RecorderEnd, RecorderHandle) {
    let (end, exchange) = exchange_ends(EXCHANGES);
    let end = RecorderEnd {
        exchange: end,
        records: None,
        record: TickRecord::empty(),
        number: 0,
        first: 0,
        progress: RecordingProgress::default(),
    };
    (end, RecorderHandle { exchange, stages: stages.to_vec(), is_recording: false })
}

impl RecorderHandle {
    /// Has the loop begin anew and push a record of each tick into the ring whose other end this is.
    pub fn begin(&mut self, model: &Model) -> Result<Consumer<TickRecord>> {
        if std::mem::replace(&mut self.is_recording, true) {
            return Err(Error::Invalid("the loop is being recorded already".into()));
        }
        let (producer, consumer) = RingBuffer::new(RECORDS);
        let beginning = StartState { state: State::new(model), stages: self.stages.clone(), records: Some(producer) };
        self.is_recording = self.exchange.offer(Request::Begin(Box::new(beginning)));
        let busy = || Error::Invalid("the loop has not yet ended the last recording: try again".into());
        self.is_recording.then_some(consumer).ok_or_else(busy)
    }

    /// Has the loop stop recording.
    pub fn end(&mut self) {
        if std::mem::replace(&mut self.is_recording, false) {
            self.exchange.offer(Request::End);
        }
    }
}

impl RecorderEnd {
    /// Begins or ends recording if that was asked for; whether it began, with a new state. A fault stays. Never allocates or
    /// frees.
    pub fn exchange(&mut self, state: &mut State, stages: &mut Vec<SafetyStage>) -> bool {
        let mut began = false;
        while let Some(request) = self.exchange.take() {
            match request {
                Request::Begin(mut beginning) => {
                    for (new, old) in beginning.stages.iter_mut().zip(&*stages) {
                        old.fault().into_iter().for_each(|fault| new.latch(fault));
                    }
                    state.swap_series(&mut beginning.state);
                    std::mem::swap(state, &mut beginning.state);
                    std::mem::swap(stages, &mut beginning.stages);
                    std::mem::swap(&mut self.records, &mut beginning.records);
                    self.exchange.give_back(Request::Begin(beginning));
                    self.progress = RecordingProgress { records: true, ..RecordingProgress::default() };
                    (self.first, began) = (self.number, true);
                }
                Request::End => {
                    self.progress.records = false;
                    if let Some(records) = self.records.take() {
                        self.exchange.give_back(Request::Ended(records));
                    }
                }
                Request::Ended(_) => break,
            }
        }
        began
    }

    /// A tick begins that is due at a time, ns, after a period, s.
    pub fn begin_tick(&mut self, (due_ns, period): (u64, f64), fault: Option<FaultReason>, stages: &[SafetyStage]) {
        let input = &mut self.record.input;
        (input.due_ns, input.period, input.fault) = (due_ns, period, fault);
        for (to, stage) in input.tool_faults.iter_mut().zip(stages) {
            *to = stage.fault();
        }
    }

    /// What came into the tick.
    pub fn input(&mut self) -> &mut RecordedInput {
        &mut self.record.input
    }

    /// What came out for one tool.
    pub fn tool(&mut self, tool: usize) -> &mut RecordedTool {
        &mut self.record.output.tools[tool]
    }

    /// The tick is over, and took a time, ns, after a delay: pushes its record.
    pub fn end_tick(&mut self, model: &Model, state: &State, delay_ns: u64, took_ns: u64) {
        if let Some(records) = &mut self.records {
            self.record.tick = self.number - self.first;
            self.record.input.strain.count_from(self.first);
            self.record.output.contacts = RecordedContacts::of(model, &state.contacts);
            self.record.output.bodies = recorded_bodies(state);
            (self.record.delay_ns, self.record.took_ns) = (delay_ns, took_ns);
            self.progress.ticks += 1;
            self.progress.dropped += u64::from(records.push(self.record).is_err());
        }
        self.number += 1;
    }
}
