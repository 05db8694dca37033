//! Recordings in memory.

use std::io::Cursor;

use palpate_core::{Error, Result};
use palpate_servo::TickRecord;

use crate::writer::{Header, TickWriter};

/// Ticks in a chunk of the file: of no consequence for who reads the whole.
const CHUNK_TICKS: u64 = 512;

/// A recording in memory, up to the first tick that could not be written.
pub struct RecordingInMemory {
    writer: TickWriter<Cursor<Vec<u8>>>,
    ticks: u64,
    failed: Option<String>,
}

impl RecordingInMemory {
    /// An empty one.
    ///
    /// # Errors
    /// A header that cannot be written.
    pub fn new(header: Header) -> Result<Self> {
        let writer = TickWriter::new(Cursor::default(), header).map_err(|error| Error::Invalid(error.to_string()))?;
        Ok(Self { writer, ticks: 0, failed: None })
    }

    /// One more tick.
    pub fn push(&mut self, record: &TickRecord) {
        if self.failed.is_some() {
            return;
        }
        let whole = (self.ticks + 1).is_multiple_of(CHUNK_TICKS);
        match self.writer.push(record).and_then(|()| if whole { self.writer.flush() } else { Ok(()) }) {
            Ok(()) => self.ticks += 1,
            Err(error) => self.failed = Some(format!("the recording ends here: {error}")),
        }
    }

    /// Ticks so far, and why no more are recorded.
    pub fn status(&self) -> (u64, Option<&str>) {
        (self.ticks, self.failed.as_deref())
    }

    /// The file.
    ///
    /// # Errors
    /// That of a tick, if one could not be written.
    pub fn finish(self) -> Result<Vec<u8>> {
        match self.failed {
            Some(reason) => Err(Error::Invalid(reason)),
            None => {
                let file = self.writer.finish(Some(self.ticks)).map_err(|error| Error::Invalid(error.to_string()))?;
                Ok(file.into_inner())
            }
        }
    }
}
