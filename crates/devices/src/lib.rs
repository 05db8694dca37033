//! Haptic devices behind one trait. A driver knows poses and wrenches, nothing of bodies: in the frame of the person in front
//! of it ([`Frame`]), which a scene maps to its own.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod device;
pub mod emulated;
#[cfg(feature = "drivers")]
pub mod forcedimension;
mod frame;
#[cfg(feature = "drivers")]
pub mod haply;
#[cfg(feature = "drivers")]
mod kinds;
pub mod known;
#[cfg(feature = "drivers")]
mod library;
mod mounted;
#[cfg(feature = "drivers")]
pub mod openhaptics;
mod opening;
pub mod programmed;
pub mod simulated;

pub use device::{Buttons, Device, DeviceFault, DeviceLimits, Reading};
pub use frame::Frame;
#[cfg(feature = "drivers")]
pub use kinds::{kinds, list, open};
pub use mounted::{MountedDevice, Workspace};
pub use opening::{Connection, FoundDevice, Listing, OpenError, ReadyDevice, Scheduler};

// All that a driver knows of the core; `scripts/check_architecture.py` checks it.
pub use palpate_core::simulation::{Pose, Twist, Wrench};
