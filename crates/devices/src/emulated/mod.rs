//! Devices without hardware that behave like some: a tip of known mass, damping, dry friction, encoder and delay, held by a
//! simulated hand or by none. For emulators of services and libraries ([`Tip`]), and for loops in the same process
//! ([`EmulatedDevice`]).
//!
//! The tip is a point of mass `m`. The force `F` last written acts on it `d` seconds later and is held until the next one
//! does. A hand that holds it adds its own mass, damping and muscles, which pull towards where it wants to be:
//!
//! ```text
//! (m + m_hand) x'' + (b + b_hand) x' + friction(x') = F(t - d) + k_hand (wanted(t) - x)
//! ```
//!
//! The axes are independent of each other: the dry friction is that of three drives, one an axis, each with Coulomb's law. While
//! forces are held and nothing stops or starts to slide, each axis is a linear oscillator, which `axis.rs` advances by its
//! closed form: the motion between two ticks is exact, whatever the rate.
//!
//! What is left out: gravity (devices compensate it), the flexibility of links and cables, inertia that changes over the
//! workspace, the dynamics of motors and amplifiers beyond the delay.

mod axis;
mod device;
mod hand;
pub mod known;
mod tip;

pub use device::{Command, EmulatedDevice, Handle, TrueMotion, emulated};
pub use hand::{Hand, HandTarget, Waypoint};
pub use tip::{Measurement, Mechanics, Tip, VELOCITY_WINDOW};
