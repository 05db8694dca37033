//! Quadrature on a flat triangle of any size; only points inside the ball are visited.

use glam::DVec3;

use super::moments::{CELL_SIZE, Coordinates, MAX_DEPTH, Moments, doubled_area};

/// The mid-edges of a flat triangle's cells, in units of half a cell's edge: points `(i, j)` with `i + j <= 2 n`, of which
/// one index at least is odd, `n` cells to an edge. Distances are counted from the point `(i_0, j_0)` closest to the centre,
/// so that they keep their digits where the triangle is much larger than the contact.
pub struct Lattice {
    /// `2 n`.
    size: i64,
    /// `i_0`, `j_0`.
    origin: [i64; 2],
    /// Squared distance from the centre over that of the radius: `d + e x + f y + g x^2 + h x y + k y^2` at the point
    /// `(i_0 + x, j_0 + y)`.
    distance: [f64; 6],
    /// Coordinates at the origin, and their increments along `i` and `j`.
    start: Coordinates,
    along_i: Coordinates,
    along_j: Coordinates,
    /// Weight of a point that two cells share.
    weight: f64,
}

impl Lattice {
    /// Lattice of the triangle with the given corners, positions `ends`, under the mask around `centre`.
    pub fn new(corners: [Coordinates; 3], [a, b, c]: [DVec3; 3], centre: DVec3, radius: f64, area_ratio: f64) -> Self {
        let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
        let (mut depth, mut squared_edge) = (0, longest);
        let finest = CELL_SIZE * CELL_SIZE * radius * radius;
        while squared_edge > finest && depth < MAX_DEPTH {
            squared_edge /= 4.0;
            depth += 1;
        }
        let size = 2i64 << depth;
        let step = 1.0 / size as f64;
        let (u, v) = ((b - a) * step, (c - a) * step);
        let origin = closest_point(a - centre, u, v, size);
        let [i, j] = origin.map(|index| index as f64);
        let (w, u, v) = ((a + u * i + v * j - centre) / radius, u / radius, v / radius);
        let distance = [
            w.length_squared(),
            2.0 * w.dot(u),
            2.0 * w.dot(v),
            u.length_squared(),
            2.0 * u.dot(v),
            v.length_squared(),
        ];
        let increment = |to: Coordinates| [(to[0] - corners[0][0]) * step, (to[1] - corners[0][1]) * step];
        let (along_i, along_j) = (increment(corners[1]), increment(corners[2]));
        // A cell has `4 step^2` of the triangle's area; the rule gives a third of it to each of its mid-edges.
        let weight = 2.0 * area_ratio * 0.5 * doubled_area(corners) * 4.0 * step * step / 3.0;
        let start = [0, 1].map(|k| corners[0][k] + along_i[k] * i + along_j[k] * j);
        Self { size, origin, distance, start, along_i, along_j, weight }
    }

    /// Adds its moments.
    pub fn integrate(&self, moments: &mut Moments) {
        let [d, e, f, g, h, k] = self.distance;
        let [i, j] = self.origin;
        // The least distance along a row, over real x, is a quadratic in y as well.
        let least = [d - e * e / (4.0 * g), f - e * h / (2.0 * g), k - h * h / (4.0 * g)];
        let Some((first, last)) = below_one(least, -j, self.size - j) else { return };
        for row in first..=last {
            let y = row as f64;
            let along = [d + (f + k * y) * y, e + h * y, g];
            if let Some((low, high)) = below_one(along, -i, self.size - (j + row) - i) {
                self.integrate_row(row, along, low, high, moments);
            }
        }
    }

    /// Adds the points from `low` to `high` of a row, all counted from the origin.
    fn integrate_row(&self, row: i64, [d, e, g]: [f64; 3], low: i64, high: i64, moments: &mut Moments) {
        let [i, j] = [self.origin[0], self.origin[1] + row];
        // On even rows every other point is a corner of cells.
        let (step, mut x) = if j % 2 == 0 { (2, low + (i + low + 1) % 2) } else { (1, low) };
        let mut sums = [0.0; 3];
        while x <= high {
            let place = x as f64;
            let inside = (1.0 - (d + (e + g * place) * place)).max(0.0);
            // Points on the triangle's edges belong to one cell only.
            let on_edge = i + x == 0 || j == 0 || i + x + j == self.size;
            let weight = if on_edge { 0.5 } else { 1.0 } * inside * inside;
            sums[0] += weight;
            sums[1] += weight * place;
            sums[2] += weight * (place * place);
            x += step;
        }
        if sums[0] <= 0.0 {
            return;
        }
        moments.overlaps_mask = true;
        let [zeroth, first, second] = sums.map(|sum| self.weight * sum);
        let [s, t] = [0, 1].map(|k| self.start[k] + self.along_j[k] * row as f64);
        let [ds, dt] = self.along_i;
        let along = [
            zeroth,
            s * zeroth + ds * first,
            t * zeroth + dt * first,
            s * s * zeroth + 2.0 * s * ds * first + ds * ds * second,
            s * t * zeroth + (s * dt + t * ds) * first + ds * dt * second,
            t * t * zeroth + 2.0 * t * dt * first + dt * dt * second,
        ];
        moments.sums.iter_mut().zip(along).for_each(|(sum, part)| *sum += part);
    }
}

/// Whole `(i, j)` within 0 to `size` about where `offset + i u + j v` is shortest.
fn closest_point(offset: DVec3, u: DVec3, v: DVec3, size: i64) -> [i64; 2] {
    let (uu, uv, vv) = (u.length_squared(), u.dot(v), v.length_squared());
    let (ou, ov) = (offset.dot(u), offset.dot(v));
    let determinant = uu * vv - uv * uv;
    let whole = |numerator: f64| (numerator / determinant).round().clamp(0.0, size as f64) as i64;
    [whole(uv * ov - vv * ou), whole(uv * ou - uu * ov)]
}

/// Whole numbers from `least` to `most` at which `c0 + c1 x + c2 x^2 < 1`, an interval that may be one too wide at its ends.
fn below_one([c0, c1, c2]: [f64; 3], least: i64, most: i64) -> Option<(i64, i64)> {
    let discriminant = c1 * c1 - 4.0 * c2 * (c0 - 1.0);
    if !(discriminant > 0.0 && c2 > 0.0) {
        return None;
    }
    let (middle, half) = (-c1 / (2.0 * c2), discriminant.sqrt() / (2.0 * c2));
    let (low, high) = ((middle - half).floor().max(least as f64), (middle + half).ceil().min(most as f64));
    (low <= high).then_some((low as i64, high as i64))
}
