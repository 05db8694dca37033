//! What happens under a tool, below the size of elements: frictionless indentation of an elastic half-space.
//!
//! Every law here gives a stored energy and its exact derivatives. Lengths in m, forces in N, moduli in Pa; the approach
//! `d` is how far the tool's tip would reach below the undeformed surface.

pub mod cells;
mod ellipse;
mod ellipsoid;
mod modulus;
mod place;
mod sphere;
mod widening;

pub use ellipse::{EllipseContact, indent_ellipse};
pub use ellipsoid::{EllipsoidContact, EllipsoidProblem};
pub use modulus::effective_modulus;
pub use place::{OsculatingSurface, ToolPose};
pub use sphere::{SphereContact, indent_sphere};
pub use widening::{WidenedContact, Widening};
