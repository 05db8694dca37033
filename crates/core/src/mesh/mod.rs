//! Chapter 2 of docs/theory.md: the discretised body: tetrahedra, and the surface that can be touched.

mod surface;
#[cfg(feature = "offline")]
mod tetrahedra;

pub use surface::{Faces, Surface, is_convex};
#[cfg(feature = "offline")]
pub use tetrahedra::{TetMesh, Tets, node_elements, positions};
