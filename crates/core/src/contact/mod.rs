//! Chapter 6: where a tool touches, and which nodes carry it.

mod closest;
mod compliance;
mod curved;
mod face;
mod lattice;
pub mod local;
mod moments;
mod patch;
mod quadrature;
mod refusal;
pub mod shape;
mod touchable;

pub use closest::{SurfacePoint, SurfaceQuery};
pub use compliance::{smallest_eigenvalue, touch};
pub use patch::{MAX_PATCH_NODES, Patch, PatchScratch, patch_weights};
pub use quadrature::PatchGeometry;
pub use refusal::Refusal;
pub use touchable::TouchPatch;
