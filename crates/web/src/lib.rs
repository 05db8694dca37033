//! The force loop of a packed scene for a page without a server: the same ticks and safety stage as WebAssembly, in a worker.
//!
//! The interface is a dozen C functions (`exports`) over a [`Session`]: numbers and JSON in and out of the module's memory,
//! so that no generator of bindings has to match the compiler.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod command;
mod exports;
mod frame;
mod run;
mod session;

pub use session::Session;
