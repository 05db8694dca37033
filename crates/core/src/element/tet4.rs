//! The 4-node tetrahedron: linear displacement, constant strain.

use glam::DVec3;

use super::Tetrahedron;
use super::quadrature::{Point, centroid, four_points};

/// Linear shape functions: the barycentric coordinates.
pub struct Tet4;

impl Tetrahedron<4> for Tet4 {
    const NODES: [DVec3; 4] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];

    fn shapes(xi: DVec3) -> [f64; 4] {
        [1.0 - xi.x - xi.y - xi.z, xi.x, xi.y, xi.z]
    }

    fn derivatives(_xi: DVec3) -> [DVec3; 4] {
        [DVec3::NEG_ONE, DVec3::X, DVec3::Y, DVec3::Z]
    }

    /// The strain is constant.
    fn stiffness_rule(_nodes: &[DVec3; 4]) -> &'static [Point] {
        centroid()
    }

    /// `N_a N_b` is quadratic.
    fn mass_rule(_nodes: &[DVec3; 4]) -> &'static [Point] {
        four_points()
    }
}
