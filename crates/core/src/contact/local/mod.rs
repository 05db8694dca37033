//! What happens under a tool, below the size of elements: frictionless indentation of an elastic half-space.
//!
//! Every law here gives a stored energy and its exact derivatives. Lengths in m, forces in N, moduli in Pa; the approach
//! `d` is how far the tool's tip would reach below the undeformed surface.

pub mod cells;
mod modulus;
mod place;
mod sphere;
mod widening;

pub use modulus::effective_modulus;
pub use place::{ContactPlane, ToolPose};
pub use sphere::{SphereContact, indent_sphere};
pub use widening::{WidenedContact, Widening};
