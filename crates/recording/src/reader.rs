//! Reading of recorded ticks from a file, complete or cut short.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use cdr_encoding::from_bytes;
use mcap::read::parse_record;
use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use palpate_core::simulation::Strike;
use palpate_core::{Error, Result};
use palpate_servo::{Settings, TickRecord};
use serde::Deserialize;

use crate::checksummed::verified;
use crate::messages::{SettingsMessage, Tick};
use crate::writer::{END, METADATA, SETTINGS, TICKS};

/// Least format of the texts whose ticks are read.
const OLDEST_FORMAT: u32 = 3;

/// The ticks of a file, one after the other; nothing of the file is kept but a chunk.
pub struct Ticks<R = BufReader<File>> {
    records: Records<R>,
    /// What was recorded.
    pub about: BTreeMap<String, String>,
    topics: BTreeMap<u16, String>,
    settings: Option<(Settings, Strike)>,
    /// How the file ended; `None` while it has not, and for one that was cut short.
    pub ending: Option<FileEnd>,
    /// Ticks so far.
    count: u64,
}

/// How a file ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileEnd {
    /// Ticks that were not written.
    pub dropped: u64,
}

impl Ticks {
    /// Opens a file.
    ///
    /// # Errors
    /// The system's; a file that is not a recording of ours.
    pub fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(|source| Error::Io { path: path.into(), source })?;
        let ticks = Self::new(BufReader::new(file));
        ticks.map_err(|reason| Error::Invalid(format!("{}: {reason}", path.display())))
    }
}

impl<R: Read> Ticks<R> {
    /// Of what is read.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn new(read: R) -> std::result::Result<Self, String> {
        let mut records = Records::new(read);
        // What was recorded comes before the first message.
        loop {
            match records.next() {
                Some(Ok(Record::Header(_))) => {}
                Some(Ok(Record::Metadata(metadata))) if metadata.name == METADATA => {
                    let damaged = |reason| format!("the recording is damaged: {reason}");
                    let about = verified(metadata.metadata).map_err(damaged)?;
                    let format = about.get("format").and_then(|format| format.parse::<u32>().ok());
                    if format.is_some_and(|format| format < OLDEST_FORMAT) {
                        return Err("an older Palpate made this recording: its contacts state no error".into());
                    }
                    let topics = BTreeMap::new();
                    return Ok(Self { records, about, topics, settings: None, ending: None, count: 0 });
                }
                Some(Err(error)) => return Err(format!("this is no recording: {error}")),
                _ => return Err("this MCAP file was not recorded by Palpate: it does not say what".into()),
            }
        }
    }

    /// The end of a file that has all of its ticks: a chunk whose kind is damaged would be passed over.
    fn end_of(&self, texts: BTreeMap<String, String>) -> std::result::Result<FileEnd, String> {
        let numbers = verified(texts)?;
        let number = |name: &str| numbers.get(name).and_then(|number| number.parse::<u64>().ok());
        match number("ticks") {
            Some(ticks) if ticks != self.count => Err(format!("{} of {ticks} ticks are there", self.count)),
            _ => Ok(FileEnd { dropped: number("dropped").unwrap_or(0) }),
        }
    }

    fn tick(&mut self, record: Record<'_>) -> std::result::Result<Option<TickRecord>, String> {
        match record {
            Record::Channel(channel) => _ = self.topics.insert(channel.id, channel.topic),
            Record::Metadata(metadata) if metadata.name == END => {
                self.ending = Some(self.end_of(metadata.metadata)?);
            }
            Record::Message { header, data } => match self.topics.get(&header.channel_id).map(String::as_str) {
                Some(SETTINGS) => self.settings = Some(decoded::<SettingsMessage>(&data)?.settings()),
                Some(TICKS) => {
                    let settings = self.settings.ok_or("a tick comes before its settings")?;
                    self.count += 1;
                    return Ok(Some(decoded::<Tick>(&data)?.record(settings)));
                }
                _ => {}
            },
            _ => {}
        }
        Ok(None)
    }
}

/// Up to the end of the file, or to the last whole chunk of one that was cut short.
impl<R: Read> Iterator for Ticks<R> {
    type Item = Result<TickRecord>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.ending.is_none() {
            let tick = match self.records.next()? {
                Ok(record) => self.tick(record),
                Err(_) if self.records.cut => return None,
                Err(error) => Err(error.to_string()),
            };
            match tick {
                Ok(Some(tick)) => return Some(Ok(tick)),
                Ok(None) => {}
                Err(reason) => return Some(Err(Error::Invalid(format!("the recording is damaged: {reason}")))),
            }
        }
        None
    }
}

fn decoded<T: for<'a> Deserialize<'a>>(data: &[u8]) -> std::result::Result<T, String> {
    let (_encapsulation, message) = data.split_at_checked(4).ok_or("a message is too short")?;
    let decoded = from_bytes::<T, byteorder::LittleEndian>(message).map_err(|error| error.to_string());
    decoded.map(|(message, _)| message)
}

/// Longest record that is believed, bytes; ours are chunks of some megabytes. A damaged length would be allocated.
const LONGEST_RECORD: usize = 256 << 20;

/// All records, out of their chunks.
struct Records<R> {
    read: R,
    reader: LinearReader,
    /// Whether the bytes came to an end where more were asked for.
    cut: bool,
}

impl<R: Read> Records<R> {
    fn new(read: R) -> Self {
        let options = LinearReaderOptions::default()
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(LONGEST_RECORD);
        Self { read, reader: LinearReader::new_with_options(options), cut: false }
    }

    fn next(&mut self) -> Option<mcap::McapResult<Record<'static>>> {
        while let Some(event) = self.reader.next_event() {
            match event {
                Ok(LinearReadEvent::ReadRequest(bytes)) => match self.read.read(self.reader.insert(bytes)) {
                    Ok(read) => {
                        self.cut = read == 0;
                        self.reader.notify_read(read);
                    }
                    Err(error) => return Some(Err(error.into())),
                },
                Ok(LinearReadEvent::Record { data, opcode }) => {
                    return Some(parse_record(opcode, data).map(Record::into_owned));
                }
                Err(error) => return Some(Err(error)),
            }
        }
        None
    }
}
