//! A face of the surface at rest as a polynomial.

use glam::DVec3;

use super::moments::Coordinates;

/// Bend of a face, over its edges, below which it is flat up to rounding.
const FLAT: f64 = 1e-13;

/// A face as a polynomial of its coordinates, `x = c0 + c1 s + c2 t + c3 s^2 + c4 s t + c5 t^2` with corners at (0, 0),
/// (1, 0) and (0, 1).
#[derive(Clone, Debug)]
pub struct FaceGeometry {
    coefficients: [DVec3; 6],
    /// Whether the last three vanish.
    pub flat: bool,
    /// Area in space over area in coordinates, where the face is flat.
    pub area_ratio: f64,
}

impl FaceGeometry {
    /// With three nodes.
    pub fn linear([a, b, c]: [DVec3; 3]) -> Self {
        let zero = DVec3::ZERO;
        let coefficients = [a, b - a, c - a, zero, zero, zero];
        Self { coefficients, flat: true, area_ratio: (b - a).cross(c - a).length() }
    }

    /// With six nodes: corners, then the middles of the edges 01, 12, 20.
    pub fn quadratic([x0, x1, x2, x01, x12, x20]: [DVec3; 6]) -> Self {
        let bent = [2.0 * (x0 + x1 - 2.0 * x01), 4.0 * (x0 - x01 - x20 + x12), 2.0 * (x0 + x2 - 2.0 * x20)];
        let size = (x1 - x0).length() + (x2 - x0).length();
        if bent.iter().all(|c| c.length() <= FLAT * size) {
            return Self::linear([x0, x1, x2]);
        }
        let coefficients = [x0, 4.0 * x01 - 3.0 * x0 - x1, 4.0 * x20 - 3.0 * x0 - x2, bent[0], bent[1], bent[2]];
        Self { coefficients, flat: false, area_ratio: 0.0 }
    }

    /// Position of a point.
    pub fn at(&self, [s, t]: Coordinates) -> DVec3 {
        let c = &self.coefficients;
        let flat = c[0] + c[1] * s + c[2] * t;
        if self.flat { flat } else { flat + (c[3] * s + c[4] * t) * s + c[5] * (t * t) }
    }
}
