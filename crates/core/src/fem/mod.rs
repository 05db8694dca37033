//! Chapter 3 of docs/theory.md: linear elasticity, element matrices and their assembly, for any [`crate::element`].
//!
//! Isotropic Hooke: `sigma = lambda tr(eps) I + 2 mu eps` (paper 2.7, 2.8).

mod assembly;
mod material;
mod supports;

pub use assembly::{SymmetricCsc, mass, stiffness};
pub use material::Isotropic;
pub use supports::Supports;
