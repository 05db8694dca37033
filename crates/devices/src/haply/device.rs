//! The `Device` that the loop reads and writes. It never waits and never allocates.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use triple_buffer::{Input, Output as Latest};

use super::client::STALE_NS;
use super::handoff::{Clock, ForceRequest, PublishedReading};
use super::output::hold_ns;
use crate::{Device, DeviceFault, DeviceLimits, Reading, Wrench};

/// Longest time to wait for the thread's last message. A thread that is about to connect has no force to take off.
const JOIN_TIMEOUT: Duration = Duration::from_millis(200);

/// An arm of the service.
pub struct Haply {
    name: String,
    limits: DeviceLimits,
    clock: Clock,
    from_thread: Latest<PublishedReading>,
    to_thread: Input<ForceRequest>,
    /// Number of the latest fault that the loop knows of.
    known_fault: Option<u64>,
    fault: Option<DeviceFault>,
    /// Shortest time for which a force stays on the motors, ns.
    least_hold_ns: u64,
    hold_ns: u64,
    stop: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl Haply {
    /// With the thread that serves it.
    pub fn new(
        (name, limits): (String, DeviceLimits),
        (clock, hold): (Clock, Duration),
        (from_thread, to_thread): (Latest<PublishedReading>, Input<ForceRequest>),
        (stop, thread): (Arc<AtomicBool>, JoinHandle<()>),
    ) -> Self {
        let hold_ns = hold.as_nanos() as u64;
        let (known_fault, fault, least_hold_ns) = (None, None, hold_ns);
        Self { name, limits, clock, from_thread, to_thread, known_fault, fault, least_hold_ns, hold_ns, stop, thread }
    }

    fn latest(&mut self) -> Result<Reading, DeviceFault> {
        let published = *self.from_thread.read();
        let known_fault = self.known_fault.replace(published.faults);
        if known_fault.is_some_and(|known_fault| known_fault != published.faults) {
            // Also one that was over before this tick.
            return Err(published.latest);
        }
        let age_ns = self.clock.now_ns().saturating_sub(published.reading.timestamp_ns);
        match published.fault {
            Some(fault) => Err(fault),
            None if age_ns > STALE_NS => Err(DeviceFault::Stale),
            None => Ok(published.reading),
        }
    }
}

impl Device for Haply {
    fn name(&self) -> &str {
        &self.name
    }

    fn read(&mut self, _now_ns: u64, period: f64) -> Result<Reading, DeviceFault> {
        self.hold_ns = hold_ns(self.least_hold_ns, period);
        let reading = self.latest();
        self.fault = reading.err();
        reading
    }

    /// The arm has no motors for torques.
    fn write(&mut self, wrench: Wrench) -> Result<(), DeviceFault> {
        let written_ns = self.clock.now_ns();
        let known_fault = self.known_fault.filter(|_| self.fault.is_none());
        self.to_thread.write(ForceRequest { force: wrench.force, known_fault, written_ns, hold_ns: self.hold_ns });
        self.fault.map_or(Ok(()), Err)
    }

    fn limits(&self) -> DeviceLimits {
        self.limits
    }
}

/// The motors are left without a force.
impl Drop for Haply {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let until = Instant::now() + JOIN_TIMEOUT;
        while !self.thread.is_finished() && Instant::now() < until {
            thread::sleep(Duration::from_millis(1));
        }
    }
}
