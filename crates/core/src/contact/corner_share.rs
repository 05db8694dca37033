//! Sharp convex corners of a surface, under which less of a half-space is left than its edges say.
//!
//! Beside the shares of its edges (`convex_edges`) a sphere near a corner has a share of the modulus by the place `v` of its centre from
//! the corner: by the angle to the outward line `d`, which has the same angle `c` to all faces, and by the distance.
//!
//! ```text
//! 1 + (1 - step((|v|/R - A_0) / (A_1 - A_0))) (g(x) - 1)        x = (v . d / sqrt(v^2 + (R_0 R)^2) - c) / (1 - c)
//! g = G_0 + (G_1 - G_0) step((x - X_0) / (1 - X_0))             step(x) = x^2 (3 - 2 x)
//! ```
//!
//! so that above a face, where `x = 0`, the corner is softer than its edges say, and along its outward line stiffer. The constants were
//! fitted to direct solutions for a sphere of 6 mm on the corner of a block (`corner_block` of the tests). As a function of the centre
//! alone it keeps the force the gradient of one energy. Deep in a corner a sphere has pressure cells (`convex_corners`).

use glam::{DMat3, DVec3};

use super::convex_corners::convex_corners;
use super::modulus_share::Share;
use super::smooth::SmoothSurface;
use crate::mesh::Surface;
use crate::tensor::outer;

/// `G_0`, `G_1` and `X_0`.
const FACTORS: [f64; 2] = [0.66, 1.75];
const LEAST_ANGLE: f64 = -0.2;
/// `A_0`, `A_1`.
const NEAR: [f64; 2] = [1.05, 1.8];
/// `R_0`: closer to the corner the angle has no meaning.
const ROUNDED: f64 = 0.3;
/// The centre may lie as deep below the triangle of its foot as it is far from the corner.
const LISTED: f64 = 2.0 * NEAR[1];
/// Least number of edges that meet in a corner.
const LEAST_EDGES: usize = 3;

/// A corner in which sharp convex edges end.
#[derive(Clone, Copy, Debug)]
pub struct ConvexCorner {
    position: DVec3,
    /// `d`.
    outward: DVec3,
    /// `c`.
    cosine: f64,
}

impl ConvexCorner {
    /// Corners of a surface in which at least three edges end; `ending` has the normals of the two faces of each edge that ends there.
    pub fn all<I: Iterator<Item = [DVec3; 2]>>(
        surface: &Surface,
        smooth: &SmoothSurface,
        ending: impl Fn(DVec3) -> I,
    ) -> Vec<Self> {
        let corner = |position: DVec3| {
            let edges: Vec<[DVec3; 2]> = ending(position).collect();
            let outward = edges.iter().flatten().sum::<DVec3>().normalize_or_zero();
            let cosine =
                edges.iter().flatten().map(|normal| normal.dot(outward)).sum::<f64>() / (2 * edges.len()) as f64;
            (edges.len() >= LEAST_EDGES).then_some(Self { position, outward, cosine })
        };
        convex_corners(surface, smooth).into_iter().filter_map(corner).collect()
    }

    /// Opposite corners of a box that holds the triangles of all feet near the corner, for a sphere of a radius, m.
    pub fn box_around(&self, radius: f64) -> [DVec3; 2] {
        let reach = DVec3::splat(LISTED * radius);
        [self.position - reach, self.position + reach]
    }

    /// Share of the modulus for a sphere of `radius`, m; `None` away from the corner.
    pub fn share(&self, centre: DVec3, radius: f64) -> Option<Share> {
        let (v, d, width) = (centre - self.position, self.outward, 1.0 - self.cosine);
        let distance = v.length().max(f64::MIN_POSITIVE);
        if distance >= NEAR[1] * radius {
            return None;
        }
        let unit = v / distance;
        let by_distance = Share {
            value: distance / radius,
            gradient: unit / radius,
            hessian: (DMat3::IDENTITY - outer(unit, unit)) * (1.0 / (distance * radius)),
        };
        let along = v.dot(d);
        let square = distance * distance + (ROUNDED * radius).powi(2);
        let length = square.sqrt();
        let cube = square * length;
        let turned = outer(d, v) + outer(v, d) + DMat3::IDENTITY * along - outer(v, v) * (3.0 * along / square);
        let by_angle = Share {
            value: (along / length - self.cosine) / width,
            gradient: (d / length - v * (along / cube)) / width,
            hessian: turned * (-1.0 / (cube * width)),
        };
        let rise = by_angle.stepped([LEAST_ANGLE, 1.0]).scaled(FACTORS[1] - FACTORS[0], FACTORS[0] - 1.0);
        let near = by_distance.stepped(NEAR).scaled(-1.0, 1.0);
        Some(rise.times(&near).scaled(1.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_has_its_first_and_second_derivatives() {
        let corner = ConvexCorner { position: DVec3::X, outward: DVec3::ONE.normalize(), cosine: 3f64.sqrt().recip() };
        let (radius, h) = (0.2, 1e-6);
        let at = |centre: DVec3| corner.share(centre, radius).expect("near the corner");
        for centre in [DVec3::new(1.0, 0.02, 0.19), DVec3::new(1.1, 0.12, 0.13), DVec3::new(0.87, -0.1, 0.2)] {
            let here = at(centre);
            assert!(here.value > 0.5 && here.value < 2.0);
            for axis in DVec3::AXES {
                let (high, low) = (at(centre + axis * h), at(centre - axis * h));
                assert!(((high.value - low.value) / (2.0 * h) - here.gradient.dot(axis)).abs() < 1e-7);
                let bend = (high.gradient - low.gradient) / (2.0 * h) - here.hessian * axis;
                assert!(bend.length() < 1e-5, "{bend}");
            }
        }
        assert!(corner.share(DVec3::new(1.0, 0.3, 0.3), radius).is_none());
    }
}
