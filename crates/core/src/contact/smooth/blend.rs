//! The smooth surface as the zero of a function, `f = sum w_i f_i / sum w_i`: the quadrics `f_i` of the fans around, blended
//! by weights that depend on the place only (implicit moving least squares; Kolluri, 2005, with quadrics for planes).
//!
//! With `r` the distance from a fan, over its reach, the weight is `w = (1 - r^2)^3 / (r^2 + 1/4)^2`: by the denominator the
//! surface passes close by the nodes.

use glam::{DMat3, DVec3};
use pulp::NullaryFnOnce;

use super::neighbourhood::{FanLanes, LANES, Lane, reaches, total};
use crate::tensor::{outer, symmetric};

/// Squared distance within which a node does not draw the surface towards itself, over its squared reach.
const SHARP: f64 = 0.25;

/// Value, gradient and Hessian of a blended function at a point.
#[derive(Clone, Copy, Debug)]
pub struct Blend {
    pub value: f64,
    pub gradient: DVec3,
    pub hessian: DMat3,
}

/// Sums over fans at a point, as a struct: a closure might be compiled for the narrowest vectors.
pub struct Blending<'a> {
    pub fans: &'a [FanLanes],
    pub point: DVec3,
}

/// Sums of weights and of weighted quadrics: values, gradients, and Hessians by `xx, xy, xz, yy, yz, zz`.
#[derive(Clone, Copy, Default)]
struct Sums {
    weight: [Lane; 10],
    quadric: [Lane; 10],
}

impl NullaryFnOnce for Blending<'_> {
    type Output = Option<Blend>;

    /// `None` where no weight is positive.
    #[inline(always)]
    fn call(self) -> Option<Blend> {
        let mut sums = Sums::default();
        let point = self.point.to_array();
        for fans in self.fans {
            let (offset, relative) = fans.offset(point);
            if reaches(&relative) {
                sums.add(fans, &offset, &relative);
            }
        }
        sums.blend()
    }
}

impl Sums {
    #[inline(always)]
    fn add(&mut self, fans: &FanLanes, offset: &[Lane; 3], relative: &Lane) {
        let (n, c) = (&fans.normal, &fans.curvature);
        for l in 0..LANES {
            let (x, y, z, inverse) = (offset[0][l], offset[1][l], offset[2][l], fans.inverse_squared_reach[l]);
            // Beyond its reach a fan has no weight, and all derivatives vanish with it.
            let left = if relative[l] < 1.0 { 1.0 - relative[l] } else { 0.0 };
            let near = 1.0 / (relative[l] + SHARP);
            let (a, b) = (left * near, near * near);
            let w = left * a * a;
            // Derivatives of the weight by the square: its gradient is `slope` times the offset, its Hessian `bend` times the
            // offset's outer product, and `slope` on the diagonal.
            let slope = -2.0 * inverse * (3.0 * a * a + 2.0 * w * near);
            let bend = 4.0 * inverse * inverse * (6.0 * left * b + 12.0 * a * a * near + 6.0 * w * b);
            let (sx, sy, sz) = (slope * x, slope * y, slope * z);
            let (bx, by, bz) = (bend * x, bend * y, bend * z);
            let bends = [bx * x + slope, bx * y, bx * z, by * y + slope, by * z, bz * z + slope];
            let (cx, cy, cz) = (
                c[0][l] * x + c[1][l] * y + c[2][l] * z,
                c[1][l] * x + c[3][l] * y + c[4][l] * z,
                c[2][l] * x + c[4][l] * y + c[5][l] * z,
            );
            let flat = n[0][l] * x + n[1][l] * y + n[2][l] * z;
            let q = flat + 0.5 * (cx * x + cy * y + cz * z);
            let (gx, gy, gz) = (n[0][l] + cx, n[1][l] + cy, n[2][l] + cz);
            let crosses =
                [2.0 * sx * gx, sx * gy + sy * gx, sx * gz + sz * gx, 2.0 * sy * gy, sy * gz + sz * gy, 2.0 * sz * gz];
            let weights = [w, sx, sy, sz];
            let quadrics = [w * q, w * gx + sx * q, w * gy + sy * q, w * gz + sz * q];
            for k in 0..4 {
                self.weight[k][l] += weights[k];
                self.quadric[k][l] += quadrics[k];
            }
            for k in 0..6 {
                self.weight[4 + k][l] += bends[k];
                self.quadric[4 + k][l] += c[k][l] * w + crosses[k] + bends[k] * q;
            }
        }
    }

    #[inline(always)]
    fn blend(&self) -> Option<Blend> {
        let ([w, wx, wy, wz, w_second @ ..], [n, nx, ny, nz, n_second @ ..]) =
            (totals(&self.weight), totals(&self.quadric));
        if w <= 0.0 {
            return None;
        }
        let inverse = 1.0 / w;
        let value = n * inverse;
        let by_weight = DVec3::new(wx, wy, wz);
        let gradient = (DVec3::new(nx, ny, nz) - value * by_weight) * inverse;
        let cross = outer(gradient, by_weight);
        let hessian = symmetric(n_second) - symmetric(w_second) * value - cross - cross.transpose();
        Some(Blend { value, gradient, hessian: hessian * inverse })
    }
}

/// Sums over the lanes.
#[inline(always)]
fn totals(lanes: &[Lane; 10]) -> [f64; 10] {
    let mut totals = [0.0; 10];
    for k in 0..10 {
        totals[k] = total(lanes[k]);
    }
    totals
}
