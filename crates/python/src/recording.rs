//! Recordings written beside the loop, or in memory.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use palpate_core::simulation::Model;
use palpate_core::{Error, Result};
use palpate_recording::{Header, TickWriter};
use palpate_servo::TickRecord;

/// What is known before the first tick of a recording that begins now; of one without a clock at zero.
pub fn header(about: BTreeMap<String, String>, model: &Model, rate: f64, clock: bool) -> Header {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as u64);
    let (tools, bodies) = (model.tools.len(), model.bodies.len());
    Header { about, tools, bodies, rate, begun_ns: if clock { now } else { 0 } }
}

/// A recording under way.
pub struct Recording {
    recorder: palpate_recording::Recorder,
}

/// File, ticks, bytes, ticks dropped, why nothing is written any more.
pub type RecordingStatus = (PathBuf, u64, u64, u64, Option<String>);

impl Recording {
    /// Begins one with a running loop.
    ///
    /// # Errors
    /// A file that exists; a loop that is being recorded already; the system's.
    pub fn begin(path: &Path, header: Header, servo: &mut palpate_servo::Servo) -> Result<Self> {
        let records = servo.begin_recording()?;
        match palpate_recording::Recorder::start(path, header, records) {
            Ok(recorder) => Ok(Self { recorder }),
            Err(error) => {
                servo.end_recording();
                Err(error)
            }
        }
    }

    /// How it is doing.
    pub fn status(&self, dropped: u64) -> RecordingStatus {
        let status = self.recorder.status();
        (self.recorder.path().into(), status.ticks, status.bytes, dropped, status.error)
    }

    /// Ends it, after so many ticks.
    pub fn end(self, ticks: u64) -> RecordingStatus {
        let path = self.recorder.path().to_owned();
        let status = self.recorder.finish(ticks);
        (path, status.ticks, status.bytes, ticks.saturating_sub(status.ticks), status.error)
    }
}

/// A recording in memory.
pub struct Recorded {
    writer: TickWriter<Cursor<Vec<u8>>>,
    ticks: usize,
    failed: Option<String>,
}

/// Ticks in a chunk of a file that nobody waits for.
const CHUNK_TICKS: usize = 512;

impl Recorded {
    /// An empty one.
    ///
    /// # Errors
    /// None that memory has.
    pub fn new(header: Header) -> Result<Self> {
        let writer =
            TickWriter::new(Cursor::new(Vec::new()), header).map_err(|error| Error::Invalid(error.to_string()))?;
        Ok(Self { writer, ticks: 0, failed: None })
    }

    /// One more tick.
    pub fn push(&mut self, record: &TickRecord) {
        self.ticks += 1;
        let whole = self.ticks.is_multiple_of(CHUNK_TICKS);
        let pushed = self.writer.push(record).and_then(|()| if whole { self.writer.flush() } else { Ok(()) });
        self.failed = self.failed.take().or(pushed.err().map(|error| error.to_string()));
    }

    /// The file.
    ///
    /// # Errors
    /// That of a tick, if one could not be written.
    pub fn finish(self) -> Result<Vec<u8>> {
        if let Some(reason) = self.failed {
            return Err(Error::Invalid(reason));
        }
        let ticks = self.ticks as u64;
        let file = self.writer.finish(Some(ticks)).map_err(|error| Error::Invalid(error.to_string()))?;
        Ok(file.into_inner())
    }
}
