//! The program's end: publishes readings, fetches wrenches.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::{Disconnected, Input, LONGEST_HOLD, LatestReading, LatestWrench, Output, Pose, Reading, Twist, Wrench};
use crate::{Buttons, DeviceFault};

/// To be used by one thread of the program, which may take its time; every call is wait-free.
pub struct ProgramEnd {
    reading: Input<LatestReading>,
    wrench: Output<LatestWrench>,
    disconnected: Arc<Disconnected>,
    begun: Instant,
}

impl ProgramEnd {
    pub(super) fn new(
        reading: Input<LatestReading>,
        wrench: Output<LatestWrench>,
        disconnected: Arc<Disconnected>,
    ) -> Self {
        Self { reading, wrench, disconnected, begun: Instant::now() }
    }

    /// Says where the tool is, as measured now. Numbers that are not finite are the servo's to refuse.
    pub fn publish(&mut self, pose: Pose, twist: Twist, buttons: Buttons) {
        self.send(Reading { pose, twist, buttons, active: true, timestamp_ns: 0 });
    }

    /// Says that the tool is out of the scene.
    pub fn publish_absent(&mut self) {
        self.send(Reading::default());
    }

    fn send(&mut self, reading: Reading) {
        // From one on: a loop's clock may stand at zero, and time is to go forward from reading to reading.
        let timestamp_ns = 1 + self.begun.elapsed().as_nanos() as u64;
        self.reading.write(Some(Ok(Reading { timestamp_ns, ..reading })));
    }

    /// Says that there is no reading, and why; it stands until the next one.
    pub fn fail(&mut self, fault: DeviceFault) {
        self.reading.write(Some(Err(fault)));
    }

    /// The wrench to put out, and its age if a loop has asked for one. It is zero before the first tick, when no tick has renewed
    /// it for [`LONGEST_HOLD`], and when the loop has ended.
    pub fn wrench(&mut self) -> (Wrench, Option<Duration>) {
        self.wrench.update();
        let Some((wrench, when)) = *self.wrench.output_buffer_mut() else { return (Wrench::default(), None) };
        let age = when.elapsed();
        let holds = !self.loop_has_ended() && age.as_secs_f64() <= LONGEST_HOLD;
        (if holds { wrench } else { Wrench::default() }, Some(age))
    }

    /// Whether the servo has let go of the device.
    pub fn loop_has_ended(&self) -> bool {
        self.disconnected.servo.load(Ordering::Acquire)
    }
}

/// The servo learns that nobody publishes any more.
impl Drop for ProgramEnd {
    fn drop(&mut self) {
        self.disconnected.program.store(true, Ordering::Release);
    }
}
