//! Device faults by the library's error codes.

use super::ffi::{Enum, error};
use crate::DeviceFault;

/// A fault by an error's number.
///
/// The vendor's own helper calls 0x0200, 0x0201, 0x0203 and 0x0204 errors of force, after which the amplifiers come back by
/// themselves, and 0x0302 to 0x0304, 0x0500 and 0x0501 errors of the scheduler, after which it has to be started again.
pub fn fault(code: Enum) -> DeviceFault {
    match code {
        error::WARM_MOTORS => DeviceFault::MotorsOff,
        error::BAD_HANDLE | error::DEVICE_FAULT | error::COMMUNICATION => DeviceFault::Disconnected,
        code => DeviceFault::Driver(code as i32),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_the_cable_are_told_from_those_of_the_motors() {
        assert_eq!(fault(0x0302), DeviceFault::Disconnected);
        assert_eq!(fault(0x0200), DeviceFault::MotorsOff);
        assert_eq!(fault(0x0201), DeviceFault::Driver(513));
        assert_eq!(fault(u32::MAX), DeviceFault::Driver(-1));
    }
}
