//! Writing of recorded ticks to a file.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::io::{Seek, Write};

use cdr_encoding::to_vec_with_size_hint;
use mcap::records::{MessageHeader, Metadata};
use palpate_core::simulation::Strike;
use palpate_servo::{FaultReason, Settings, TickRecord};
use serde::Serialize;

use crate::checksummed::with_checksum;
use crate::messages::{Log, PoseStamped, SettingsMessage, Tick, Time, WrenchStamped, same_settings};
use crate::schemas::{NAMES, definition};

/// Topics that there are once; those of a tool follow, two a tool.
pub(crate) const TICKS: &str = "/ticks";
pub(crate) const SETTINGS: &str = "/settings";
const EVENTS: &str = "/events";
/// Name of the record that says what was recorded, and of that which says how it ended.
pub(crate) const METADATA: &str = "palpate";
pub(crate) const END: &str = "palpate_end";
/// Poses and wrenches a second in the messages that every viewer of ROS 2 knows; the ticks have all of them.
const VIEW_RATE: f64 = 50.0;
/// Little-endian CDR without parameters.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];
/// Levels of `rcl_interfaces/Log`.
const INFO: u8 = 20;
const WARN: u8 = 30;
const ERROR: u8 = 40;

/// What is known before the first tick.
#[derive(Clone, Debug)]
pub struct Header {
    /// What was recorded, for a replay.
    pub about: BTreeMap<String, String>,
    /// Tools and bodies of the scene.
    pub tools: usize,
    /// See `tools`.
    pub bodies: usize,
    /// Ticks a second.
    pub rate: f64,
    /// When it begins, ns since 1970; zero where no clock runs.
    pub begun_ns: u64,
}

/// Writes ticks as MCAP.
pub struct TickWriter<W: Write + Seek> {
    file: mcap::Writer<W>,
    header: Header,
    channels: Channels,
    settings: Option<Settings>,
    /// The latest one.
    strike: Strike,
    first_due_ns: Option<u64>,
    /// Number of the tick that should come next; those left out.
    next: u64,
    dropped: u64,
    faults: Vec<Option<FaultReason>>,
}

struct Channels {
    ticks: u16,
    settings: u16,
    events: u16,
    /// Pose and wrench of each tool, and its frame.
    tools: Vec<(u16, u16)>,
}

impl<W: Write + Seek> TickWriter<W> {
    /// Writes what is known before the first tick.
    ///
    /// # Errors
    /// The file's.
    pub fn new(file: W, header: Header) -> mcap::McapResult<Self> {
        let options = mcap::WriteOptions::new()
            .profile("ros2")
            .library(concat!("palpate ", env!("CARGO_PKG_VERSION")))
            // Chunks are cut by calls of flush, and written at once: what is in the file is whole.
            .chunk_size(None)
            .disable_seeking(true);
        #[cfg(feature = "compression")]
        let options = options.compression(Some(mcap::Compression::Zstd)).compression_threads(0);
        #[cfg(not(feature = "compression"))]
        let options = options.compression(None);
        let mut file = options.create(file)?;
        file.write_metadata(&Metadata { name: METADATA.into(), metadata: with_checksum(header.about.clone()) })?;
        let mut schemas = Vec::new();
        for name in NAMES {
            schemas.push(file.add_schema(name, "ros2msg", definition(name).as_bytes())?);
        }
        let mut channel =
            |topic: &str, schema: usize| file.add_channel(schemas[schema], topic, "cdr", &BTreeMap::new());
        let (ticks, settings, events) = (channel(TICKS, 0)?, channel(SETTINGS, 1)?, channel(EVENTS, 2)?);
        let mut tools = Vec::new();
        for tool in 0..header.tools {
            tools.push((channel(&format!("/tool{tool}/pose"), 3)?, channel(&format!("/tool{tool}/wrench"), 4)?));
        }
        Ok(Self {
            file,
            channels: Channels { ticks, settings, events, tools },
            settings: None,
            strike: Strike::default(),
            first_due_ns: None,
            next: 0,
            dropped: 0,
            faults: vec![None; header.tools + 1],
            header,
        })
    }

    /// Writes a tick.
    ///
    /// # Errors
    /// The file's.
    pub fn push(&mut self, record: &TickRecord) -> mcap::McapResult<()> {
        let (tools, bodies) = (self.header.tools, self.header.bodies);
        let first_due_ns = *self.first_due_ns.get_or_insert(record.input.due_ns);
        let now_ns = self.header.begun_ns + record.input.due_ns.saturating_sub(first_due_ns);
        let stamp = Time::from_ns(now_ns);
        let missing = record.tick.saturating_sub(self.next);
        if missing > 0 {
            self.dropped += missing;
            let text = format!("{missing} ticks were not recorded: the file could not be written fast enough");
            self.event(WARN, text, now_ns)?;
        }
        self.next = record.tick + 1;
        let settings = &record.input.settings;
        let strike = record.input.strike.unwrap_or(self.strike);
        if self.settings.as_ref().is_none_or(|before| !same_settings(before, settings)) || strike != self.strike {
            let message = SettingsMessage::new(record, &strike, tools, bodies, stamp);
            self.write(self.channels.settings, record.tick, now_ns, &message)?;
            (self.settings, self.strike) = (Some(*settings), strike);
        }
        self.write(self.channels.ticks, record.tick, now_ns, &Tick::new(record, tools, stamp))?;
        self.write_summary(record, now_ns)?;
        let every = (self.header.rate / VIEW_RATE).round().max(1.0) as u64;
        if record.tick.is_multiple_of(every) { self.show(record, now_ns) } else { Ok(()) }
    }

    /// Makes what has been written so far readable.
    ///
    /// # Errors
    /// The file's.
    pub fn flush(&mut self) -> mcap::McapResult<()> {
        self.file.flush()
    }

    /// Ends the file, of which so many ticks were made; those not written count as dropped.
    ///
    /// # Errors
    /// The file's.
    pub fn finish(mut self, total_ticks: Option<u64>) -> mcap::McapResult<W> {
        let dropped = self.dropped + total_ticks.map_or(0, |total_ticks| total_ticks.saturating_sub(self.next));
        let numbers = [("ticks", self.next - self.dropped), ("dropped", dropped)];
        let metadata = numbers.into_iter().map(|(name, number)| (name.to_owned(), number.to_string())).collect();
        self.file.write_metadata(&Metadata { name: END.into(), metadata: with_checksum(metadata) })?;
        self.file.finish()?;
        Ok(self.file.into_inner())
    }

    /// What people want to know of a tick.
    fn write_summary(&mut self, record: &TickRecord, now_ns: u64) -> mcap::McapResult<()> {
        let input = &record.input;
        if input.reset {
            self.event(INFO, "reset: everything was let go of", now_ns)?;
        }
        if let Some(strike) = input.strike {
            let impulse = strike.impulse.length();
            self.event(INFO, format!("strike of {impulse} N s on body {}", strike.body), now_ns)?;
        }
        let of_tools = record.output.tools.iter().take(self.header.tools).map(|tool| tool.fault);
        let faults: Vec<_> = of_tools.chain([input.fault]).collect();
        for (owner, (&now, before)) in faults.iter().zip(self.faults.clone()).enumerate() {
            match now.filter(|_| now != before) {
                Some(reason) if owner < self.header.tools => {
                    self.event(ERROR, format!("tool {owner}: {reason}"), now_ns)?;
                }
                Some(reason) => self.event(ERROR, reason, now_ns)?,
                None => {}
            }
        }
        self.faults = faults;
        Ok(())
    }

    fn event(&mut self, level: u8, what: impl Display, now_ns: u64) -> mcap::McapResult<()> {
        let (stamp, message) = (Time::from_ns(now_ns), what.to_string());
        let log = Log { stamp, level, name: "palpate", message: &message, file: "", function: "", line: 0 };
        self.write(self.channels.events, self.next, now_ns, &log)
    }

    /// Poses and wrenches for viewers that know only those.
    fn show(&mut self, record: &TickRecord, now_ns: u64) -> mcap::McapResult<()> {
        let stamp = Time::from_ns(now_ns);
        for tool in 0..self.header.tools {
            let (pose, wrench) = self.channels.tools[tool];
            if let Ok(reading) = record.input.readings[tool] {
                let message = PoseStamped(stamp, "world", (&reading.pose).into());
                self.write(pose, record.tick, now_ns, &message)?;
            }
            let message = WrenchStamped(stamp, "world", (&record.output.tools[tool].wrench).into());
            self.write(wrench, record.tick, now_ns, &message)?;
        }
        Ok(())
    }

    fn write(&mut self, channel_id: u16, number: u64, now_ns: u64, message: &impl Serialize) -> mcap::McapResult<()> {
        let mut bytes = ENCAPSULATION.to_vec();
        let encoded = to_vec_with_size_hint::<_, byteorder::LittleEndian>(message, 512);
        bytes.extend(encoded.map_err(|error| std::io::Error::other(error.to_string()))?);
        let sequence = number as u32;
        let header = MessageHeader { channel_id, sequence, log_time: now_ns, publish_time: now_ns };
        self.file.write_to_known_channel(&header, &bytes)
    }
}
