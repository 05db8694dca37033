//! A closed surface by its signed distance on a grid.
//!
//! Distances are exact at the grid's nodes (parry's closest point and pseudo-normals) and interpolated by quadratic
//! B-splines: the gradient is continuous, so that forces are, and edges are rounded by about a grid cell. Linear interpolation
//! would make every grid plane a crease; cubic splines take 64 coefficients in place of 27.

use std::collections::HashMap;

use glam::{DMat3, DVec3};
use parry3d_f64::query::PointQueryWithLocation;
use parry3d_f64::shape::{TriMesh, TriMeshFlags};

use super::LineEntry;
use crate::math::sincos;
use crate::{Error, Result};

/// Grid cells along the longest side of the surface.
const CELLS_ALONG_LONGEST: f64 = 48.0;
/// Grid cells around the surface on every side: the spline needs one, a line that passes by another.
const MARGIN: f64 = 2.0;
/// Sweeps that make the spline pass through the distances at the nodes; each leaves a quarter of the error at worst.
const PREFILTER_SWEEPS: usize = 12;
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
    /// Position of the first node, m.
    corner: DVec3,
    /// Edge of a grid cell, m.
    spacing: f64,
    nodes: [usize; 3],
    /// Coefficients of the splines, m; x runs fastest.
    coefficients: Vec<f32>,
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
        let nodes = &self.nodes;
        f.debug_struct("SurfaceShape").field("spacing", &self.spacing).field("nodes", nodes).finish_non_exhaustive()
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
        let nodes = ((high - low) / spacing).to_array().map(|cells| (cells + 2.0 * MARGIN).ceil() as usize + 1);
        let corner = low - DVec3::splat(MARGIN * spacing);
        let centre = 0.5 * (low + high);
        let extreme_points = extreme_points(used);
        Ok(Self {
            hull_margin: hull_margin(used, &extreme_points) + OVERSHOOT * spacing,
            corner,
            spacing,
            nodes,
            coefficients: prefiltered(&distances(&mesh, corner, spacing, nodes), nodes),
            extreme_points,
            centre,
            bounding_radius: used().map(|v| v.distance(centre)).fold(0.0, f64::max),
            long_axis: long_axis(vertices, &triangles),
        })
    }

    /// Interpolated distance and the direction of its gradient; beyond the grid, the distance of the grid is added.
    pub(super) fn signed_distance(&self, point: DVec3) -> (f64, DVec3) {
        let far = self.corner + self.spacing * DVec3::from_array(self.nodes.map(|n| (n - 1) as f64));
        let inside = point.clamp(self.corner, far);
        let (value, gradient) = self.interpolate(inside);
        let beyond = point - inside;
        match beyond.try_normalize() {
            Some(direction) => (value + beyond.length(), direction),
            None => (value, gradient.try_normalize().unwrap_or(DVec3::NEG_Z)),
        }
    }

    /// Value and gradient of the spline at a point of the grid.
    fn interpolate(&self, point: DVec3) -> (f64, DVec3) {
        let place = ((point - self.corner) / self.spacing).to_array();
        let mut first = [0; 3];
        let mut weights = [[[0.0; 3]; 2]; 3];
        for axis in 0..3 {
            let middle = place[axis].round().clamp(1.0, (self.nodes[axis] - 2) as f64);
            let f = place[axis] - middle;
            first[axis] = middle as usize - 1;
            weights[axis] = [
                [0.5 * (0.5 - f) * (0.5 - f), 0.75 - f * f, 0.5 * (0.5 + f) * (0.5 + f)],
                [f - 0.5, -2.0 * f, f + 0.5],
            ];
        }
        let [[wx, gx], [wy, gy], [wz, gz]] = weights;
        let (mut value, mut gradient) = (0.0, DVec3::ZERO);
        for k in 0..3 {
            let (mut plane, mut plane_x, mut plane_y) = (0.0, 0.0, 0.0);
            for j in 0..3 {
                let at = first[0] + self.nodes[0] * (first[1] + j + self.nodes[1] * (first[2] + k));
                let Some(&[a, b, c]) = self.coefficients[at..].first_chunk::<3>() else { continue };
                let row = [f64::from(a), f64::from(b), f64::from(c)];
                let along = row[0] * wx[0] + row[1] * wx[1] + row[2] * wx[2];
                plane += wy[j] * along;
                plane_y += gy[j] * along;
                plane_x += wy[j] * (row[0] * gx[0] + row[1] * gx[1] + row[2] * gx[2]);
            }
            value += wz[k] * plane;
            gradient += DVec3::new(wz[k] * plane_x, wz[k] * plane_y, gz[k] * plane);
        }
        (value, gradient / self.spacing)
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
                return Some(LineEntry { distance: distance + newton, normal: gradient });
            }
            distance += newton.abs().min(2.0 * self.spacing).max(value.abs()).copysign(value);
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

/// Distances of all nodes, negative inside.
fn distances(mesh: &TriMesh, corner: DVec3, spacing: f64, [nx, ny, nz]: [usize; 3]) -> Vec<f64> {
    let mut distances = Vec::with_capacity(nx * ny * nz);
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let point = corner + spacing * DVec3::new(i as f64, j as f64, k as f64);
                let (projection, _) = mesh.project_local_point_and_get_location(point, false);
                let distance = projection.point.distance(point);
                distances.push(if projection.is_inside { -distance } else { distance });
            }
        }
    }
    distances
}

/// Coefficients of the quadratic spline through given values. Along an axis the spline is `c + (c_- - 2 c + c_+)/8` at a node,
/// which is solved by sweeps of `c = value - (c_- - 2 c + c_+)/8`; the outermost nodes keep their values.
fn prefiltered(values: &[f64], nodes: [usize; 3]) -> Vec<f32> {
    let mut solved = values.to_vec();
    let strides = [1, nodes[0], nodes[0] * nodes[1]];
    for axis in 0..3 {
        let (right, stride) = (solved.clone(), strides[axis]);
        let mut next = solved.clone();
        for _ in 0..PREFILTER_SWEEPS {
            for at in 0..solved.len() {
                let place = at / stride % nodes[axis];
                if place > 0 && place + 1 < nodes[axis] {
                    // Solved for the diagonal, 3/4.
                    next[at] = (right[at] - (solved[at - stride] + solved[at + stride]) / 8.0) / 0.75;
                }
            }
            std::mem::swap(&mut solved, &mut next);
        }
    }
    solved.into_iter().map(|c| c as f32).collect()
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
