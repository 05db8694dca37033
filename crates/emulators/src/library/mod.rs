//! What the emulated libraries of vendors have in common: a world of devices behind the vendor's functions ([`Emulated`],
//! [`World`]), and the functions by which tests steer it ([`Steering`]).
//!
//! The frame of everything here is the person's: right, away, up, from the middle of the workspace; m, N, N m, rad.

mod hardware;
mod steering;
mod world;

pub use hardware::{Hardware, rotation};
pub use steering::{EmulatedLibrary, Steering};
pub use world::{Emulated, Random, World, steering, world};
