//! Moments of the mask over parts of a face, and how finely a part is split.

/// Quadrature cells are split until their edges are below this part of the contact radius.
pub const CELL_SIZE: f64 = 0.2;
/// Depth at which splitting stops: cells of 2^-24 of a triangle's edge are below any physical radius.
pub const MAX_DEPTH: u32 = 24;
/// A point of a face: its coordinates `s`, `t`.
pub type Coordinates = [f64; 2];

/// `int phi`, and with `s`, `t`, `s^2`, `s t`, `t^2`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moments {
    pub sums: [f64; 6],
    /// Whether any part of the triangle lies under the mask.
    pub overlaps_mask: bool,
}

impl Moments {
    /// Integrals of the shape functions of a face with `N` nodes, 3 or 6.
    pub fn of_shapes<const N: usize>(&self) -> [f64; N] {
        let [one, s, t, ss, st, tt] = self.sums;
        let linear = [one - s - t, s, t];
        let quadratic = [
            one - 3.0 * (s + t) + 2.0 * (ss + tt) + 4.0 * st,
            2.0 * ss - s,
            2.0 * tt - t,
            4.0 * (s - ss - st),
            4.0 * st,
            4.0 * (t - st - tt),
        ];
        std::array::from_fn(|k| if N == 3 { linear[k] } else { quadratic[k] })
    }

    /// Adds moments over a cell, given in the cell's own coordinates `(x, y)`. The corners are in the face's coordinates `(s, t)`.
    pub fn add_cell(&mut self, [a, b, c]: [Coordinates; 3], own: [f64; 6]) {
        if own[0] <= 0.0 {
            return;
        }
        self.overlaps_mask = true;
        let [one, x, y, xx, xy, yy] = own;
        let ([s, t], [sx, tx], [sy, ty]) = (a, [b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
        let parts = [
            one,
            s * one + sx * x + sy * y,
            t * one + tx * x + ty * y,
            s * s * one + 2.0 * s * (sx * x + sy * y) + sx * sx * xx + 2.0 * sx * sy * xy + sy * sy * yy,
            s * t * one
                + (s * tx + t * sx) * x
                + (s * ty + t * sy) * y
                + sx * tx * xx
                + (sx * ty + sy * tx) * xy
                + sy * ty * yy,
            t * t * one + 2.0 * t * (tx * x + ty * y) + tx * tx * xx + 2.0 * tx * ty * xy + ty * ty * yy,
        ];
        self.sums.iter_mut().zip(parts).for_each(|(sum, part)| *sum += part);
    }
}

/// Distance from the centroid of a cell that none of its points exceeds. No point of the flat cell is farther than two thirds
/// of its longest edge; the cell leaves the plane of its corners by `4 sum l_i l_j d_ij`, with the deviations `d` at the
/// middles of the edges, and the sum of the products is at most a third.
pub fn cell_reach(squared_longest: f64, deviation: f64) -> f64 {
    2.0 / 3.0 * squared_longest.sqrt() + 4.0 / 3.0 * deviation
}

/// Coordinates halfway between two points.
pub fn halfway([a, b]: Coordinates, [c, d]: Coordinates) -> Coordinates {
    [(a + c) / 2.0, (b + d) / 2.0]
}

/// Twice the area of a triangle in coordinates.
pub fn doubled_area([a, b, c]: [Coordinates; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
}
