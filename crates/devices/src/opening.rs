//! Types for listing and opening devices: connection, found device, error, scheduler.

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use crate::{Device, DeviceLimits};

/// Which device to open, and by what; what is left out is the driver's default.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Connection {
    /// Name, number or identity of the device, as [`FoundDevice::id`] has it; the first one that is free by default.
    pub id: Option<String>,
    /// Where its service listens, such as `ws://localhost:10001`.
    pub address: Option<String>,
    /// The vendor's library.
    pub library: Option<PathBuf>,
}

/// A device that is ready, and who calls the tick.
pub struct ReadyDevice {
    /// To be read and written once a tick.
    pub device: Box<dyn Device>,
    /// The driver whose thread alone may read and write it; none for a device that any thread may.
    pub scheduler: Option<Arc<dyn Scheduler>>,
}

/// A driver with a servo thread of its own. There is one a process for all devices of a driver.
pub trait Scheduler: Send + Sync {
    /// Ticks a second.
    fn rate(&self) -> f64;

    /// Begins to call `tick` at that rate from the driver's thread.
    ///
    /// # Errors
    /// A driver that cannot start, or has been started already.
    fn start(&self, tick: Box<dyn FnMut() + Send>) -> Result<(), OpenError>;

    /// Ends that: when it returns, the tick is not called any more and has been dropped. Once more, it does nothing.
    fn stop(&self);
}

/// Why a device cannot be opened, in one line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OpenError {
    /// What is wrong, and where.
    pub what: String,
    /// What to do.
    pub advice: String,
}

impl OpenError {
    /// What is wrong, and what to do.
    pub fn new(what: impl Into<String>, advice: impl Into<String>) -> Self {
        Self { what: what.into(), advice: advice.into() }
    }
}

impl fmt::Display for OpenError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.what, self.advice)
    }
}

impl std::error::Error for OpenError {}

/// What a driver sees of its devices.
#[derive(Clone, Debug)]
pub struct Listing {
    /// The devices that there are.
    pub found: Vec<FoundDevice>,
    /// Why there are none, or no more: a library that is missing and where it was looked for, a service that does not run.
    pub missing: Option<OpenError>,
    /// Facts of the driver itself, such as its version and where its library lies, by name.
    pub facts: Vec<(&'static str, String)>,
}

/// A device that can be opened, or says why not.
#[derive(Clone, Debug)]
pub struct FoundDevice {
    /// To be given as [`Connection::id`].
    pub id: String,
    /// Model, as a person knows it.
    pub name: String,
    /// What it can render, as far as is known before it is opened.
    pub limits: DeviceLimits,
    /// Why it cannot be opened now: not calibrated, in use, without permission.
    pub obstacle: Option<OpenError>,
    /// Facts of the device, such as its firmware, by name.
    pub facts: Vec<(&'static str, String)>,
}
