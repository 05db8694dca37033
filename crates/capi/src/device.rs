//! Device whose readings the program supplies and whose wrenches the program fetches.

use std::sync::{Arc, Mutex};

use palpate_devices::{Device, DeviceFault, DeviceLimits, Reading, Wrench};

/// What a tick reads and writes.
#[derive(Default)]
struct Exchange {
    reading: Reading,
    wrench: Wrench,
}

/// The program's end. Both ends are used within one tick, by the thread that makes it: the lock is always free.
pub struct DeviceEnd(Arc<Mutex<Exchange>>);

/// The loop's end.
pub struct ProgramDevice {
    exchange: Arc<Mutex<Exchange>>,
    limits: DeviceLimits,
}

/// Both ends of a device.
pub fn program_device(limits: DeviceLimits) -> (DeviceEnd, ProgramDevice) {
    let exchange = Arc::new(Mutex::default());
    (DeviceEnd(Arc::clone(&exchange)), ProgramDevice { exchange, limits })
}

impl DeviceEnd {
    /// Sets what the next tick reads.
    pub fn set_reading(&mut self, reading: Reading) {
        if let Ok(mut exchange) = self.0.try_lock() {
            *exchange = Exchange { reading, wrench: Wrench::default() };
        }
    }

    /// What the tick put out since; nothing where it put out nothing.
    pub fn take(&mut self) -> Wrench {
        self.0.try_lock().map_or(Wrench::default(), |exchange| exchange.wrench)
    }
}

impl Device for ProgramDevice {
    fn name(&self) -> &str {
        "the program's device"
    }

    fn read(&mut self, _now_ns: u64, _period: f64) -> Result<Reading, DeviceFault> {
        self.exchange.try_lock().map(|exchange| exchange.reading).map_err(|_| DeviceFault::Stale)
    }

    fn write(&mut self, wrench: Wrench) -> Result<(), DeviceFault> {
        self.exchange.try_lock().map(|mut exchange| exchange.wrench = wrench).map_err(|_| DeviceFault::Stale)
    }

    fn limits(&self) -> DeviceLimits {
        self.limits
    }
}
