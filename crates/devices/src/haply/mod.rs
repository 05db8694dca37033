//! Haply Inverse3, Inverse3x and Minverse, with VerseGrips, by the websocket of the vendor's Inverse Service (3.1 to 3.5).
//!
//! The service has no loop of its own: each message of a client is answered by one state. A thread of the driver sends the
//! latest force and takes the state, at a rate of its own; the loop finds the latest state and leaves the latest force without
//! ever waiting. Frame of the service: x right, y away, z up ([`crate::Frame::RightAwayUp`]), metres and newtons.
//!
//! Not stated by the vendor, and so chosen here: the largest force (10 N, lowered by the scene's `max_force`), the time after
//! which the service takes off a force that is not repeated (the driver relies on none), how grips belong to arms (by their
//! order). Sources: Haply's pages "Simulation Channel", "Control Commands", "JSON Conventions", "Mount & Workspace Transforms",
//! "Events Channel", "Migrating to 3.5".

mod address;
mod client;
mod commands;
mod device;
mod entries;
mod fault;
mod grips;
mod handoff;
mod numbers;
mod open;
mod output;
mod priority;
mod reading;
mod safety_events;
mod service;
mod snapshot;
mod socket;

pub use address::{ADDRESS_VARIABLE, DEFAULT_ADDRESS, DEFAULT_HOLD_MS, DEFAULT_RATE};
pub use open::{list, open};
