//! A device defined by a program: its own thread measures and moves motors, however long that takes, and the servo reads and
//! writes memory.
//!
//! Readings go one way and wrenches the other through triple buffers: the latest counts, and neither side ever waits. The
//! program polls: it publishes a reading, fetches the wrench, puts it out. A reading that is older than
//! [`LONGEST_SILENCE`] by the ticks of the servo is a fault; a wrench that is older than [`LONGEST_HOLD`] by the clock is zero for
//! the program, and so is one whose loop has ended.
//!
//! **Delay.** Polls a time `P` apart see the hand at `0` and put out at `P` what a tick in between has answered, to hold it for `P`:
//! the answer is `P + P/2` old on average, of which [`DeviceLimits::largest_stiffness`] knows the half period of the tick. It is
//! given the whole as [`DeviceLimits::delay`], on the safe side by that half.

mod end;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use triple_buffer::{Input, Output, triple_buffer};

pub use self::end::ProgramEnd;
use crate::{Device, DeviceFault, DeviceLimits, Pose, Reading, Twist, Wrench};

/// Longest time without a new reading, s. Drivers give up a cable after about as long; the servo's own limit on the age of
/// a reading is the same.
pub const LONGEST_SILENCE: f64 = 0.05;

/// Longest time for which a wrench is put out that no tick has renewed, s: two and a half periods of the slowest loop,
/// 100 Hz.
pub const LONGEST_HOLD: f64 = 0.025;

/// Which of both sides has ended.
#[derive(Default)]
struct Disconnected {
    program: AtomicBool,
    servo: AtomicBool,
}

/// Latest reading of the program, or its fault; none at first.
type LatestReading = Option<Result<Reading, DeviceFault>>;

/// Latest wrench of the servo, and its time.
type LatestWrench = Option<(Wrench, Instant)>;

/// The device's end, owned by the servo.
pub struct ProgrammedDevice {
    name: String,
    limits: DeviceLimits,
    reading: Output<LatestReading>,
    wrench: Input<LatestWrench>,
    disconnected: Arc<Disconnected>,
    /// Ticks since the latest reading.
    silent: u32,
}

/// A device whose program polls at `rate`, Hz, with the delay that polling adds to its limits, and the program's end.
pub fn programmed(name: impl Into<String>, limits: DeviceLimits, rate: f64) -> (ProgramEnd, ProgrammedDevice) {
    let (said_in, said_out) = triple_buffer(&None);
    let (asked_in, asked_out) = triple_buffer(&None);
    let disconnected = Arc::new(Disconnected::default());
    let limits = DeviceLimits { delay: limits.delay + 1.5 / rate, ..limits };
    let device = ProgrammedDevice {
        name: name.into(),
        limits,
        reading: said_out,
        wrench: asked_in,
        disconnected: disconnected.clone(),
        silent: 0,
    };
    (ProgramEnd::new(said_in, asked_out, disconnected), device)
}

impl Device for ProgrammedDevice {
    fn name(&self) -> &str {
        &self.name
    }

    fn read(&mut self, now_ns: u64, period: f64) -> Result<Reading, DeviceFault> {
        self.silent = if self.reading.update() { 0 } else { self.silent.saturating_add(1) };
        // Asked after the update: what a program said before it went is not missed.
        let disconnected = self.disconnected.program.load(Ordering::Acquire);
        match *self.reading.output_buffer_mut() {
            Some(Err(fault)) => Err(fault),
            _ if disconnected => Err(DeviceFault::Disconnected),
            None => Ok(Reading { timestamp_ns: now_ns, ..Reading::default() }),
            Some(Ok(_)) if f64::from(self.silent) * period > LONGEST_SILENCE => Err(DeviceFault::Stale),
            Some(Ok(reading)) => Ok(reading),
        }
    }

    fn write(&mut self, wrench: Wrench) -> Result<(), DeviceFault> {
        self.wrench.write(Some((wrench, Instant::now())));
        Ok(())
    }

    fn limits(&self) -> DeviceLimits {
        self.limits
    }
}

/// The program learns that there is no loop any more.
impl Drop for ProgrammedDevice {
    fn drop(&mut self) {
        self.disconnected.servo.store(true, Ordering::Release);
    }
}

#[cfg(test)]
mod tests;
