//! Chapter 2: the discretised body: tetrahedra, and the surface that can be touched.

mod surface;
mod tetrahedra;

pub use surface::{Faces, Surface};
pub use tetrahedra::{TetMesh, Tets, node_elements, positions};
