//! The 10-node tetrahedron: quadratic displacement, linear strain where its edges are straight.
//!
//! It does not lock at high Poisson's ratios as the 4-node tetrahedron does, and follows curved surfaces with its
//! mid-side nodes.

use glam::DVec3;

use super::Tetrahedron;
use super::quadrature::{Point, four_points, fourteen_points, sixty_four_points};

/// Quadratic shape functions: `L_i (2 L_i - 1)` at the corners, `4 L_i L_j` at the middles of the edges.
pub struct Tet10;

/// Corners of the edges, in the order of their middles.
const EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]];

/// A mid-side node this close to the middle of its edge, in parts of the edge's length, counts as being there: well above
/// round-off of coordinates, and far below any error of the rule for straight elements.
const STRAIGHT: f64 = 1e-10;

/// Derivatives of the barycentric coordinates.
const SLOPES: [DVec3; 4] = [DVec3::NEG_ONE, DVec3::X, DVec3::Y, DVec3::Z];

impl Tet10 {
    /// Whether all edges are straight with their nodes in the middle, so that the Jacobian is constant.
    pub fn is_straight(nodes: &[DVec3; 10]) -> bool {
        EDGES.iter().zip(&nodes[4..]).all(|(&[i, j], &middle)| {
            let (a, b) = (nodes[i], nodes[j]);
            (middle - 0.5 * (a + b)).length_squared() <= STRAIGHT * STRAIGHT * (b - a).length_squared()
        })
    }
}

impl Tetrahedron<10> for Tet10 {
    const NODES: [DVec3; 10] = [
        DVec3::ZERO,
        DVec3::X,
        DVec3::Y,
        DVec3::Z,
        DVec3::new(0.5, 0.0, 0.0),
        DVec3::new(0.5, 0.5, 0.0),
        DVec3::new(0.0, 0.5, 0.0),
        DVec3::new(0.0, 0.0, 0.5),
        DVec3::new(0.5, 0.0, 0.5),
        DVec3::new(0.0, 0.5, 0.5),
    ];

    fn shapes(xi: DVec3) -> [f64; 10] {
        let l = [1.0 - xi.x - xi.y - xi.z, xi.x, xi.y, xi.z];
        std::array::from_fn(|a| match a.checked_sub(4) {
            None => l[a] * (2.0 * l[a] - 1.0),
            Some(edge) => 4.0 * l[EDGES[edge][0]] * l[EDGES[edge][1]],
        })
    }

    fn derivatives(xi: DVec3) -> [DVec3; 10] {
        let l = [1.0 - xi.x - xi.y - xi.z, xi.x, xi.y, xi.z];
        std::array::from_fn(|a| match a.checked_sub(4) {
            None => SLOPES[a] * (4.0 * l[a] - 1.0),
            Some(edge) => {
                let [i, j] = EDGES[edge];
                4.0 * (SLOPES[i] * l[j] + SLOPES[j] * l[i])
            }
        })
    }

    /// Straight: `B^T D B` is quadratic, four points are exact. Curved: rational, no rule is. Degree 2 would keep the
    /// order of convergence (P. G. Ciarlet, The Finite Element Method for Elliptic Problems, 1978, section 4.4), but the
    /// forces of a constant stress, `int grad N_a dV`, are cubic in `xi`: only from degree 3 on does the patch test hold
    /// on curved elements. Degree 5 does that with positive weights, and leaves errors far below those of the mesh.
    fn stiffness_rule(nodes: &[DVec3; 10]) -> &'static [Point] {
        if Self::is_straight(nodes) { four_points() } else { fourteen_points() }
    }

    /// `N_a N_b` is of degree 4, the Jacobian's determinant of a curved element of degree 3: both rules are exact.
    fn mass_rule(nodes: &[DVec3; 10]) -> &'static [Point] {
        if Self::is_straight(nodes) { fourteen_points() } else { sixty_four_points() }
    }
}
