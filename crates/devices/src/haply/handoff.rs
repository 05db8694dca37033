//! Wait-free hand-off between the loop and the driver's thread: the latest force one way, the latest reading the other.
//!
//! Every fault has a number. A force carries the number up to which its reading knew of faults: the thread puts out none that
//! was computed before the latest fault, and the loop is told of every fault even if it was over between two ticks.

use std::time::Instant;

use glam::DVec3;

use crate::{DeviceFault, Reading};

/// From the loop: a force.
#[derive(Clone, Copy, Debug, Default)]
pub struct ForceRequest {
    /// On the hand, N.
    pub force: DVec3,
    /// Number of the latest fault that its reading knew of; `None` before the first reading.
    pub known_fault: Option<u64>,
    /// When it was written, ns.
    pub written_ns: u64,
    /// How long it may stay on the motors, ns.
    pub hold_ns: u64,
}

/// From the thread: the latest measurement.
#[derive(Clone, Copy, Debug)]
pub struct PublishedReading {
    /// What was measured last.
    pub reading: Reading,
    /// Why there is nothing newer.
    pub fault: Option<DeviceFault>,
    /// How many faults there have been.
    pub faults: u64,
    /// The latest of them, also if it is over.
    pub latest: DeviceFault,
}

impl PublishedReading {
    /// Without a fault so far.
    pub fn new(reading: Reading) -> Self {
        Self { reading, fault: None, faults: 0, latest: DeviceFault::Stale }
    }

    /// A fault has come, or still is there.
    pub fn fail(&mut self, fault: DeviceFault) {
        if self.fault != Some(fault) {
            self.faults += 1;
            (self.fault, self.latest) = (Some(fault), fault);
        }
    }

    /// A measurement without a fault.
    pub fn succeed(&mut self, reading: Reading) {
        (self.reading, self.fault) = (reading, None);
    }
}

/// Monotonic time since a device was opened.
#[derive(Clone, Copy, Debug)]
pub struct Clock(Instant);

impl Clock {
    /// From now on.
    pub fn start() -> Self {
        Self(Instant::now())
    }

    /// Now, ns.
    pub fn now_ns(&self) -> u64 {
        u64::try_from(self.0.elapsed().as_nanos()).unwrap_or(u64::MAX)
    }
}
