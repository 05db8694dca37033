//! The one stage between a computed wrench and a device, and between a device and the simulation. It is always on.
//!
//! In the order of a tick:
//! 1. `reading`: what a device says is checked: faults of its own, numbers that are not finite, stale and jumping input.
//! 2. A computed wrench that is not finite is a fault.
//! 3. A fault is latched: the wrench is zero, and the tool out of the scene, until an explicit reset.
//! 4. The wrench is ramped in after the start and after a reset, clamped to its largest magnitude, damped where the hand
//!    would get back more energy than it has put in (`passivity`), and its change as a vector limited (`vector`).
//!
//! What comes out is never more than was computed, and never pushes against it, but for the damping: that opposes the tip's
//! motion, and takes energy out.

mod fault;
mod limits;
mod passivity;
mod reading;
mod stage;
mod vector;

pub use fault::{Fault, FaultReason};
pub use limits::{SafetyLimits, check_stiffness};
pub use passivity::PortEnergy;
pub use stage::{ComputedWrench, SafetyStage};
