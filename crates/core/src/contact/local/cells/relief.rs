//! Heights of a body over the contact plane, as means over each cell.
//!
//! A body is given by facets that bend with the normals at their corners. Faces steeper than [`STEEPEST`] have no height over the
//! plane: where such a face begins, at the edge of a block or on the side of a ball, the height decreases with that slope from the
//! edge. So heights are continuous wherever the grid lies. Of several heights the largest counts.
//!
//! A height in the middle of a cell would have a slope that jumps when a sharp edge passes by, for a whole row of cells at once.
//! The slope of its mean over the cell is continuous: with the distance `x` from an edge where the slope changes by `s`, and half
//! the width `W` of the cell across it, it is lower than in the middle by `s (W - |x|)^2 / (4 W)` for `|x| < W`.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DMat3, DVec3};

use super::super::contact_plane::ContactPlane;
use super::influence::{Grid, MAX_CELLS, ZERO};
use crate::math::{acos, sin};
use crate::mesh::is_convex;

/// Largest slope of a height.
const STEEPEST: f64 = 3.0;
/// Least cosine of the angle between a facet's normal and that of the plane: that slope.
pub const LEAST_COSINE: f64 = 0.316_227_766_016_837_94;

/// Frame of the cells: coordinates along both axes of the grid, and height over the plane, m.
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
    /// Height of the tool's lowest point, m: lower parts are not touched.
    pub lowest: f64,
}

/// End of the part of a surface above some level.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceEnd {
    /// The point, m.
    pub point: DVec3,
    /// Change of its coordinate along the direction with the level.
    pub by_level: f64,
}

impl SurfaceEnd {
    /// The end of triangles along a direction, above a level of the plane. `None` also where they reach farther than `enough`: most
    /// tools do not reach the end of the surface, and a few triangles show it.
    pub fn of(
        triangles: impl Iterator<Item = [DVec3; 3]>,
        plane: &ContactPlane,
        direction: DVec3,
        (level, enough): (f64, f64),
    ) -> Option<Self> {
        let mut end: Option<(f64, Self)> = None;
        let mut reach = |point: DVec3, by_level: f64| {
            let along = (point - plane.origin).dot(direction);
            if end.is_none_or(|(farthest, _)| along > farthest) {
                end = Some((along, Self { point, by_level }));
            }
            along > enough
        };
        for corners in triangles {
            let mut is_beyond = false;
            let heights = corners.map(|corner| (corner - plane.origin).dot(plane.axes.z_axis) - level);
            for k in 0..3 {
                let (from, to) = ((corners[k], heights[k]), (corners[(k + 1) % 3], heights[(k + 1) % 3]));
                if from.1 >= 0.0 {
                    is_beyond |= reach(from.0, 0.0);
                }
                if (from.1 < 0.0) != (to.1 < 0.0) {
                    let by_height = (to.0 - from.0) / (to.1 - from.1);
                    is_beyond |= reach(from.0 - by_height * from.1, by_height.dot(direction));
                }
            }
            if is_beyond {
                return None;
            }
        }
        end.map(|(_, end)| end)
    }
}

/// A surface that a tool is pressed on.
pub trait Relief {
    /// Adds its heights.
    fn fill(&self, frame: &GridFrame, heights: &mut Heights);

    /// End along a direction in the plane of the part higher than `lowest`, m; none if it has no end, or none before `enough`.
    fn end(&self, _plane: &ContactPlane, _direction: DVec3, (_lowest, _enough): (f64, f64)) -> Option<SurfaceEnd> {
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
    pub surface_point: [Grid; 3],
    /// Derivative of the mean height by the sides of the cell.
    pub by_side: [Grid; 2],
    /// Additional compliance near a convex edge, over that of a half-space.
    pub softening: Grid,
    /// Slopes of that along both axes of the grid, 1/m.
    pub softening_slopes: [Grid; 2],
    /// Its derivative by a rotation of the surface about both axes.
    pub softening_turns: [Grid; 2],
    /// The point of that edge next to the cell, in coordinates of the grid, m.
    pub edge: [Grid; 3],
    /// Whether there is such an edge.
    pub has_edge: bool,
}

/// A convex edge of a body and its compliance: a line load on the apex of a wedge with the interior angle `phi`
/// moves it, at a distance, `pi/(phi + sin phi)` times as far as a half-space if it acts along the bisector, and
/// `pi/(phi - sin phi)` times across (Michell's solution, Johnson, Contact Mechanics, 1985, section 2.2).
#[derive(Clone, Copy, Debug)]
pub struct Wedge {
    /// Unit vector outwards.
    bisector: DVec3,
    /// Compliance over that of a half-space along the bisector and across it.
    compliance: [f64; 2],
}

impl Wedge {
    /// Between faces with these normals, the first to the left of the edge `along`; none at a concave edge. A wedge thinner than a
    /// right angle bends as a plate, which the body's own compliance contains: it counts as a right angle.
    pub fn new(first: DVec3, second: DVec3, along: DVec3) -> Option<Self> {
        if !is_convex(first, second, along) {
            return None;
        }
        let angle = PI - acos(first.dot(second).clamp(-1.0, 1.0));
        let wide = angle.max(FRAC_PI_2);
        let compliance = [PI / (angle + sin(angle)), PI / (wide - sin(wide))];
        Some(Self { bisector: (first + second).try_normalize()?, compliance })
    }

    /// Additional compliance under a load along the third axis of a grid, over that of a half-space, and its derivative by a
    /// rotation about the first two axes. The bisector is given in the grid's axes.
    fn softness(&self, bisector: DVec3) -> (f64, [f64; 2]) {
        let [along, across] = self.compliance;
        let (softening, by_cosine) =
            (across + (along - across) * bisector.z * bisector.z - 1.0, 2.0 * (along - across) * bisector.z);
        (softening, [by_cosine * bisector.y, -by_cosine * bisector.x])
    }
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
    /// Without a surface.
    fn default() -> Self {
        Self {
            height: [[f64::NEG_INFINITY; MAX_CELLS]; MAX_CELLS],
            slopes: [ZERO; 2],
            surface_point: [ZERO; 3],
            by_side: [ZERO; 2],
            softening: ZERO,
            softening_slopes: [ZERO; 2],
            softening_turns: [ZERO; 2],
            edge: [ZERO; 3],
            has_edge: false,
        }
    }
}

impl Heights {
    /// Removes the surface.
    pub fn clear(&mut self) {
        self.height = [[f64::NEG_INFINITY; MAX_CELLS]; MAX_CELLS];
        if self.has_edge {
            (self.softening, self.softening_slopes, self.softening_turns) = (ZERO, [ZERO; 2], [ZERO; 2]);
            self.has_edge = false;
        }
    }

    /// Adds a convex edge, near which the surface is softer, up to a distance `reach` from it, m.
    pub fn soften(&mut self, frame: &GridFrame, edge: [DVec3; 2], wedge: &Wedge, reach: f64) {
        let [from, to] = edge.map(|end| frame.coordinates(end));
        let along = to - from;
        let squared = along.truncate().length_squared().max(f64::MIN_POSITIVE);
        let inverse = 1.0 / (reach * reach);
        let (softening, turns) = wedge.softness(frame.axes.transpose() * wedge.bisector);
        let [columns, rows] = frame.range([from, to, to], reach);
        self.has_edge = true;
        for j in rows {
            for i in columns.clone() {
                let [u, v] = frame.middle(i, j);
                let offset = DVec3::new(u, v, 0.0) - from;
                let part = (offset.truncate().dot(along.truncate()) / squared).clamp(0.0, 1.0);
                let nearest = from + along * part;
                let beside = [u - nearest.x, v - nearest.y];
                let within = 1.0 - (beside[0] * beside[0] + beside[1] * beside[1]) * inverse;
                let here = softening * within * within;
                if within > 0.0 && here > self.softening[j][i] {
                    self.softening[j][i] = here;
                    for k in 0..2 {
                        self.softening_slopes[k][j][i] = -4.0 * softening * within * beside[k] * inverse;
                        self.softening_turns[k][j][i] = turns[k] * within * within;
                    }
                    (0..3).for_each(|k| self.edge[k][j][i] = nearest[k]);
                }
            }
        }
    }

    /// Sets a height if it is larger than the present one.
    pub fn raise(&mut self, (i, j): (usize, usize), height: f64, slopes: [f64; 2], surface_point: DVec3) {
        if height > self.height[j][i] {
            self.height[j][i] = height;
            for k in 0..2 {
                self.slopes[k][j][i] = slopes[k];
                self.by_side[k][j][i] = 0.0;
            }
            for k in 0..3 {
                self.surface_point[k][j][i] = surface_point[k];
            }
        }
    }

    /// Adds a facet whose normal is no steeper than [`LEAST_COSINE`]. `bulges` has for each edge `(k, k + 1)` how much the
    /// surface bulges over it, four times over its middle, m.
    pub fn add_facet(&mut self, frame: &GridFrame, corners: [DVec3; 3], bulges: [f64; 3]) {
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
                    height += part[k] * (corner.z + part[next] * bulges[k]);
                    for axis in 0..2 {
                        slopes[axis] += gradients[k][axis] * (corner.z + part[next] * bulges[k])
                            + part[k] * gradients[next][axis] * bulges[k];
                    }
                }
                self.raise((i, j), height, slopes, DVec3::new(u, v, height));
            }
        }
    }

    /// Replaces heights by their means over the cells at an edge between two facets. The facets have the given normals,
    /// and both have heights.
    pub fn smooth_edge(&mut self, frame: &GridFrame, edge: [DVec3; 2], normals: [DVec3; 2]) {
        if let Some(crease) = Crease::new(frame, edge, normals.map(Some)) {
            self.smooth_crease(frame, &crease, false);
        }
    }

    /// Adds the slope beyond an edge of a facet where the surface is steeper than heights may be, with means over the cells at the
    /// edge. The facet has a normal if it is not too steep itself.
    pub fn add_edge(&mut self, frame: &GridFrame, edge: [DVec3; 2], normal: Option<DVec3>) {
        if let Some(crease) = Crease::new(frame, edge, [normal, None]) {
            self.smooth_crease(frame, &crease, true);
        }
    }

    fn smooth_crease(&mut self, frame: &GridFrame, crease: &Crease, falls: bool) {
        let (from, to) = (crease.from, crease.from + crease.along);
        let fall = if falls { ((from.z.max(to.z) - frame.lowest) / STEEPEST).max(0.0) } else { 0.0 };
        let squared = crease.along.truncate().length_squared().max(f64::MIN_POSITIVE);
        let [columns, rows] = frame.range([from, to, to], crease.width.max(fall));
        for j in rows {
            for i in columns.clone() {
                let [u, v] = frame.middle(i, j);
                let offset = DVec3::new(u, v, 0.0) - from;
                let part = offset.truncate().dot(crease.along.truncate()) / squared;
                let surface_point = from + crease.along * part.clamp(0.0, 1.0);
                let beside = DVec3::new(u - surface_point.x, v - surface_point.y, 0.0).truncate();
                let out = beside.x * crease.across[0] + beside.y * crease.across[1];
                let passes = (0.0..1.0).contains(&part);
                if falls && out >= 0.0 && (passes || out > 0.0) {
                    // Around the ends of an edge the height decreases in all directions.
                    let distance = beside.length();
                    let away = if distance > 0.0 { (beside / distance).to_array() } else { crease.across };
                    let (lower, steeper, by_side) = crease.mean_drop(distance);
                    let slopes = away.map(|away| -(STEEPEST + steeper) * away);
                    let height = surface_point.z - STEEPEST * distance - lower;
                    if height > self.height[j][i] {
                        self.raise((i, j), height, slopes, surface_point);
                        (0..2).for_each(|k| self.by_side[k][j][i] = -by_side[k]);
                    }
                } else if passes {
                    self.lower((i, j), crease, surface_point.z, out);
                }
            }
        }
    }

    /// Lowers the height of a facet at a crease to its mean over the cell.
    fn lower(&mut self, (i, j): (usize, usize), crease: &Crease, edge: f64, out: f64) {
        let expected = edge + out * crease.slopes[usize::from(out > 0.0)];
        if out.abs() >= crease.width || (self.height[j][i] - expected).abs() > crease.width {
            return;
        }
        let (lower, steeper, by_side) = crease.mean_drop(out);
        self.height[j][i] -= lower;
        self.surface_point[2][j][i] -= lower;
        for k in 0..2 {
            self.slopes[k][j][i] -= steeper * crease.across[k];
            self.by_side[k][j][i] -= by_side[k];
        }
    }
}

impl Crease {
    /// Between two facets with these normals; one without a normal has the largest slope.
    fn new(frame: &GridFrame, [from, to]: [DVec3; 2], [first, second]: [Option<DVec3>; 2]) -> Option<Self> {
        let (from, to) = (frame.coordinates(from), frame.coordinates(to));
        let along = to - from;
        // Facets lie to the left of their edges.
        let across = glam::DVec2::new(along.y, -along.x).try_normalize()?;
        let slope = |normal: DVec3| {
            let normal = frame.axes.transpose() * normal;
            -(normal.x * across.x + normal.y * across.y) / normal.z
        };
        let slopes = [first.map_or(STEEPEST, slope), second.map_or(-STEEPEST, slope)];
        let by_side = [0.5 * across.x.abs(), 0.5 * across.y.abs()];
        let width = by_side[0] * frame.sides[0] + by_side[1] * frame.sides[1];
        Some(Self { from, along, across: across.to_array(), slopes, width, by_side })
    }

    /// Difference of the height in the middle of a cell, at a distance from the edge, and of its mean; and the derivatives by that
    /// distance and by the sides of a cell.
    fn mean_drop(&self, out: f64) -> (f64, f64, [f64; 2]) {
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
            // Negative numbers and NaN become zero.
            let first = cell(low).ceil().min(self.count as f64) as usize;
            let end = (cell(high).floor() + 1.0).min(self.count as f64) as usize;
            first..end
        })
    }
}
