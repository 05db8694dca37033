//! The 6-node triangle: face of the 10-node tetrahedron.

use glam::DVec3;

use super::Face;

/// Quadratic shape functions: `l_i (2 l_i - 1)` at the corners, `4 l_i l_j` at the middles of the edges.
pub struct Tri6;

impl Face<6> for Tri6 {
    const PARTS: &'static [[usize; 3]] = &[[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]];

    const NODES: [DVec3; 6] =
        [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(0.5, 0.5, 0.0), DVec3::new(0.0, 0.5, 0.5), DVec3::new(0.5, 0.0, 0.5)];

    fn shapes(l: DVec3) -> [f64; 6] {
        [
            l.x * (2.0 * l.x - 1.0),
            l.y * (2.0 * l.y - 1.0),
            l.z * (2.0 * l.z - 1.0),
            4.0 * l.x * l.y,
            4.0 * l.y * l.z,
            4.0 * l.z * l.x,
        ]
    }

    fn derivatives(l: DVec3) -> [[f64; 2]; 6] {
        let from_corner = 1.0 - 4.0 * l.x;
        [
            [from_corner, from_corner],
            [4.0 * l.y - 1.0, 0.0],
            [0.0, 4.0 * l.z - 1.0],
            [4.0 * (l.x - l.y), -4.0 * l.y],
            [4.0 * l.z, 4.0 * l.y],
            [-4.0 * l.z, 4.0 * (l.x - l.z)],
        ]
    }
}
