//! Recordings written beside the loop.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use palpate_core::Result;
use palpate_core::simulation::Model;
use palpate_recording::Header;

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
