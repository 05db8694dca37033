//! Chapter 6: where a tool touches, and which nodes carry it.

mod closest;
mod compliance;
mod patch;

pub use closest::{SurfacePoint, SurfaceQuery};
pub(crate) use compliance::add_patch_response;
pub use compliance::{compliance_block, smallest_eigenvalue, touch};
pub use patch::{MAX_PATCH_NODES, Patch, PatchScratch, patch_weights};
