//! Chapter 7 of docs/theory.md: where a tool touches, and which nodes carry it.

mod closest;
mod compliance;
mod curved;
mod face;
pub mod footprint;
mod hollows;
mod lattice;
pub mod local;
mod moments;
mod patch;
mod quadrature;
mod refusal;
pub mod regular;
mod regular_store;
pub mod shape;
pub mod smooth;
mod tessellation;
mod touchable;

pub(crate) use closest::barycentric;
pub use closest::{SurfacePoint, SurfaceQuery};
pub use compliance::{Touch, smallest_eigenvalue, touch};
pub use hollows::Hollows;
pub use patch::{MAX_PATCH_NODES, Patch, PatchScratch, patch_weights};
pub use quadrature::PatchGeometry;
pub use refusal::Refusal;
pub use regular::{CompliantBody, FanFields, Moduli, RegularCompliance, known_fans};
pub use regular_store::forget_kept;
pub use tessellation::Tessellation;
pub use touchable::TouchPatch;
