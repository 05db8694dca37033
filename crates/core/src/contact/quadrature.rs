//! Quadrature of shape functions against the mask `phi = (1 - r^2/a^2)^2` over one drawn triangle of a face.
//!
//! The triangle is split until its cells' edges are below a fifth of the contact radius `a`; each cell takes the mid-edge
//! rule, exact for quadratics. What is summed are the moments `int phi s^m t^n dA` over the face's coordinates, of which
//! the shape functions' integrals are fixed combinations.
//!
//! On a flat face with straight edges all cells are alike, so their mid-edges form a lattice, and along a row of it `r^2`
//! is a quadratic in the running index: the rows and the part of each that the ball of radius `a` covers are known
//! beforehand. Curved faces are in `curved`.

use glam::DVec3;

use super::curved::{Cell, CellRules, DEEPEST, PlacedPoints, Polynomial, common_depth};
use crate::element::{Face, Tri3, Tri6};
use crate::mesh::{Faces, Surface};

/// Quadrature cells are split until their edges are below this part of the contact radius.
pub(super) const CELL_SIZE: f64 = 0.2;
/// Depth at which splitting stops: cells of 2^-24 of a triangle's edge are below any physical radius.
pub(super) const MAX_DEPTH: u32 = 24;
/// Depths whose points are placed beforehand: those of triangles that are not much larger than a fifth of the radius, of which
/// a contact covers many.
const PLACED_DEPTHS: usize = 2;
/// A face whose polynomial bends it by less than this part of its edges is flat to round-off.
const FLAT: f64 = 1e-13;

/// A face as a polynomial of its coordinates, `x = c0 + c1 s + c2 t + c3 s^2 + c4 s t + c5 t^2` with corners at (0, 0),
/// (1, 0) and (0, 1).
#[derive(Clone, Debug)]
pub struct FaceGeometry {
    coefficients: [DVec3; 6],
    /// Whether the last three vanish.
    flat: bool,
    /// Area in space over area in coordinates, where the face is flat.
    stretch: f64,
}

/// What depends on a drawn triangle alone.
pub struct TriangleGeometry {
    /// In the coordinates of its face.
    pub(super) corners: [Coordinates; 3],
    ends: [DVec3; 3],
    polynomial: Polynomial,
    /// Shortest and longest of the cells' longest edges by depth, squared, m^2.
    squared_edges: [[f64; 2]; DEEPEST + 1],
    /// Points of the lattices of the first depths.
    placed: [Vec<PlacedPoints>; PLACED_DEPTHS],
    centroid: DVec3,
    /// No point of it is farther from the centroid, m.
    reach: f64,
    /// How far the middle of each edge lies off its chord, m.
    pub(super) bulges: [f64; 3],
}

/// The faces of a surface at rest, prepared.
pub struct PatchGeometry {
    pub(super) faces: Vec<FaceGeometry>,
    pub(super) triangles: Vec<TriangleGeometry>,
    rules: CellRules,
    /// Largest contact radius known to be within the limit everywhere, m, as bits.
    pub(super) verified_radius: std::sync::atomic::AtomicU64,
}

impl PatchGeometry {
    /// Prepares faces and triangles.
    pub fn new(surface: &Surface) -> Self {
        let at = |n: u32| surface.positions[n as usize];
        let (faces, parts): (Vec<_>, Vec<_>) = match &surface.faces {
            Faces::Linear(faces) => {
                (faces.iter().map(|f| FaceGeometry::linear(f.map(at))).collect(), corners_of::<Tri3, 3>())
            }
            Faces::Quadratic(faces) => {
                (faces.iter().map(|f| FaceGeometry::quadratic(f.map(at))).collect(), corners_of::<Tri6, 6>())
            }
        };
        let rules = CellRules::new();
        let of_triangle = |t: usize| {
            TriangleGeometry::new(&rules, &faces[t / parts.len()], parts[t % parts.len()], surface.corners(t as u32))
        };
        let triangles = (0..surface.triangles.len()).map(of_triangle).collect();
        Self { faces, triangles, rules, verified_radius: 0.into() }
    }

    /// Moments of the mask around `centre` over triangle `t` of a face.
    pub fn integrate(&self, t: usize, face: &FaceGeometry, centre: DVec3, radius: f64) -> Moments {
        let (triangle, mut moments) = (&self.triangles[t], Moments::default());
        let reach = radius + triangle.reach;
        if (triangle.centroid - centre).length_squared() > reach * reach {
            return moments;
        }
        match common_depth(&triangle.squared_edges, CELL_SIZE * CELL_SIZE * radius * radius) {
            Some(depth) => {
                let own = match triangle.placed.get(depth) {
                    Some(placed) => self.rules.sum_placed(depth, placed, centre, radius),
                    None => self.rules.sum(depth, &triangle.polynomial, centre, radius),
                };
                moments.add_cell(triangle.corners, own);
            }
            None if face.flat => {
                Lattice::new(triangle.corners, triangle.ends, centre, radius, face.stretch).integrate(&mut moments);
            }
            None => Cell { corners: triangle.corners, ends: triangle.ends }.integrate(
                face,
                &self.rules,
                centre,
                radius,
                0,
                &mut moments,
            ),
        }
        moments
    }
}

impl TriangleGeometry {
    fn new(rules: &CellRules, face: &FaceGeometry, corners: [Coordinates; 3], ends: [DVec3; 3]) -> Self {
        let ([la, lb, lc], [a, b, c]) = (corners, ends);
        let at = [halfway(la, lb), halfway(lb, lc), halfway(lc, la)].map(|l| face.at(l));
        let chords = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0];
        let bulges = [0, 1, 2].map(|k| if face.flat { 0.0 } else { at[k].distance(chords[k]) });
        let squared_longest = [b - a, c - b, a - c].map(DVec3::length_squared).into_iter().fold(0.0, f64::max);
        let polynomial = Polynomial::through(ends, at);
        Self {
            corners,
            ends,
            squared_edges: polynomial.squared_edges(),
            placed: std::array::from_fn(|depth| rules.place(depth, &polynomial)),
            polynomial,
            centroid: (a + b + c) / 3.0,
            reach: cell_reach(squared_longest, bulges.into_iter().fold(0.0, f64::max)),
            bulges,
        }
    }
}

/// Distance from the centroid of a cell that none of its points exceeds. No point of the flat cell is farther than two thirds
/// of its longest edge; the cell leaves the plane of its corners by `4 sum l_i l_j d_ij`, with the deviations `d` at the
/// middles of the edges, and the sum of the products is at most a third.
pub(super) fn cell_reach(squared_longest: f64, deviation: f64) -> f64 {
    2.0 / 3.0 * squared_longest.sqrt() + 4.0 / 3.0 * deviation
}

/// Corners of the drawn triangles of a face in its coordinates.
fn corners_of<F: Face<N>, const N: usize>() -> Vec<[Coordinates; 3]> {
    F::PARTS.iter().map(|part| part.map(|k| [F::NODES[k].y, F::NODES[k].z])).collect()
}

/// A point of a face: its coordinates `s`, `t`.
pub type Coordinates = [f64; 2];

/// `int phi`, and with `s`, `t`, `s^2`, `s t`, `t^2`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moments {
    sums: [f64; 6],
    /// Whether any of the triangle lies under the mask.
    pub covered: bool,
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

    /// Adds moments over a cell, in the cell's own coordinates `(x, y)`, of a face whose point `(s, t)` they are at the
    /// cell's corners.
    pub(super) fn add_cell(&mut self, [a, b, c]: [Coordinates; 3], own: [f64; 6]) {
        if own[0] <= 0.0 {
            return;
        }
        self.covered = true;
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

impl FaceGeometry {
    fn linear([a, b, c]: [DVec3; 3]) -> Self {
        let zero = DVec3::ZERO;
        let coefficients = [a, b - a, c - a, zero, zero, zero];
        Self { coefficients, flat: true, stretch: (b - a).cross(c - a).length() }
    }

    fn quadratic([x0, x1, x2, x01, x12, x20]: [DVec3; 6]) -> Self {
        let bent = [2.0 * (x0 + x1 - 2.0 * x01), 4.0 * (x0 - x01 - x20 + x12), 2.0 * (x0 + x2 - 2.0 * x20)];
        let size = (x1 - x0).length() + (x2 - x0).length();
        if bent.iter().all(|c| c.length() <= FLAT * size) {
            return Self::linear([x0, x1, x2]);
        }
        let coefficients = [x0, 4.0 * x01 - 3.0 * x0 - x1, 4.0 * x20 - 3.0 * x0 - x2, bent[0], bent[1], bent[2]];
        Self { coefficients, flat: false, stretch: 0.0 }
    }

    /// Position of a point.
    pub fn at(&self, [s, t]: Coordinates) -> DVec3 {
        let c = &self.coefficients;
        let flat = c[0] + c[1] * s + c[2] * t;
        if self.flat { flat } else { flat + (c[3] * s + c[4] * t) * s + c[5] * (t * t) }
    }
}

/// Coordinates halfway between two points.
pub fn halfway([a, b]: Coordinates, [c, d]: Coordinates) -> Coordinates {
    [(a + c) / 2.0, (b + d) / 2.0]
}

/// Twice the area of a triangle in coordinates.
fn doubled_area([a, b, c]: [Coordinates; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
}

/// The mid-edges of a flat triangle's cells, in units of half a cell's edge: points `(i, j)` with `i + j <= 2 n`, of which
/// one index at least is odd, `n` cells to an edge. Distances are counted from the point `(i_0, j_0)` closest to the centre,
/// so that they keep their digits where the triangle is much larger than the contact.
struct Lattice {
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
    fn new(corners: [Coordinates; 3], [a, b, c]: [DVec3; 3], centre: DVec3, radius: f64, stretch: f64) -> Self {
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
        let weight = 2.0 * stretch * 0.5 * doubled_area(corners) * 4.0 * step * step / 3.0;
        let start = [0, 1].map(|k| corners[0][k] + along_i[k] * i + along_j[k] * j);
        Self { size, origin, distance, start, along_i, along_j, weight }
    }

    fn integrate(&self, moments: &mut Moments) {
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
        moments.covered = true;
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
