//! A closed surface by its signed distance on a grid.
//!
//! Distances are exact at the grid's nodes (parry's closest point and pseudo-normals) and interpolated by splines, which round edges
//! by about a grid cell. The directions in which a contact over a body's edge may face are those of a coarser grid, which rounds
//! the tool's own edges by about half its thickness.

use std::collections::HashMap;

use glam::{DMat3, DVec3};
use parry3d_f64::query::PointQueryWithLocation;
use parry3d_f64::shape::{TriMesh, TriMeshFlags};

use super::LineEntry;
use super::spline::{Grid, Spline};
use crate::math::sincos;
use crate::tensor::across;
use crate::{Error, Result};

/// Grid cells along the longest side of the surface.
const CELLS_ALONG_LONGEST: f64 = 48.0;
/// Edge of a cell of the coarser grid, over the radius of the largest ball inside.
const ROUNDED_CELL: f64 = 0.35;
/// Least slope of the coarser distance with a direction: where two sides are as near it has none.
const LEAST_SLOPE: f64 = 0.1;
/// Directions whose farthest vertices are stored.
const SUPPORT_DIRECTIONS: usize = 256;
/// How far the splines may bulge out of a surface, in grid cells.
const OVERSHOOT: f64 = 0.05;
/// Steps along a line until it enters; a line that grazes the surface for longer is taken as passing by.
const MAX_LINE_STEPS: usize = 32;
/// Newton's step along a line, over the size of the surface, that is the last one.
const LAST_STEP: f64 = 1e-6;
/// Fewest triangles that close a surface.
const LEAST_TRIANGLES: usize = 4;

/// A closed surface in a tool's own frame.
#[derive(Clone)]
pub struct SurfaceShape {
    /// Signed distance, m.
    distance: Spline,
    /// The same with all edges rounded.
    rounded: Spline,
    /// Half its width where it is narrowest along an axis, m.
    pub(super) thickness: f64,
    /// Radius of the largest ball inside, m.
    pub(super) inner_radius: f64,
    /// Vertices that reach farthest in some direction, m.
    extreme_points: Vec<DVec3>,
    /// No point of the surface lies farther outside of their hull, m.
    hull_margin: f64,
    /// Middle of its bounding box, and distance of the farthest vertex from there, m.
    pub(super) centre: DVec3,
    pub(super) bounding_radius: f64,
    /// Principal axis of the largest moment of the surface.
    pub(super) long_axis: DVec3,
}

impl std::fmt::Debug for SurfaceShape {
    /// Without its thousands of numbers.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SurfaceShape").field("spacing", &self.distance.grid.spacing).finish_non_exhaustive()
    }
}

impl SurfaceShape {
    /// From vertices (m) and triangles; they may be turned inwards or outwards.
    ///
    /// # Errors
    /// A surface that is open, turned both ways, flat, has fewer than four triangles, names missing vertices or has
    /// coordinates that are not finite.
    pub fn new(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Result<Self> {
        let triangles = checked(vertices, triangles)?;
        let mesh = TriMesh::with_flags(vertices.to_vec(), triangles.clone(), TriMeshFlags::ORIENTED)
            .map_err(|e| Error::Invalid(format!("the tool's surface cannot be searched: {e}")))?;
        let used = || triangles.iter().flatten().map(|&v| vertices[v as usize]);
        let (low, high) =
            used().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        let spacing = (high - low).max_element() / CELLS_ALONG_LONGEST;
        let distance_to = |point| signed_distance(&mesh, point);
        let grid = Grid::around([low, high], spacing);
        let distances = grid.values(distance_to);
        let inner_radius = -distances.iter().copied().fold(0.0, f64::min);
        let coarser = Grid::around([low, high], spacing.max(ROUNDED_CELL * inner_radius));
        let rounded = coarser.values(distance_to);
        let centre = 0.5 * (low + high);
        let extreme_points = extreme_points(used);
        Ok(Self {
            hull_margin: hull_margin(used, &extreme_points) + OVERSHOOT * spacing,
            distance: Spline::through(grid, &distances),
            rounded: Spline::past(coarser, &rounded),
            thickness: 0.5 * (high - low).min_element(),
            inner_radius,
            extreme_points,
            centre,
            bounding_radius: used().map(|v| v.distance(centre)).fold(0.0, f64::max),
            long_axis: long_axis(vertices, &triangles),
        })
    }

    /// Interpolated distance and its gradient; beyond the grid, the distance of the grid is added.
    pub(super) fn signed_distance(&self, point: DVec3) -> (f64, DVec3) {
        let inside = self.distance.grid.nearest(point);
        let (value, gradient) = self.distance.at(inside);
        let beyond = point - inside;
        let Some(direction) = beyond.try_normalize() else { return (value, gradient) };
        // The nearest point of the grid moves along only those axes on which the point is within it.
        let along_side = DVec3::select(beyond.cmpeq(DVec3::ZERO), gradient, DVec3::ZERO);
        (value + beyond.length(), along_side + direction)
    }

    /// Direction in which the rounded distance grows, and its slope there; beyond the grid those at its nearest point.
    pub(super) fn rounded_direction(&self, point: DVec3) -> (DVec3, f64) {
        let (_, gradient) = self.rounded.at(self.rounded.grid.nearest(point));
        let slope = gradient.length().max(LEAST_SLOPE);
        (gradient / slope, slope)
    }

    /// The direction, and its derivative by the point, 1/m: with the slope `s`, the direction `g` and the projection `P` across it,
    /// `P H/s`, where `H` is the second derivative of the distance.
    pub(super) fn rounded_gradient(&self, point: DVec3) -> (DVec3, DMat3) {
        let (direction, slope) = self.rounded_direction(point);
        let inside = self.rounded.grid.nearest(point);
        // Along axes on which the point is beyond the grid the nearest one stays.
        let moves = DMat3::from_diagonal(DVec3::select(point.cmpeq(inside), DVec3::ONE, DVec3::ZERO));
        (direction, across(direction) * self.rounded.second_derivative(inside) * moves * (1.0 / slope))
    }

    /// Farthest of the stored vertices, moved outwards by the largest distance of the others from their hull: no point of the
    /// surface reaches a plane that this point does not reach.
    pub(super) fn support(&self, direction: DVec3) -> DVec3 {
        let mut farthest = (f64::NEG_INFINITY, DVec3::ZERO);
        for &point in &self.extreme_points {
            let reach = point.dot(direction);
            if reach > farthest.0 {
                farthest = (reach, point);
            }
        }
        farthest.1 + self.hull_margin * direction.normalize_or_zero()
    }

    /// Where a line from an origin outside enters: by the distance itself as long as it is large, for nothing lies within it,
    /// then by Newton's steps no longer than two grid cells.
    pub(super) fn line_entry(&self, origin: DVec3, direction: DVec3, reach: f64) -> Option<LineEntry> {
        // The ball that holds the surface bounds the search.
        let middle = (self.centre - origin).dot(direction);
        let squared_aside = (origin + middle * direction).distance_squared(self.centre);
        let half_chord = (self.bounding_radius * self.bounding_radius - squared_aside).max(0.0).sqrt();
        let last = reach.min(middle + half_chord);
        let mut distance = (middle - half_chord).max(0.0);
        for _ in 0..MAX_LINE_STEPS {
            if distance >= last {
                return None;
            }
            let (value, gradient) = self.signed_distance(origin + distance * direction);
            let slope = gradient.dot(direction);
            let newton = if slope < 0.0 { -value / slope } else { f64::INFINITY };
            // The next step would change the distance by the square of this one.
            if newton.abs() < LAST_STEP * self.bounding_radius {
                return Some(LineEntry { distance: distance + newton, normal: gradient.normalize_or(-direction) });
            }
            distance += newton.abs().min(2.0 * self.distance.grid.spacing).max(value.abs()).copysign(value);
        }
        None
    }
}

/// Rejects surfaces that are not closed; orients triangles outwards.
fn checked(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Result<Vec<[u32; 3]>> {
    let invalid = |message: String| Err(Error::Invalid(message));
    if triangles.len() < LEAST_TRIANGLES {
        return invalid(format!("the tool's surface has {} triangles: four at least close it", triangles.len()));
    }
    if let Some(v) = vertices.iter().position(|v| !v.is_finite()) {
        return invalid(format!("vertex {v} of the tool's surface is not finite"));
    }
    if let Some(t) = triangles.iter().position(|t| t.iter().any(|&v| v as usize >= vertices.len())) {
        return invalid(format!("triangle {t} of the tool's surface names a vertex that does not exist"));
    }
    let mut sides: HashMap<(u32, u32), [usize; 2]> = HashMap::new();
    for t in triangles {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            sides.entry((a.min(b), a.max(b))).or_default()[usize::from(a > b)] += 1;
        }
    }
    let open = sides.values().filter(|[there, back]| there + back == 1).count();
    if open > 0 {
        return invalid(format!(
            "the tool's surface is open: {open} of its edges belong to one triangle only; close it, and merge equal vertices"
        ));
    }
    let crossed = sides.values().filter(|&&sides| sides != [1, 1]).count();
    if crossed > 0 {
        return invalid(format!(
            "the tool's surface is not the skin of one solid: at {crossed} of its edges triangles are turned against each \
             other or more than two meet"
        ));
    }
    let six_volumes: f64 =
        triangles.iter().map(|t| t.map(|v| vertices[v as usize])).map(|[a, b, c]| a.dot(b.cross(c))).sum();
    let extent = vertices.iter().map(|v| v.distance(vertices[0])).fold(0.0, f64::max);
    if six_volumes.abs() <= 1e-9 * extent.powi(3) {
        return invalid("the tool's surface holds no volume".into());
    }
    Ok(match six_volumes > 0.0 {
        true => triangles.to_vec(),
        false => triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(),
    })
}

/// Distance of a point, m, negative inside.
fn signed_distance(mesh: &TriMesh, point: DVec3) -> f64 {
    let (projection, _) = mesh.project_local_point_and_get_location(point, false);
    let distance = projection.point.distance(point);
    if projection.is_inside { -distance } else { distance }
}

/// Directions spread evenly over a sphere, along a spiral of the golden angle.
fn spiral(count: usize) -> impl Iterator<Item = DVec3> {
    let golden_angle = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..count).map(move |k| {
        let z = 1.0 - (2 * k + 1) as f64 / count as f64;
        let (sin, cos) = sincos(golden_angle * k as f64);
        ((1.0 - z * z).sqrt() * DVec3::new(cos, sin, 0.0)).with_z(z)
    })
}

/// Vertices that reach farthest in some directions.
fn extreme_points<I: Iterator<Item = DVec3>>(vertices: impl Fn() -> I) -> Vec<DVec3> {
    let mut points: Vec<DVec3> = Vec::new();
    for direction in spiral(SUPPORT_DIRECTIONS) {
        let farther = |a: DVec3, b: DVec3| if b.dot(direction) > a.dot(direction) { b } else { a };
        if let Some(point) = vertices().reduce(farther)
            && !points.contains(&point)
        {
            points.push(point);
        }
    }
    points
}

/// Largest distance by which other vertices reach beyond the stored ones, in directions between those stored.
fn hull_margin<I: Iterator<Item = DVec3>>(vertices: impl Fn() -> I, stored: &[DVec3]) -> f64 {
    let reach = |points: &mut dyn Iterator<Item = DVec3>, direction: DVec3| {
        points.map(|p| p.dot(direction)).fold(f64::NEG_INFINITY, f64::max)
    };
    let beyond = |d| reach(&mut vertices(), d) - reach(&mut stored.iter().copied(), d);
    spiral(4 * SUPPORT_DIRECTIONS + 1).map(beyond).fold(0.0, f64::max)
}

/// Axis of the largest second moment of the surface about its middle, by powers of the matrix of moments.
fn long_axis(vertices: &[DVec3], triangles: &[[u32; 3]]) -> DVec3 {
    let parts = || {
        triangles.iter().map(|t| t.map(|v| vertices[v as usize])).map(|[a, b, c]| {
            let area = (b - a).cross(c - a).length();
            (area, (a + b + c) / 3.0)
        })
    };
    let area: f64 = parts().map(|(area, _)| area).sum();
    let middle = parts().map(|(area, at)| area * at).sum::<DVec3>() / area;
    let mut moments = DMat3::ZERO;
    for (part, at) in parts() {
        let r = at - middle;
        moments += DMat3::from_cols(r.x * r, r.y * r, r.z * r) * (part / area);
    }
    for _ in 0..8 {
        let largest = moments.x_axis.length().max(moments.y_axis.length()).max(moments.z_axis.length());
        moments *= 1.0 / largest;
        moments = moments * moments;
    }
    let columns = [moments.x_axis, moments.y_axis, moments.z_axis];
    let longest = columns.into_iter().reduce(|a, b| if b.length_squared() > a.length_squared() { b } else { a });
    longest.and_then(DVec3::try_normalize).unwrap_or(DVec3::Z)
}
