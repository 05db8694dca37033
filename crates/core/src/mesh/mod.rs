//! Chapter 1: the discretised body: tetrahedra, and the surface that can be touched.

mod surface;
mod tetrahedra;

pub use surface::Surface;
pub use tetrahedra::TetMesh;
