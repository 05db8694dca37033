//! Emulated haptic devices, for tests and for people without hardware, and the suite that every driver passes against its own.

pub mod conformance;
pub mod inverse_service;
mod priority;
mod steered;
pub mod vendor;

pub use priority::be_on_time;
pub use steered::{HAND_VARIABLE, SteeredTip, hand_from_environment};
