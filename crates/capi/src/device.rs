//! The device of a tool whose readings the program brings and whose wrenches it takes.

use palpate_devices::{Device, DeviceFault, DeviceLimits, Reading, Wrench};
use triple_buffer::{Input, Output, triple_buffer};

/// A wrench, and the tick that it answers.
type Answer = (u64, Wrench);

/// The loop's end: both hand-offs are used within one tick by the thread that makes it.
pub struct BroughtDevice {
    readings: Output<(u64, Reading)>,
    wrenches: Input<Answer>,
    limits: DeviceLimits,
}

/// The program's end.
pub struct DeviceEnd {
    readings: Input<(u64, Reading)>,
    wrenches: Output<Answer>,
}

/// Both ends of a device.
pub fn brought(limits: DeviceLimits) -> (DeviceEnd, BroughtDevice) {
    let (readings_in, readings_out) = triple_buffer(&(0, Reading::default()));
    let (wrenches_in, wrenches_out) = triple_buffer(&(0, Wrench::default()));
    let end = DeviceEnd { readings: readings_in, wrenches: wrenches_out };
    (end, BroughtDevice { readings: readings_out, wrenches: wrenches_in, limits })
}

impl DeviceEnd {
    /// What the loop reads in the tick of that number.
    pub fn bring(&mut self, tick: u64, reading: Reading) {
        self.readings.write((tick, reading));
    }

    /// What the loop put out in the tick of that number; nothing where it put out nothing.
    pub fn take(&mut self, tick: u64) -> Wrench {
        let (answered, wrench) = *self.wrenches.read();
        if answered == tick { wrench } else { Wrench::default() }
    }
}

impl Device for BroughtDevice {
    fn name(&self) -> &str {
        "the program's device"
    }

    fn read(&mut self, _now_ns: u64, _period: f64) -> Result<Reading, DeviceFault> {
        Ok(self.readings.read().1)
    }

    fn write(&mut self, wrench: Wrench) -> Result<(), DeviceFault> {
        let tick = self.readings.output_buffer().0;
        self.wrenches.write((tick, wrench));
        Ok(())
    }

    fn limits(&self) -> DeviceLimits {
        self.limits
    }
}
