//! Faults of a reply.

use crate::DeviceFault;

/// Why a reply gives no reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReplyFault {
    /// It is no JSON.
    Malformed,
    /// What is needed is missing in it, or of another type.
    Incomplete,
    /// A number is none, or infinite.
    NotFinite,
    /// A number is not one that the device could have measured.
    OutOfRange,
    /// It is written as services before 3.1 did.
    Dialect,
    /// The device is not in it.
    Absent,
    /// The device says that its motors have no power, that it is not calibrated or not ready.
    Unready,
}

impl From<ReplyFault> for DeviceFault {
    /// Numbers of [`DeviceFault::Driver`]: 1 no JSON, 2 something missing or of another type, 3 a number out of range, 4 a
    /// service before 3.1.
    fn from(fault: ReplyFault) -> Self {
        match fault {
            ReplyFault::Malformed => DeviceFault::Driver(1),
            ReplyFault::Incomplete => DeviceFault::Driver(2),
            ReplyFault::OutOfRange => DeviceFault::Driver(3),
            ReplyFault::Dialect => DeviceFault::Driver(4),
            ReplyFault::NotFinite => DeviceFault::NotFinite,
            ReplyFault::Absent => DeviceFault::Disconnected,
            ReplyFault::Unready => DeviceFault::MotorsOff,
        }
    }
}
