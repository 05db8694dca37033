//! The 3-node triangle: face of the 4-node tetrahedron.

use glam::DVec3;

use super::Face;

/// Linear shape functions: the barycentric coordinates.
pub struct Tri3;

impl Face<3> for Tri3 {
    const PARTS: &'static [[usize; 3]] = &[[0, 1, 2]];

    const NODES: [DVec3; 3] = [DVec3::X, DVec3::Y, DVec3::Z];

    fn shapes(l: DVec3) -> [f64; 3] {
        l.to_array()
    }

    fn derivatives(_l: DVec3) -> [[f64; 2]; 3] {
        [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]]
    }
}
