//! Chapter 7 of docs/theory.md: where a tool touches, and which nodes carry it.

mod closest;
mod compliance;
mod concavities;
mod convex_corners;
mod convex_edges;
mod corner_share;
mod curved;
mod face;
pub mod footprint;
mod lattice;
pub mod local;
mod modulus_share;
mod moments;
mod patch;
mod quadrature;
pub mod regular;
mod regular_store;
pub mod shape;
mod sharp_edge;
pub mod smooth;
mod tessellation;
mod thin;
mod touch_patch;
mod triangle_lists;

pub(crate) use closest::barycentric;
pub use closest::{SurfacePoint, SurfaceQuery};
pub use compliance::{Touch, raise_eigenvalues, smallest_eigenvalue, touch};
pub use concavities::Concavities;
pub use convex_corners::CornerSurface;
pub use convex_edges::{BesideEdges, ConvexEdges};
pub use local::SeriesFields;
#[cfg(feature = "offline")]
pub use patch::wide_patch_weights;
pub use patch::{MAX_PATCH_NODES, Patch, PatchScratch, Refusal, patch_weights};
pub use quadrature::PatchGeometry;
pub use regular::{CompliantBody, FanFields, Moduli, RegularCompliance, centre_of, known_fans};
pub use regular_store::remove_compliance_files;
pub use tessellation::Tessellation;
pub use thin::{is_thin_at, thickness_for};
pub use touch_patch::TouchPatch;
pub(crate) use triangle_lists::TriangleLists;

/// Maps the numbers below `count`, in their order, with some memory for each thread; without the offline part there is one thread.
fn map_with<M, T: Send>(
    count: usize,
    memory: impl Fn() -> M + Sync + Send,
    of: impl Fn(&mut M, usize) -> T + Sync + Send,
) -> Vec<T> {
    #[cfg(feature = "offline")]
    {
        use rayon::prelude::*;
        (0..count).into_par_iter().map_init(memory, of).collect()
    }
    #[cfg(not(feature = "offline"))]
    {
        let mut memory = memory();
        (0..count).map(|k| of(&mut memory, k)).collect()
    }
}
