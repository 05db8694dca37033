//! Interface to the operating system: the clock, waiting, priority, processors and locked memory. Every system has a clock and a
//! way to wait; the rest is granted by Linux alone.

#[cfg(target_family = "wasm")]
mod browser;
#[cfg(target_os = "linux")]
mod linux;
#[cfg(target_os = "linux")]
mod linux_memory;
#[cfg(not(target_os = "linux"))]
mod nothing_granted;
#[cfg(not(any(target_os = "linux", target_family = "wasm")))]
mod portable;

#[cfg(target_family = "wasm")]
pub(crate) use browser::*;
#[cfg(target_os = "linux")]
pub(crate) use linux::{allowed_cpus, computed_ns, keep_to_cpus, now_ns, request_realtime_priority, sleep_until_ns};
#[cfg(target_os = "linux")]
pub(crate) use linux_memory::{lock, lock_thread};
#[cfg(not(target_os = "linux"))]
pub(crate) use nothing_granted::*;
#[cfg(not(any(target_os = "linux", target_family = "wasm")))]
pub(crate) use portable::*;
