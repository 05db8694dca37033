//! Haptic devices behind one trait. A driver knows poses and wrenches in world coordinates, nothing of bodies.

mod device;
pub mod known;
pub mod simulated;

pub use device::{Buttons, Device, DeviceFault, DeviceLimits, Reading};

// All that a driver knows of the core; `scripts/check_architecture.py` checks it.
pub use palpate_core::simulation::{Pose, Twist, Wrench};
