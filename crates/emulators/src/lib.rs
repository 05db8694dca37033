//! Emulated haptic devices, for tests and for people without hardware, and the suite that every driver passes against its own.

pub mod conformance;
mod hand;
pub mod inverse_service;
pub mod library;
mod priority;
mod tip;

pub use priority::request_realtime;
pub use tip::{SteeredTip, Tip};
