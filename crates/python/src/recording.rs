//! Recordings written beside the loop.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use palpate_core::Result;
use palpate_core::simulation::Model;
use palpate_recording::{Header, Recorder};
use palpate_servo::Servo;

/// What is known before the first tick of a recording that begins now; of one without a clock at zero.
pub fn header(about: BTreeMap<String, String>, model: &Model, rate: f64, clock: bool) -> Header {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as u64);
    let (tools, bodies) = (model.tools.len(), model.bodies.len());
    Header { about, tools, bodies, rate, begun_ns: if clock { now } else { 0 } }
}

/// File, ticks, bytes, ticks dropped, why nothing is written any more.
pub type RecordingStatus = (PathBuf, u64, u64, u64, Option<String>);

/// Begins a recording with a running loop.
///
/// # Errors
/// A file that exists; a loop that is being recorded already; the system's.
pub fn begin(path: &Path, header: Header, servo: &mut Servo) -> Result<Recorder> {
    let records = servo.begin_recording()?;
    Recorder::start(path, header, records).inspect_err(|_| {
        servo.end_recording();
    })
}

/// How a recording is doing.
pub fn status(recorder: &Recorder, dropped: u64) -> RecordingStatus {
    let status = recorder.status();
    (recorder.path().into(), status.ticks, status.bytes, dropped, status.error)
}

/// Ends a recording, after so many ticks.
pub fn end(recorder: Recorder, ticks: u64) -> RecordingStatus {
    let path = recorder.path().to_owned();
    let status = recorder.finish(ticks);
    (path, status.ticks, status.bytes, ticks.saturating_sub(status.ticks), status.error)
}
