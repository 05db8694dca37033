//! Latched faults: the reasons for which forces are zero.

use std::fmt;

use palpate_devices::DeviceFault;

/// A fault that has latched: no wrench on the tool's device, or on any where no tool is named, until a reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The tool, if the fault is one tool's.
    pub tool: Option<usize>,
    /// What happened.
    pub reason: FaultReason,
}

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultReason {
    /// A computed force or torque was not finite.
    WrenchNotFinite,
    /// A contact was not on its body, not at its tool, or stronger than its tool can be.
    ContactUnsound,
    /// A device reported a position, orientation or velocity that is not finite.
    ReadingNotFinite,
    /// A device has had no new measurement for too long.
    StaleInput,
    /// A device's tip moved faster than a hand can.
    JumpingInput,
    /// The device's own.
    Device(DeviceFault),
    /// Ticks took too long to compute.
    Overrun,
    /// A store of precomputed responses is no longer what it was.
    StoreLost,
    /// The code of a tick panicked: no reset helps, the loop must be started again.
    Panic,
}

impl FaultReason {
    /// Whether a reset leaves it: what failed is still there.
    pub fn outlasts_reset(self) -> bool {
        matches!(self, FaultReason::StoreLost | FaultReason::Panic)
    }
}

impl fmt::Display for FaultReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let message = match self {
            FaultReason::WrenchNotFinite => "a computed force was not finite; forces are off until a reset",
            FaultReason::ContactUnsound => {
                "a computed contact was not on the body, or stronger than its tool can be; forces are off until a reset"
            }
            FaultReason::ReadingNotFinite => {
                "the device reported a position that is not finite; forces are off until a reset"
            }
            FaultReason::StaleInput => "the device has stopped sending measurements; forces are off until a reset",
            FaultReason::JumpingInput => "the device's position jumped; forces are off until a reset",
            FaultReason::Device(fault) => return write!(f, "{fault}; forces are off until a reset"),
            FaultReason::Overrun => "the loop took too long to compute; forces are off until a reset",
            FaultReason::StoreLost => {
                "the file of precomputed responses was changed while in use; forces are off: load it again"
            }
            FaultReason::Panic => "the force loop stopped unexpectedly; forces are off",
        };
        f.write_str(message)
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.tool {
            Some(tool) => write!(f, "tool {tool}: {}", self.reason),
            None => self.reason.fmt(f),
        }
    }
}
