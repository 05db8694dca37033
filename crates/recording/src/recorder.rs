//! The thread beside the loop that writes a file.

use std::fs::{File, OpenOptions};
use std::io::{BufWriter, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use palpate_core::{Error, Result};
use palpate_servo::TickRecord;
use rtrb::Consumer;

use crate::writer::{Header, TickWriter};

/// Longest that a tick waits before it is in the file: what a killed process loses, and a part of it for the system's delays.
const FLUSH: Duration = Duration::from_millis(50);
/// Time between two looks into the ring.
const PAUSE: Duration = Duration::from_millis(5);

/// A recording under way.
pub struct Recorder {
    path: PathBuf,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Shared {
    stop: AtomicBool,
    ticks: AtomicU64,
    bytes: AtomicU64,
    /// How many ticks the loop has made, where that is known at the end.
    total_ticks: Mutex<Option<u64>>,
    error: Mutex<Option<String>>,
}

/// How a recording is doing.
#[derive(Clone, Debug, PartialEq)]
pub struct RecorderStatus {
    /// Ticks taken up.
    pub ticks: u64,
    /// Size of the file.
    pub bytes: u64,
    /// Why nothing is written any more.
    pub error: Option<String>,
}

impl Recorder {
    /// Starts a new file and a thread that fills it with what comes through the ring.
    ///
    /// # Errors
    /// A file that exists, for it would be lost; the system's.
    pub fn start(path: &Path, header: Header, records: Consumer<TickRecord>) -> Result<Self> {
        let io = |source| Error::Io { path: path.into(), source };
        let file = OpenOptions::new().write(true).create_new(true).open(path).map_err(|source| {
            match source.kind() == ErrorKind::AlreadyExists {
                true => Error::Invalid(format!("{}: exists: give another name, or delete it first", path.display())),
                false => io(source),
            }
        })?;
        let shared = Arc::new(Shared::default());
        let beside = shared.clone();
        let name = path.to_owned();
        let work = move || {
            if let Err(error) = write(file, header, records, &beside) {
                *lock(&beside.error) = Some(format!("{}: {error}: the recording ends here", name.display()));
            }
        };
        let thread = std::thread::Builder::new().name("palpate-recorder".into()).spawn(work).map_err(io)?;
        Ok(Self { path: path.into(), shared, thread: Some(thread) })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// How it is doing.
    pub fn status(&self) -> RecorderStatus {
        let ticks = self.shared.ticks.load(Ordering::Relaxed);
        let bytes = self.shared.bytes.load(Ordering::Relaxed);
        RecorderStatus { ticks, bytes, error: lock(&self.shared.error).clone() }
    }

    /// Ends the file, once the loop pushes nothing any more, of so many ticks made.
    pub fn finish(mut self, total_ticks: u64) -> RecorderStatus {
        *lock(&self.shared.total_ticks) = Some(total_ticks);
        self.stop();
        self.status()
    }

    fn stop(&mut self) {
        self.shared.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Writes until stopped; on an error the file ends with the last whole chunk.
fn write(file: File, header: Header, mut records: Consumer<TickRecord>, shared: &Shared) -> mcap::McapResult<()> {
    let size = || file.metadata().map_or(0, |data| data.len());
    let mut whole = 0;
    let written = (|| {
        let mut writer = TickWriter::new(BufWriter::new(&file), header)?;
        writer.flush()?;
        let mut flushed = Instant::now();
        loop {
            let last = shared.stop.load(Ordering::Acquire);
            while let Ok(record) = records.pop() {
                writer.push(&record)?;
                shared.ticks.fetch_add(1, Ordering::Relaxed);
                if flushed.elapsed() >= FLUSH {
                    break;
                }
            }
            if flushed.elapsed() >= FLUSH || last {
                writer.flush()?;
                (whole, flushed) = (size(), Instant::now());
                shared.bytes.store(whole, Ordering::Relaxed);
            }
            if last && records.is_empty() {
                let total_ticks = *lock(&shared.total_ticks);
                // `finish` has flushed all but the buffer.
                let mut buffer = writer.finish(total_ticks)?;
                std::io::Write::flush(&mut buffer)?;
                shared.bytes.store(size(), Ordering::Relaxed);
                return Ok(());
            }
            if records.is_empty() {
                std::thread::sleep(PAUSE);
            }
        }
    })();
    if written.is_err() {
        let _ = file.set_len(whole);
    }
    written
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
