//! Emulated haptic devices, for tests and for people without hardware, and the suite that every driver passes against its own.

pub mod conformance;
