//! Heights of a body over the contact plane, as means over each cell.
//!
//! A body is given by facets that bend with the normals at their corners. Faces steeper than [`STEEPEST`] have no height over the
//! plane: where such a face begins, at the edge of a block as on the side of a ball, the height falls off by that slope from the
//! edge. So heights are continuous wherever the grid lies. Of several heights the largest counts.
//!
//! A height in the middle of a cell would have a slope that jumps when a sharp edge passes by, for a whole row of cells at once. Its
//! mean over the cell has not: with the distance `x` from an edge where the slope changes by `s`, and half the width `W` of the cell
//! across it, it is lower than in the middle by `s (W - |x|)^2 / (4 W)` for `|x| < W`.

use glam::{DMat3, DVec3};

use super::super::place::ContactPlane;
use super::influence::{Grid, MAX_CELLS};

/// Largest slope of a height.
const STEEPEST: f64 = 3.0;
/// Least cosine of the angle between a facet's normal and that of the plane: that slope.
pub const LEAST_COSINE: f64 = 0.316_227_766_016_837_94;

/// Where the cells lie: coordinates along both axes of the grid, and height over the plane, m.
#[derive(Clone, Copy, Debug)]
pub struct GridFrame {
    /// A point of the plane.
    pub origin: DVec3,
    /// Both axes of the grid and the normal, as columns.
    pub axes: DMat3,
    /// Coordinates of the grid's first corner, m.
    pub corner: [f64; 2],
    /// Sides of a cell, m.
    pub sides: [f64; 2],
    /// Cells along each side.
    pub count: usize,
    /// Height of the tool's lowest point, m: what is lower is not touched.
    pub lowest: f64,
}

/// Where a surface that is higher than some level ends.
#[derive(Clone, Copy, Debug)]
pub struct End {
    /// The point, m.
    pub point: DVec3,
    /// How far it goes along the direction as the level rises.
    pub by_level: f64,
}

impl End {
    /// The end of triangles along a direction, above a level of the plane.
    pub fn of(
        triangles: impl Iterator<Item = [DVec3; 3]>,
        plane: &ContactPlane,
        direction: DVec3,
        level: f64,
    ) -> Option<Self> {
        let mut end: Option<(f64, Self)> = None;
        let mut reach = |point: DVec3, by_level: f64| {
            let along = (point - plane.origin).dot(direction);
            if end.is_none_or(|(farthest, _)| along > farthest) {
                end = Some((along, Self { point, by_level }));
            }
        };
        for corners in triangles {
            let heights = corners.map(|corner| (corner - plane.origin).dot(plane.axes.z_axis) - level);
            for k in 0..3 {
                let (from, to) = ((corners[k], heights[k]), (corners[(k + 1) % 3], heights[(k + 1) % 3]));
                if from.1 >= 0.0 {
                    reach(from.0, 0.0);
                }
                if (from.1 < 0.0) != (to.1 < 0.0) {
                    let by_height = (to.0 - from.0) / (to.1 - from.1);
                    reach(from.0 - by_height * from.1, by_height.dot(direction));
                }
            }
        }
        end.map(|(_, end)| end)
    }
}

/// A surface that a tool is pressed on.
pub trait Relief {
    /// Enters its heights.
    fn fill(&self, frame: &GridFrame, heights: &mut Heights);

    /// How far it reaches along a direction in the plane, where it is higher than `lowest` over it, m; none if it has no end.
    fn end(&self, _plane: &ContactPlane, _direction: DVec3, _lowest: f64) -> Option<End> {
        None
    }
}

/// Heights of a surface.
#[derive(Clone, Debug)]
pub struct Heights {
    /// Over the plane, m; minus infinity where there is no surface.
    pub height: Grid,
    /// Slopes along both axes of the grid.
    pub slopes: [Grid; 2],
    /// The point of the surface that carries the height, in coordinates of the grid, m.
    pub carrier: [Grid; 3],
    /// Change of the mean height with the sides of the cell.
    pub by_side: [Grid; 2],
}

/// An edge between two facets, in coordinates of the grid.
struct Crease {
    from: DVec3,
    along: DVec3,
    /// Unit vector across it in the plane, from the first facet to the second.
    across: [f64; 2],
    /// Slopes of both along that.
    slopes: [f64; 2],
    /// Half the width of a cell across it, m, and its change with the sides of a cell.
    width: f64,
    by_side: [f64; 2],
}

impl Default for Heights {
    /// Of nothing.
    fn default() -> Self {
        let zero = [[0.0; MAX_CELLS]; MAX_CELLS];
        Self {
            height: [[f64::NEG_INFINITY; MAX_CELLS]; MAX_CELLS],
            slopes: [zero; 2],
            carrier: [zero; 3],
            by_side: [zero; 2],
        }
    }
}

impl Heights {
    /// Forgets the surface.
    pub fn clear(&mut self) {
        self.height = [[f64::NEG_INFINITY; MAX_CELLS]; MAX_CELLS];
    }

    /// Enters a height where it is larger than the one that is known.
    pub fn raise(&mut self, (i, j): (usize, usize), height: f64, slopes: [f64; 2], carrier: DVec3) {
        if height > self.height[j][i] {
            self.height[j][i] = height;
            for k in 0..2 {
                self.slopes[k][j][i] = slopes[k];
                self.by_side[k][j][i] = 0.0;
            }
            for k in 0..3 {
                self.carrier[k][j][i] = carrier[k];
            }
        }
    }

    /// Enters a facet whose normal is no steeper than [`LEAST_COSINE`]. `bends` has for each edge `(k, k + 1)` how much the
    /// surface bulges over it, four times over its middle, m.
    pub fn add_facet(&mut self, frame: &GridFrame, corners: [DVec3; 3], bends: [f64; 3]) {
        let [a, b, c] = corners.map(|corner| frame.coordinates(corner));
        let twice = |p: DVec3, q: DVec3, u: f64, v: f64| (q.x - p.x) * (v - p.y) - (q.y - p.y) * (u - p.x);
        let area = twice(a, b, c.x, c.y);
        if area <= 0.0 {
            return;
        }
        let inverse = 1.0 / area;
        // Gradients of the barycentric coordinates.
        let gradients = [(b, c), (c, a), (a, b)].map(|(p, q)| [-(q.y - p.y) * inverse, (q.x - p.x) * inverse]);
        let [columns, rows] = frame.range([a, b, c], 0.0);
        for j in rows {
            for i in columns.clone() {
                let [u, v] = frame.middle(i, j);
                let part = [(b, c), (c, a), (a, b)].map(|(p, q)| twice(p, q, u, v) * inverse);
                // A cell on a common edge belongs to both facets.
                if part.iter().any(|&part| part < -1e-9) {
                    continue;
                }
                let (mut height, mut slopes) = (0.0, [0.0; 2]);
                for (k, corner) in [a, b, c].into_iter().enumerate() {
                    let next = (k + 1) % 3;
                    height += part[k] * (corner.z + part[next] * bends[k]);
                    for axis in 0..2 {
                        slopes[axis] += gradients[k][axis] * (corner.z + part[next] * bends[k])
                            + part[k] * gradients[next][axis] * bends[k];
                    }
                }
                self.raise((i, j), height, slopes, DVec3::new(u, v, height));
            }
        }
    }

    /// Evens the heights over an edge between two facets with the given normals, both of which have heights.
    pub fn even_edge(&mut self, frame: &GridFrame, edge: [DVec3; 2], normals: [DVec3; 2]) {
        if let Some(crease) = Crease::new(frame, edge, normals[0], Some(normals[1])) {
            self.even(frame, &crease, false);
        }
    }

    /// Enters what falls off from an edge of a facet, beyond which the surface is steeper, and evens the heights over it.
    pub fn add_edge(&mut self, frame: &GridFrame, edge: [DVec3; 2], normal: DVec3) {
        if let Some(crease) = Crease::new(frame, edge, normal, None) {
            self.even(frame, &crease, true);
        }
    }

    fn even(&mut self, frame: &GridFrame, crease: &Crease, falls: bool) {
        let (from, to) = (crease.from, crease.from + crease.along);
        let fall = if falls { ((from.z.max(to.z) - frame.lowest) / STEEPEST).max(0.0) } else { 0.0 };
        let squared = crease.along.truncate().length_squared().max(f64::MIN_POSITIVE);
        let [columns, rows] = frame.range([from, to, to], crease.width.max(fall));
        for j in rows {
            for i in columns.clone() {
                let [u, v] = frame.middle(i, j);
                let offset = DVec3::new(u, v, 0.0) - from;
                let part = offset.truncate().dot(crease.along.truncate()) / squared;
                let carrier = from + crease.along * part.clamp(0.0, 1.0);
                let beside = DVec3::new(u - carrier.x, v - carrier.y, 0.0).truncate();
                let out = beside.x * crease.across[0] + beside.y * crease.across[1];
                let passes = (0.0..1.0).contains(&part);
                if falls && out >= 0.0 && (passes || out > 0.0) {
                    // Round the ends of an edge it falls off in all directions.
                    let distance = beside.length();
                    let away = if distance > 0.0 { (beside / distance).to_array() } else { crease.across };
                    let (lower, steeper, by_side) = crease.lowered(distance);
                    let slopes = away.map(|away| -(STEEPEST + steeper) * away);
                    let height = carrier.z - STEEPEST * distance - lower;
                    if height > self.height[j][i] {
                        self.raise((i, j), height, slopes, carrier);
                        (0..2).for_each(|k| self.by_side[k][j][i] = -by_side[k]);
                    }
                } else if passes {
                    self.lower((i, j), crease, carrier.z, out);
                }
            }
        }
    }

    /// Lowers a height that is one of the facets at a crease to its mean over the cell.
    fn lower(&mut self, (i, j): (usize, usize), crease: &Crease, edge: f64, out: f64) {
        let expected = edge + out * crease.slopes[usize::from(out > 0.0)];
        if out.abs() >= crease.width || (self.height[j][i] - expected).abs() > crease.width {
            return;
        }
        let (lower, steeper, by_side) = crease.lowered(out);
        self.height[j][i] -= lower;
        self.carrier[2][j][i] -= lower;
        for k in 0..2 {
            self.slopes[k][j][i] -= steeper * crease.across[k];
            self.by_side[k][j][i] -= by_side[k];
        }
    }
}

impl Crease {
    /// Between a facet and one that is as steep as it may be, where none is given.
    fn new(frame: &GridFrame, [from, to]: [DVec3; 2], first: DVec3, second: Option<DVec3>) -> Option<Self> {
        let (from, to) = (frame.coordinates(from), frame.coordinates(to));
        let along = to - from;
        // Facets are turned to the left of their edges.
        let across = glam::DVec2::new(along.y, -along.x).try_normalize()?;
        let slope = |normal: DVec3| {
            let normal = frame.axes.transpose() * normal;
            -(normal.x * across.x + normal.y * across.y) / normal.z
        };
        let slopes = [slope(first), second.map_or(-STEEPEST, slope)];
        let by_side = [0.5 * across.x.abs(), 0.5 * across.y.abs()];
        let width = by_side[0] * frame.sides[0] + by_side[1] * frame.sides[1];
        Some(Self { from, along, across: across.to_array(), slopes, width, by_side })
    }

    /// How much lower the mean over a cell is than its middle at a distance, the derivative of that by the distance, and by the
    /// sides of a cell.
    fn lowered(&self, out: f64) -> (f64, f64, [f64; 2]) {
        let (bend, width) = (self.slopes[0] - self.slopes[1], self.width);
        let within = width - out.abs();
        if within <= 0.0 {
            return (0.0, 0.0, [0.0; 2]);
        }
        let by_width = 0.25 * bend * (1.0 - (out / width).powi(2));
        let lower = 0.25 * bend * within * within / width;
        (lower, -0.5 * bend * within / width * out.signum(), self.by_side.map(|by| by * by_width))
    }
}

impl GridFrame {
    /// A point in coordinates of the grid.
    pub fn coordinates(&self, point: DVec3) -> DVec3 {
        self.axes.transpose() * (point - self.origin)
    }

    /// Coordinates of the middle of a cell, m.
    pub fn middle(&self, i: usize, j: usize) -> [f64; 2] {
        [self.corner[0] + (i as f64 + 0.5) * self.sides[0], self.corner[1] + (j as f64 + 0.5) * self.sides[1]]
    }

    /// Cells whose middles lie in the box around some points, widened by `reach`.
    fn range(&self, points: [DVec3; 3], reach: f64) -> [std::ops::Range<usize>; 2] {
        [0, 1].map(|k| {
            let low = points.iter().map(|p| p[k]).fold(f64::INFINITY, f64::min) - reach;
            let high = points.iter().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max) + reach;
            let cell = |at: f64| (at - self.corner[k]) / self.sides[k] - 0.5;
            // Negative ones, and what is no number, become zero.
            let first = cell(low).ceil().min(self.count as f64) as usize;
            let end = (cell(high).floor() + 1.0).min(self.count as f64) as usize;
            first..end
        })
    }
}
