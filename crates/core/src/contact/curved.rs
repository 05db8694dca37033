//! Quadrature on a curved face, cell by cell.
//!
//! If all parts of a triangle are split to the same depth, their mid-edges form a lattice that is prepared beforehand, and all of
//! them are summed at once. Otherwise, and if the triangle is much larger than the contact, it is split cell by cell.

use glam::DVec3;
use pulp::{Arch, NullaryFnOnce};

use super::face::FaceGeometry;
use super::moments::{CELL_SIZE, Coordinates, MAX_DEPTH, Moments, cell_reach, halfway};
use crate::math::sum_lanes;

/// Points summed side by side. The order of the sums is fixed, whatever the processor's vectors.
const LANES: usize = 8;
/// Depth of the finest lattice.
pub const DEEPEST: usize = 3;

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

    /// Points of the lattice of a depth on a cell.
    pub fn place(&self, depth: usize, polynomial: &Polynomial) -> Vec<PlacedPoints> {
        let of_chunk = |points| PlacedPoints {
            at: places(&polynomial.coefficients, points),
            area: areas(&polynomial.coefficients, points),
        };
        self.lattices[depth].iter().map(of_chunk).collect()
    }

    /// Moments over a cell, in its own coordinates, from its points at a depth.
    pub fn sum_placed(&self, depth: usize, placed: &[PlacedPoints], centre: DVec3, radius: f64) -> [f64; 6] {
        self.arch.dispatch(PlacedSum { points: &self.lattices[depth], placed, centre, radius })
    }

    /// Moments over a cell whose parts are all split to a depth, in its own coordinates.
    pub fn sum(&self, depth: usize, polynomial: &Polynomial, centre: DVec3, radius: f64) -> [f64; 6] {
        self.arch.dispatch(Sum { points: &self.lattices[depth], polynomial, centre, radius })
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
        let deviation = (0..3).map(|k| at[k].distance(chords[k])).fold(0.0, f64::max);
        let reach = radius + cell_reach(longest, deviation);
        if ((a + b + c) / 3.0 - centre).length_squared() > reach * reach {
            return;
        }
        let polynomial = Polynomial::through(self.ends, at);
        let finest = CELL_SIZE * radius;
        let common = match longest <= finest * finest || depth == MAX_DEPTH {
            true => Some(0),
            false => polynomial.surely_common_depth(finest, MAX_DEPTH - depth),
        };
        if let Some(deeper) = common {
            moments.add_cell(self.corners, rules.sum(deeper, &polynomial, centre, radius));
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
pub struct Polynomial {
    coefficients: [[f64; 3]; 6],
}

impl Polynomial {
    /// From corners and the middles of the edges 01, 12, 20.
    pub fn through([x0, x1, x2]: [DVec3; 3], [x01, x12, x20]: [DVec3; 3]) -> Self {
        let coefficients = [
            x0,
            4.0 * x01 - 3.0 * x0 - x1,
            4.0 * x20 - 3.0 * x0 - x2,
            2.0 * (x0 + x1 - 2.0 * x01),
            4.0 * (x0 - x01 - x20 + x12),
            2.0 * (x0 + x2 - 2.0 * x20),
        ];
        Self { coefficients: coefficients.map(|c| c.to_array()) }
    }

    /// Depth of a lattice to which all parts are surely split until their edges are within `finest`, by bounds that cost
    /// little.
    ///
    /// A chord of a polynomial of degree two is `x(q) - x(p) = J((p + q) / 2) (q - p)`: edges at depth `m` are `J e / 2^m`, and
    /// `J e` is linear in the place.
    fn surely_common_depth(&self, finest: f64, allowed: u32) -> Option<usize> {
        let [_, c1, c2, c3, c4, c5] = self.coefficients.map(DVec3::from);
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
        let fits = |edge: f64| most * (1.0 + 1e-9) <= edge && least * (1.0 - 1e-9) > 0.5 * edge;
        (1..=DEEPEST.min(allowed as usize)).find(|&depth| fits(finest * (1u32 << depth) as f64))
    }

    /// Position of a point, in the cell's coordinates.
    fn at(&self, x: f64, y: f64) -> DVec3 {
        let [c0, c1, c2, c3, c4, c5] = self.coefficients.map(DVec3::from);
        c0 + (c1 + c3 * x + c4 * y) * x + (c2 + c5 * y) * y
    }

    /// For each depth up to that of the finest lattice the shortest and the longest of the parts' longest edges, squared.
    pub fn squared_edges(&self) -> [[f64; 2]; DEEPEST + 1] {
        const SIZE: usize = 1 << DEEPEST;
        let mut grid = [[DVec3::ZERO; SIZE + 1]; SIZE + 1];
        for (j, row) in grid.iter_mut().enumerate() {
            for (i, point) in row.iter_mut().enumerate() {
                *point = self.at(i as f64 / SIZE as f64, j as f64 / SIZE as f64);
            }
        }
        std::array::from_fn(|depth| {
            let step = SIZE >> depth;
            let longest =
                |[a, b, c]: [DVec3; 3]| a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
            let mut bounds = [f64::INFINITY, 0.0f64];
            for (i, j) in (0..SIZE * SIZE).map(|k| (k / SIZE, k % SIZE)).filter(|(i, j)| i % step + j % step == 0) {
                let corners = [grid[j][i], grid[j][i + step], grid[j + step][i]];
                // Upright cells, and those between them.
                let upright = (i + j < SIZE).then(|| longest(corners));
                let between =
                    (i + j + step < SIZE).then(|| longest([corners[1], corners[2], grid[j + step][i + step]]));
                for edge in upright.into_iter().chain(between) {
                    bounds = [bounds[0].min(edge), bounds[1].max(edge)];
                }
            }
            bounds
        })
    }
}

/// Depth, at most that of the finest lattice, to which all parts of a cell are split until their edges are within a length;
/// `None` where they differ or go deeper.
pub fn common_depth(squared_edges: &[[f64; 2]; DEEPEST + 1], squared_finest: f64) -> Option<usize> {
    let split = squared_edges.iter().take_while(|[shortest, _]| *shortest > squared_finest).count();
    squared_edges.get(split).filter(|[_, longest]| *longest <= squared_finest).map(|_| split)
}

/// Points of a lattice on a cell in space: their positions, and the area that each represents.
#[derive(Clone, Copy)]
pub struct PlacedPoints {
    at: [Lane; 3],
    area: Lane,
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
        let (mask, coefficients) = (Mask::new(self.centre, self.radius), &self.polynomial.coefficients);
        let mut sums = [[0.0; LANES]; 6];
        for points in self.points {
            let inside = mask.at(&places(coefficients, points));
            if sum_lanes(inside) > 0.0 {
                add(&mut sums, points, &inside, &areas(coefficients, points));
            }
        }
        totals(&sums)
    }
}

/// The same over points with known positions.
struct PlacedSum<'a> {
    points: &'a [Points],
    placed: &'a [PlacedPoints],
    centre: DVec3,
    radius: f64,
}

impl NullaryFnOnce for PlacedSum<'_> {
    type Output = [f64; 6];
    #[inline(always)]
    fn call(self) -> [f64; 6] {
        let mask = Mask::new(self.centre, self.radius);
        let mut sums = [[0.0; LANES]; 6];
        for (points, placed) in self.points.iter().zip(self.placed) {
            add(&mut sums, points, &mask.at(&placed.at), &placed.area);
        }
        totals(&sums)
    }
}

/// `1 - r^2 / a^2`, zero beyond the radius.
struct Mask {
    centre: [f64; 3],
    inverse: f64,
}

impl Mask {
    #[inline(always)]
    fn new(centre: DVec3, radius: f64) -> Self {
        Self { centre: centre.to_array(), inverse: 1.0 / (radius * radius) }
    }

    #[inline(always)]
    fn at(&self, places: &[Lane; 3]) -> Lane {
        let mut squared_distance = [0.0; LANES];
        for k in 0..3 {
            for l in 0..LANES {
                let offset = places[k][l] - self.centre[k];
                squared_distance[l] += offset * offset;
            }
        }
        let mut inside = [0.0; LANES];
        for l in 0..LANES {
            inside[l] = (1.0 - squared_distance[l] * self.inverse).max(0.0);
        }
        inside
    }
}

// Loops, not closures: a closure may be compiled for the narrowest vectors.
#[inline(always)]
fn places(c: &[[f64; 3]; 6], points: &Points) -> [Lane; 3] {
    let (x, y) = (&points.x, &points.y);
    let mut places = [[0.0; LANES]; 3];
    for k in 0..3 {
        for l in 0..LANES {
            let along = (c[1][k] + c[3][k] * x[l] + c[4][k] * y[l]) * x[l];
            places[k][l] = c[0][k] + along + (c[2][k] + c[5][k] * y[l]) * y[l];
        }
    }
    places
}

/// Area in space that the points represent.
#[inline(always)]
fn areas(c: &[[f64; 3]; 6], points: &Points) -> Lane {
    let (x, y) = (&points.x, &points.y);
    let (mut along_x, mut along_y) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
    for k in 0..3 {
        for l in 0..LANES {
            along_x[k][l] = c[1][k] + 2.0 * c[3][k] * x[l] + c[4][k] * y[l];
            along_y[k][l] = c[2][k] + c[4][k] * x[l] + 2.0 * c[5][k] * y[l];
        }
    }
    let mut area = [0.0; LANES];
    for l in 0..LANES {
        let nx = along_x[1][l] * along_y[2][l] - along_x[2][l] * along_y[1][l];
        let ny = along_x[2][l] * along_y[0][l] - along_x[0][l] * along_y[2][l];
        let nz = along_x[0][l] * along_y[1][l] - along_x[1][l] * along_y[0][l];
        area[l] = points.share[l] * (nx * nx + ny * ny + nz * nz).sqrt();
    }
    area
}

#[inline(always)]
fn add(sums: &mut [Lane; 6], points: &Points, inside: &Lane, area: &Lane) {
    for l in 0..LANES {
        let (x, y, weight) = (points.x[l], points.y[l], area[l] * inside[l] * inside[l]);
        let (wx, wy) = (weight * x, weight * y);
        sums[0][l] += weight;
        sums[1][l] += wx;
        sums[2][l] += wy;
        sums[3][l] += wx * x;
        sums[4][l] += wx * y;
        sums[5][l] += wy * y;
    }
}

#[inline(always)]
fn totals(sums: &[Lane; 6]) -> [f64; 6] {
    let mut totals = [0.0; 6];
    for k in 0..6 {
        totals[k] = sum_lanes(sums[k]);
    }
    totals
}
