//! Pressure below a sphere, integrated over rectangles of a plane that need not be parallel to the contact.
//!
//! Sneddon (The relation between load and penetration in the axisymmetric Boussinesq problem for a punch of arbitrary profile, 1965):
//! `p(r) = (E*/pi) int_r^a g'(s) ds / sqrt(s^2 - r^2)` with `g(s) = s artanh(s/R)` for a sphere. With `w = sqrt(1 - r^2/a^2)`, `x = a/R`
//! and the first two terms of `g`,
//!
//! ```text
//! p ~ w (1 + 2 x^2/3) - (4/9) x^2 w^3
//! ```
//!
//! Hertz's pressure is the limit of small `x`; at `x = 0.5` what is left out is 2 % of the largest pressure. Along a row both powers of
//! `w` have a primitive; across the rows Gauss' rule is exact for a contact within one rectangle.

use crate::math::asin;
use glam::{DVec2, DVec3};

/// Points and weights of Gauss' rule with four points on [-1, 1].
const GAUSS: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
    (-0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
];

/// Contact of a sphere as it is seen along the third axis of a frame.
#[derive(Clone, Copy, Debug)]
pub struct SpherePressure {
    /// Its middle, seen along the third axis.
    middle: DVec2,
    /// `r^2/a^2 = xx x^2 + 2 xy x y + yy y^2`, 1/m^2.
    xx: f64,
    xy: f64,
    yy: f64,
    /// Factors of `w` and `w^3`, for a force of one.
    factors: [f64; 2],
}

impl SpherePressure {
    /// Of a contact of `radius` around `middle`, m, with a unit `normal` whose third component is positive; `slope` is the radius
    /// over that of the sphere.
    pub fn new(middle: DVec3, normal: DVec3, radius: f64, slope: f64) -> Self {
        let scale = 1.0 / (radius * radius);
        let [x, y] = [normal.x / normal.z, normal.y / normal.z];
        let squared = slope * slope;
        let factors = [1.0 + 2.0 / 3.0 * squared, -4.0 / 9.0 * squared];
        // Integrals of `w` and `w^3` over the disc are 2/3 and 2/5 of its area; seen along the axis it is smaller.
        let seen_area = std::f64::consts::PI * radius * radius * normal.z;
        let force = seen_area * (2.0 / 3.0 * factors[0] + 2.0 / 5.0 * factors[1]);
        Self {
            middle: middle.truncate(),
            xx: scale * (1.0 + x * x),
            xy: scale * x * y,
            yy: scale * (1.0 + y * y),
            factors: factors.map(|factor| factor / force),
        }
    }

    /// Shares of the force in the rectangles of a row between `low` and `high`, m, that lie between the `edges`, m, in ascending
    /// order; hands out the rank of each rectangle with its share.
    pub fn row(
        &self,
        [low, high]: [f64; 2],
        edges: impl Iterator<Item = f64> + Clone,
        mut each: impl FnMut(usize, f64),
    ) {
        let left = self.yy - self.xy * self.xy / self.xx;
        let reach = 1.0 / left.sqrt();
        let (low, high) = ((low - self.middle.y).max(-reach), (high - self.middle.y).min(reach));
        if low.is_nan() || high.is_nan() || high <= low {
            return;
        }
        let root = self.xx.sqrt();
        for (at, weight) in GAUSS {
            let y = 0.5 * (low + high) + 0.5 * (high - low) * at;
            let squared = (1.0 - left * y * y).max(0.0);
            let shift = self.xy / self.xx * y - self.middle.x;
            let scale = 0.5 * (high - low) * weight / root;
            let primitive = |x: f64| {
                let [first, third] = primitives(root * (x + shift), squared);
                scale * (self.factors[0] * first + self.factors[1] * third)
            };
            let mut below = None;
            for (rank, edge) in edges.clone().enumerate() {
                let above = primitive(edge);
                if let Some(below) = below.replace(above) {
                    each(rank - 1, above - below);
                }
            }
        }
    }
}

/// `int_0^u (c^2 - s^2)^(1/2) ds` and the same with the power 3/2, for `u` cut to where the root is real.
fn primitives(u: f64, squared: f64) -> [f64; 2] {
    if squared == 0.0 {
        return [0.0; 2];
    }
    let c = squared.sqrt();
    let u = u.clamp(-c, c);
    let root = (squared - u * u).max(0.0).sqrt();
    let angle = asin((u / c).clamp(-1.0, 1.0));
    let first = 0.5 * (u * root + squared * angle);
    let third = 0.125 * (u * root * (5.0 * squared - 2.0 * u * u) + 3.0 * squared * squared * angle);
    [first, third]
}
