//! Quadrature on a curved face, cell by cell.
//!
//! A cell is the image of a triangle under a polynomial `x(p)` of degree two, for which a chord is exactly
//! `x(q) - x(p) = J((p + q) / 2) (q - p)`: the edges of its cells at depth `m` are `J e / 2^m` with `J` linear in the place.
//! Where the bounds of `|J e|` over the cell show that all its parts are split to the same depth, and no further, their
//! mid-edges form a lattice that is known beforehand, and all of them are summed at once. Elsewhere the cell is split, and the
//! bounds of its parts are closer.

use glam::DVec3;
use pulp::{Arch, NullaryFnOnce};

use super::quadrature::{CELL_SIZE, Coordinates, FaceGeometry, MAX_DEPTH, Moments, halfway};

/// Points taken at once: sums run in so many parts in a fixed order, whatever the processor's vectors.
const LANES: usize = 8;
/// Depth of the finest lattice.
const DEEPEST: usize = 3;

type Lane = [f64; LANES];

/// Some points of a lattice, in a cell's coordinates, and how many cells' edges each lies on.
#[derive(Clone, Copy)]
struct Points {
    x: Lane,
    y: Lane,
    share: Lane,
}

/// Lattices of mid-edges by depth.
pub struct CellRules {
    arch: Arch,
    lattices: [Vec<Points>; DEEPEST + 1],
}

impl CellRules {
    /// Of all depths.
    pub fn new() -> Self {
        Self { arch: Arch::new(), lattices: std::array::from_fn(lattice) }
    }
}

/// Mid-edges of the cells at a depth: points `(i, j)` of a grid of half edges of which one index at least is odd.
fn lattice(depth: usize) -> Vec<Points> {
    let size = 2usize << depth;
    let inside = |&(i, j): &(usize, usize)| i + j <= size && (i % 2 == 1 || j % 2 == 1);
    let places: Vec<_> = (0..=size).flat_map(|j| (0..=size).map(move |i| (i, j))).filter(inside).collect();
    let of_cell = 1.0 / 6.0 / (1u64 << (2 * depth)) as f64;
    let of_chunk = |chunk: &[(usize, usize)]| {
        let mut points = Points { x: [0.0; LANES], y: [0.0; LANES], share: [0.0; LANES] };
        for (lane, &(i, j)) in chunk.iter().enumerate() {
            let on_edge = i == 0 || j == 0 || i + j == size;
            points.x[lane] = i as f64 / size as f64;
            points.y[lane] = j as f64 / size as f64;
            points.share[lane] = if on_edge { of_cell } else { 2.0 * of_cell };
        }
        points
    };
    places.chunks(LANES).map(of_chunk).collect()
}

/// A part of a face: its corners in the face's coordinates and in space.
pub struct Cell {
    pub corners: [Coordinates; 3],
    pub ends: [DVec3; 3],
}

impl Cell {
    /// Adds the moments under the mask around `centre`, splitting the cell until it is small against the radius.
    pub fn integrate(
        &self,
        face: &FaceGeometry,
        rules: &CellRules,
        centre: DVec3,
        radius: f64,
        depth: u32,
        moments: &mut Moments,
    ) {
        let ([a, b, c], [la, lb, lc]) = (self.ends, self.corners);
        let longest = [(b - a), (c - b), (a - c)].map(DVec3::length_squared).into_iter().fold(0.0, f64::max);
        let middles = [halfway(la, lb), halfway(lb, lc), halfway(lc, la)];
        let at = middles.map(|l| face.at(l));
        let chords = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0];
        // The cell leaves the plane of its corners by `4 sum l_i l_j d_ij`, with the deviations `d` at the middles of the
        // edges; the sum of the products is at most a third.
        let squared_deviation = (0..3).map(|k| (at[k] - chords[k]).length_squared()).fold(0.0, f64::max);
        // No point of the flat cell is farther from its centroid than two thirds of its longest edge.
        let reach = radius + 2.0 / 3.0 * longest.sqrt() + 4.0 / 3.0 * squared_deviation.sqrt();
        if ((a + b + c) / 3.0 - centre).length_squared() > reach * reach {
            return;
        }
        let polynomial = Polynomial::through(self.ends, at);
        let is_small = longest <= CELL_SIZE * CELL_SIZE * radius * radius || depth == MAX_DEPTH;
        let lattice = if is_small { Some(0) } else { polynomial.common_depth(CELL_SIZE * radius, MAX_DEPTH - depth) };
        if let Some(deeper) = lattice {
            let points = &rules.lattices[deeper];
            moments
                .add_cell(self.corners, rules.arch.dispatch(Sum { points, polynomial: &polynomial, centre, radius }));
            return;
        }
        let parts = [
            ([la, middles[0], middles[2]], [a, at[0], at[2]]),
            ([middles[0], lb, middles[1]], [at[0], b, at[1]]),
            ([middles[2], middles[1], lc], [at[2], at[1], c]),
            (middles, at),
        ];
        for (corners, ends) in parts {
            Cell { corners, ends }.integrate(face, rules, centre, radius, depth + 1, moments);
        }
    }
}

/// A cell as a polynomial of its own coordinates, `x = c0 + c1 x + c2 y + c3 x^2 + c4 x y + c5 y^2`.
struct Polynomial([DVec3; 6]);

impl Polynomial {
    /// From corners and the middles of the edges 01, 12, 20.
    fn through([x0, x1, x2]: [DVec3; 3], [x01, x12, x20]: [DVec3; 3]) -> Self {
        Self([
            x0,
            4.0 * x01 - 3.0 * x0 - x1,
            4.0 * x20 - 3.0 * x0 - x2,
            2.0 * (x0 + x1 - 2.0 * x01),
            4.0 * (x0 - x01 - x20 + x12),
            2.0 * (x0 + x2 - 2.0 * x20),
        ])
    }

    /// Depth, at most that of the finest lattice, to which all parts of the cell are split until their edges are within
    /// `finest`; `None` where they differ, may differ, or go deeper.
    fn common_depth(&self, finest: f64, allowed: u32) -> Option<usize> {
        let [_, c1, c2, c3, c4, c5] = self.0;
        // J e for the edges e = (1, 0), (0, 1), (-1, 1) is `k0 + kx x + ky y`.
        let edges = [(c1, 2.0 * c3, c4), (c2, c4, 2.0 * c5), (c2 - c1, c4 - 2.0 * c3, 2.0 * c5 - c4)];
        let (mut most, mut least) = (0.0f64, 0.0f64);
        for (k0, kx, ky) in edges {
            let corners = [k0, k0 + kx, k0 + ky];
            let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            // A linear field is longest at a corner, and nowhere shorter than in the middle less its largest change.
            let change = corners.map(|corner| corner.distance(middle)).into_iter().fold(0.0, f64::max);
            most = corners.map(DVec3::length).into_iter().fold(most, f64::max);
            least = least.max(middle.length() - change);
        }
        // Round-off of the bounds must not decide.
        let (most, least) = (most * (1.0 + 1e-9), least * (1.0 - 1e-9));
        let fits =
            |&depth: &usize| most <= finest * (1u32 << depth) as f64 && least > finest * (1u32 << depth) as f64 / 2.0;
        (1..=DEEPEST.min(allowed as usize)).find(fits)
    }
}

/// Moments over a cell, in its own coordinates, of the mask times the area in space.
struct Sum<'a> {
    points: &'a [Points],
    polynomial: &'a Polynomial,
    centre: DVec3,
    radius: f64,
}

impl NullaryFnOnce for Sum<'_> {
    type Output = [f64; 6];
    #[inline(always)]
    fn call(self) -> [f64; 6] {
        let [c0, c1, c2, c3, c4, c5] = self.polynomial.0.map(|c| c.to_array());
        let centre = self.centre.to_array();
        let squared_radius = self.radius * self.radius;
        let mut sums = [[0.0; LANES]; 6];
        for points in self.points {
            let (x, y) = (&points.x, &points.y);
            let mut squared_distance = [0.0; LANES];
            let mut along_x = [[0.0; LANES]; 3];
            let mut along_y = [[0.0; LANES]; 3];
            for k in 0..3 {
                for l in 0..LANES {
                    let offset = c0[k] - centre[k]
                        + (c1[k] + c3[k] * x[l] + c4[k] * y[l]) * x[l]
                        + (c2[k] + c5[k] * y[l]) * y[l];
                    squared_distance[l] += offset * offset;
                    along_x[k][l] = c1[k] + 2.0 * c3[k] * x[l] + c4[k] * y[l];
                    along_y[k][l] = c2[k] + c4[k] * x[l] + 2.0 * c5[k] * y[l];
                }
            }
            let mut weight = [0.0; LANES];
            for l in 0..LANES {
                let inside = (1.0 - squared_distance[l] / squared_radius).max(0.0);
                let cross = [
                    along_x[1][l] * along_y[2][l] - along_x[2][l] * along_y[1][l],
                    along_x[2][l] * along_y[0][l] - along_x[0][l] * along_y[2][l],
                    along_x[0][l] * along_y[1][l] - along_x[1][l] * along_y[0][l],
                ];
                let stretch = (cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]).sqrt();
                weight[l] = points.share[l] * stretch * inside * inside;
            }
            for l in 0..LANES {
                let (wx, wy) = (weight[l] * x[l], weight[l] * y[l]);
                sums[0][l] += weight[l];
                sums[1][l] += wx;
                sums[2][l] += wy;
                sums[3][l] += wx * x[l];
                sums[4][l] += wx * y[l];
                sums[5][l] += wy * y[l];
            }
        }
        sums.map(|[a, b, c, d, e, f, g, h]| ((a + e) + (c + g)) + ((b + f) + (d + h)))
    }
}
