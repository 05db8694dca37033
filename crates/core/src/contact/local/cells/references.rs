//! References for the tests of cells: surfaces of second order and Hertz's ellipse.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};

use super::{GridFrame, Heights, Relief, Wedge};

/// A surface of second order around the origin, in axes of its own: its height is `-(k_xx x^2 + 2 k_xy x y + k_yy y^2)/2`.
#[derive(Clone, Copy)]
pub struct Quadric {
    pub curvature: [f64; 3],
    pub axes: DMat3,
}

impl Quadric {
    /// How far a point lies above the surface, in its own axes, and the gradient of that.
    fn above(&self, at: DVec3) -> (f64, DVec3) {
        let [xx, xy, yy] = self.curvature;
        let at = self.axes.transpose() * at;
        let slope = DVec3::new(xx * at.x + xy * at.y, xy * at.x + yy * at.y, 0.0);
        (at.z + 0.5 * slope.dot(at), self.axes * (slope + DVec3::Z))
    }
}

impl Relief for Quadric {
    fn fill(&self, frame: &GridFrame, heights: &mut Heights) {
        for j in 0..frame.count {
            for i in 0..frame.count {
                let [u, v] = frame.middle(i, j);
                let mut height = 0.0;
                let mut gradient = DVec3::ZERO;
                for _ in 0..8 {
                    let (above, slope) = self.above(frame.origin + frame.axes * DVec3::new(u, v, height));
                    gradient = frame.axes.transpose() * slope;
                    height -= above / gradient.z;
                }
                let slopes = [-gradient.x / gradient.z, -gradient.y / gradient.z];
                heights.raise((i, j), height, slopes, DVec3::new(u, v, height));
            }
        }
    }
}

/// A level surface that ends in a right-angled edge along the second axis, and is softer up to a distance `reach` from it, m.
pub struct Step {
    /// Place of the edge along the first axis, m.
    pub edge: f64,
    pub reach: f64,
}

impl Relief for Step {
    fn fill(&self, frame: &GridFrame, heights: &mut Heights) {
        Quadric { curvature: [0.0; 3], axes: DMat3::IDENTITY }.fill(frame, heights);
        let [from, to] = [-1.0, 1.0].map(|y| DVec3::new(self.edge, y, 0.0));
        let wedge = Wedge::new(DVec3::Z, DVec3::X, to - from).expect("a convex edge");
        heights.soften(frame, [from, to], &wedge, self.reach);
    }
}

/// Hertz's ellipse (Johnson, Contact Mechanics, 1985, section 4.2): with `g = b/a`, the complete elliptic integrals `K`, `E` of
/// modulus `e = sqrt(1 - g^2)` and `D = (K - E)/e^2`, `B/A = g^2 D/(K - D)`, `b^2 = 2 d (K - D)/(K A)` and
/// `F = (2 pi/3) E* a d/K`, for curvatures `A >= B`.
pub fn hertz_ellipse(depth: f64, curvatures: [f64; 2], modulus: f64) -> f64 {
    let (large, small) = (curvatures[0].max(curvatures[1]), curvatures[0].min(curvatures[1]));
    let integrals = |g: f64| {
        let steps = 4000;
        let middles = (0..steps).map(|k| (k as f64 + 0.5) * PI / 2.0 / f64::from(steps));
        let root = |t: f64| (1.0 - (1.0 - g * g) * t.sin().powi(2)).sqrt();
        let step = PI / 2.0 / f64::from(steps);
        let (k, e) = middles.fold((0.0, 0.0), |(k, e), t| (k + step / root(t), e + step * root(t)));
        (k, (k - e) / (1.0 - g * g))
    };
    let (mut low, mut high) = (1e-3, 1.0 - 1e-6);
    for _ in 0..60 {
        let g = 0.5 * (low + high);
        let (k, d) = integrals(g);
        if g * g * d / (k - d) < small / large { low = g } else { high = g }
    }
    let g = 0.5 * (low + high);
    let (k, d) = integrals(g);
    2.0 * PI / 3.0 * modulus * (2.0 * depth * (k - d) / (k * large)).sqrt() / g * depth / k
}
