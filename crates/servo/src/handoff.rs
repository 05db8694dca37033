//! Wait-free hand-offs between a force loop and other threads, with both ends of each.
//!
//! The latest state goes out through a triple buffer. Settings, resets and strikes come in through one bounded ring, in order.
//! Every tick goes into another ring, and is dropped and counted if nobody drains it. Nothing that another thread does can
//! make the loop wait. What else comes in, prepared off the tick, gets a hand-off of its own here and is taken up in
//! `ForceLoop::receive`.

use std::sync::Arc;

use palpate_core::simulation::{KnownSeries, Model, Snapshot, Strike};
use palpate_core::{Error, Result};
use rtrb::{Consumer, Producer, RingBuffer};
use triple_buffer::{Input, Output, triple_buffer};

use crate::commands::{CommandEnd, CommandHandle, command_ends};
use crate::log::{LogRow, Status};
use crate::record::TickRecord;
use crate::recorder::{RecorderEnd, RecorderHandle, recorder_ends};
use crate::safety::SafetyStage;
use crate::series::{SeriesEnd, SeriesHandle, series_ends};
use crate::settings::Settings;
use crate::strain::{PreparerEnd, StrainEnd, strain_ends};

/// Rows of the log kept for a reader: 20 seconds at 1 kHz.
pub(crate) const LOG_ROWS: usize = 20_000;

/// The latest tick, for drawing.
#[derive(Clone)]
pub struct Published {
    /// What happened.
    pub status: Status,
    /// What is drawn.
    pub state: Snapshot,
}

/// The loop's ends.
pub(crate) struct LoopEnds {
    pub commands: CommandEnd,
    pub published: Input<Published>,
    pub rows: Producer<LogRow>,
    pub strain: StrainEnd,
    pub series: SeriesEnd,
    pub recorder: RecorderEnd,
}

/// The other threads' ends.
pub struct LoopHandle {
    model: Arc<Model>,
    commands: CommandHandle,
    published: Output<Published>,
    rows: Consumer<LogRow>,
    /// The end of the thread that prepares strain responses.
    strain: Option<PreparerEnd>,
    series: SeriesHandle,
    recorder: RecorderHandle,
}

/// Both ends, with settings that have been checked, the safety stages of the start and room for so many rows of the log.
pub(crate) fn handoffs(
    model: &Arc<Model>,
    settings: &Settings,
    stages: &[SafetyStage],
    log_rows: usize,
) -> (LoopEnds, LoopHandle) {
    let (command_end, commands) = command_ends();
    let status = Status { settings: *settings, ..Status::default() };
    let first = Published { status, state: Snapshot::new(model) };
    let (published_in, published_out) = triple_buffer(&first);
    let (producer, consumer) = RingBuffer::new(log_rows);
    let (strain, preparer) = strain_ends();
    let (series, series_handle) = series_ends();
    let (recorder_end, recorder) = recorder_ends(stages);
    let ends = LoopEnds {
        commands: command_end,
        published: published_in,
        rows: producer,
        strain,
        series,
        recorder: recorder_end,
    };
    let handle = LoopHandle {
        model: model.clone(),
        commands,
        published: published_out,
        rows: consumer,
        strain: Some(preparer),
        series: series_handle,
        recorder,
    };
    (ends, handle)
}

impl LoopHandle {
    /// Changes the settings; wait-free.
    ///
    /// # Errors
    /// See [`Settings::check`]; so many changes that the loop cannot be ticking. The loop then keeps those it has.
    pub fn set(&mut self, settings: Settings) -> Result<()> {
        settings.check(&self.model)?;
        self.commands.set(settings)
    }

    /// Lets go of everything, brings moving bodies to rest and clears faults; wait-free.
    ///
    /// # Errors
    /// So many changes that the loop cannot be ticking.
    pub fn reset(&mut self) -> Result<()> {
        self.commands.reset()
    }

    /// Strikes a body in motion; wait-free. Strikes are given in order, one a tick, after the settings that were set before;
    /// a reset takes back those that still wait.
    ///
    /// # Errors
    /// A body that the model does not have; so many strikes that the loop has not come to them.
    pub fn strike(&mut self, strike: Strike) -> Result<()> {
        self.commands.strike(&self.model, strike)
    }

    /// Offers higher orders of the displacement of a body, which the loop takes up once they change no force; whether there was room.
    /// Wait-free.
    pub fn offer_series(&mut self, body: usize, series: Arc<KnownSeries>) -> bool {
        self.series.offer(body, series)
    }

    /// Has series that are offered wait, or not any more: while they wait, a recording's ticks have those that it began with.
    pub fn hold_series(&mut self, held: bool) {
        self.series.hold(held);
    }

    /// Whether settings and resets are refused until the loop ticks.
    pub(crate) fn is_full(&self) -> bool {
        self.commands.is_full()
    }

    /// The end of the thread that prepares strain responses.
    pub(crate) fn take_strain(&mut self) -> Result<PreparerEnd> {
        let taken = || Error::Invalid("the strain of this loop is limited already".into());
        self.strain.take().ok_or_else(taken)
    }

    /// Has the loop begin anew, at rest and at the start of the safety ramp, and push a record of each tick into the ring whose
    /// other end this is: a recording can be made again only from a known state. A latched fault stays.
    ///
    /// # Errors
    /// A loop that is being recorded already.
    pub fn begin_recording(&mut self) -> Result<Consumer<TickRecord>> {
        self.recorder.begin(&self.model)
    }

    /// Whether a recording has begun, and not been ended.
    pub(crate) fn is_recorded(&self) -> bool {
        self.recorder.is_recording
    }

    /// Switches to the loop that has replaced this one's. Log and commands continue in the same rings.
    pub(crate) fn switch_to(&mut self, next: LoopHandle) {
        let Self { model, published, strain, series, recorder, .. } = next;
        (self.model, self.published) = (model, published);
        (self.strain, self.series, self.recorder) = (strain, series, recorder);
    }

    /// Has the loop push no more records; what is in the ring stays.
    pub fn end_recording(&mut self) {
        self.recorder.end();
    }

    /// The latest tick; wait-free.
    pub fn latest(&mut self) -> &Published {
        self.published.read()
    }

    /// Hands out the rows of the log since the last call. The latest tick's row comes with the next tick.
    pub fn drain_log(&mut self, mut each: impl FnMut(LogRow)) {
        while let Ok(row) = self.rows.pop() {
            each(row);
        }
    }
}
