//! The closest point of the smooth surface (foot), followed from its previous position.
//!
//! `p = x + s n(x)` with `f(x) = 0` is solved by Newton's method: along the normal by `f`, along the surface by its
//! curvature `S`, for a step `dx` turns the normal by `S dx`. The distance `s` has the gradient `n` and the Hessian
//! `S (I + s S)^-1`, exactly.

use glam::{DMat3, DVec3};

use super::SmoothSurface;
use super::blend::Blending;
use super::neighbourhood::Neighbourhood;
use crate::contact::{SurfacePoint, SurfaceQuery};
use crate::mesh::Surface;
use crate::tensor::{across, outer};

/// Newton steps at most; three or four are usual.
const STEPS: usize = 12;
/// Length of the last step, over the spacing of the nodes: within it the surface is its own quadric up to rounding.
const SETTLED: f64 = 1e-5;
/// Triangles crossed within a step at most.
const CROSSINGS: usize = 16;
/// Least `1 + s kappa`: near the centre of curvature the closest point is not unique.
const LEAST_STRETCH: f64 = 0.1;
/// Barycentric coordinate below which a point lies on an edge of its triangle.
const ON_EDGE: f64 = 1e-9;

/// The drawn surface below a smooth one.
#[derive(Clone, Copy)]
pub struct DrawnSurface<'a> {
    /// Its triangles.
    pub surface: &'a Surface,
    /// Closest-point search on them.
    pub query: &'a SurfaceQuery,
}

/// A point of the surface closest to a point `p` near it.
#[derive(Clone, Copy, Debug, Default)]
pub struct FootPoint {
    /// The drawn triangle below or above it.
    pub triangle: u32,
    /// Its position, m.
    pub position: DVec3,
    /// Unit outward normal, towards `p` from outside.
    pub normal: DVec3,
    /// Distance of `p`, m; negative inside.
    pub distance: f64,
    /// `dn/dp`, symmetric, 1/m.
    pub turning: DMat3,
    /// `dx/dp`, symmetric.
    pub shift: DMat3,
    /// Whether it lies on a crease.
    pub on_crease: bool,
}

impl FootPoint {
    /// A foot that does not move with `p`.
    pub fn at(position: DVec3, normal: DVec3) -> Self {
        Self { position, normal, turning: DMat3::ZERO, shift: DMat3::ZERO, ..Self::default() }
    }

    /// The same foot for another point `p`: the surface is replaced by its plane, and the foot is fixed in it.
    pub fn frozen(&self, p: DVec3) -> Self {
        let distance = (p - self.position).dot(self.normal);
        Self { distance, turning: DMat3::ZERO, shift: DMat3::ZERO, ..*self }
    }

    /// The point `p`.
    fn query_point(&self) -> DVec3 {
        self.position + self.normal * self.distance
    }
}

impl SmoothSurface {
    /// The foot of `p`, followed from that of a point near it. `None` for a point that is not finite.
    pub fn foot(
        &self,
        drawn: DrawnSurface<'_>,
        p: DVec3,
        from: &FootPoint,
        near: &mut Neighbourhood,
    ) -> Option<FootPoint> {
        let start = from.position + from.shift * (p - from.query_point());
        let triangle = self.triangle_below(drawn.surface, from.triangle, start);
        let followed = triangle.and_then(|triangle| self.follow(drawn.surface, p, (triangle, start), near));
        followed.or_else(|| self.foot_anywhere(drawn, p, near))
    }

    /// The foot of `p` from wherever the drawn surface is closest.
    pub fn foot_anywhere(&self, drawn: DrawnSurface<'_>, p: DVec3, near: &mut Neighbourhood) -> Option<FootPoint> {
        let closest = drawn.query.closest(drawn.surface, p)?;
        Some(self.foot_from(drawn, p, &closest, near))
    }

    /// The foot of `p` from the closest point of the drawn surface.
    pub fn foot_from(
        &self,
        drawn: DrawnSurface<'_>,
        p: DVec3,
        closest: &SurfacePoint,
        near: &mut Neighbourhood,
    ) -> FootPoint {
        let start = (closest.triangle, closest.position);
        let smooth = if self.is_off_creases(closest) { self.follow(drawn.surface, p, start, near) } else { None };
        smooth.unwrap_or_else(|| on_crease(drawn.surface, closest))
    }

    /// Whether the smooth surface is surely farther than `distance`, m: no quadric deviates from the drawn triangles by as much as
    /// the reach of its fan.
    pub fn is_beyond(&self, distance: f64, closest: &SurfacePoint) -> bool {
        let first = self.reaching[self.ranges[closest.triangle as usize][0] as usize];
        closest.signed_distance > distance + self.fans[first as usize].reach
    }

    /// Whether the closest point of the drawn surface is on no crease.
    fn is_off_creases(&self, closest: &SurfacePoint) -> bool {
        let creases = &self.creases[closest.triangle as usize];
        // The edge (k, k + 1) lies opposite to the corner k + 2.
        !(0..3).any(|k| creases[k] && closest.barycentric[(k + 2) % 3] < ON_EDGE)
    }

    /// The foot on the smooth side of a triangle; `None` where that side ends.
    fn follow(
        &self,
        surface: &Surface,
        p: DVec3,
        (mut triangle, mut x): (u32, DVec3),
        near: &mut Neighbourhood,
    ) -> Option<FootPoint> {
        for step in 0..STEPS {
            near.load(self, triangle);
            let at = self.arch.dispatch(Blending { fans: near.same_side(), point: x })?;
            let size = at.gradient.length();
            let normal = at.gradient / size;
            let across = across(normal);
            let shape = across * at.hessian * across * (1.0 / size);
            let distance = (p - x).dot(normal);
            let stretch = DMat3::IDENTITY + shape * distance;
            let determinant = stretch.determinant();
            if determinant.is_nan() || determinant <= LEAST_STRETCH {
                return None;
            }
            let inverse = stretch.inverse();
            let along = p - x - normal * distance;
            let spacing = near.spacing;
            let mut dx = inverse * along - normal * (at.value / size);
            let settled = dx.length_squared() < (SETTLED * spacing).powi(2);
            if settled || step + 1 == STEPS {
                let turning = inverse * shape;
                let turning = (turning + turning.transpose()) * 0.5;
                let shift = across - turning * distance;
                let (position, normal) = (x + dx, (normal + shape * dx).normalize());
                let distance = (p - position).dot(normal);
                return Some(FootPoint { triangle, position, normal, distance, turning, shift, on_crease: false });
            }
            if dx.length() > spacing {
                dx *= spacing / dx.length();
            }
            x += dx;
            triangle = self.triangle_below(surface, triangle, x)?;
        }
        None
    }

    /// The triangle over which `x` lies, walked to from another; `None` beyond a crease.
    fn triangle_below(&self, surface: &Surface, from: u32, x: DVec3) -> Option<u32> {
        let mut triangle = from;
        for _ in 0..CROSSINGS {
            let [a, b, c] = surface.corners(triangle);
            let normal = (b - a).cross(c - a);
            let opposite = [(b - a).cross(x - a), (c - b).cross(x - b), (a - c).cross(x - c)].map(|n| n.dot(normal));
            // The edge (k, k + 1) that x lies farthest beyond, with a margin against going back and forth between two triangles.
            let beyond = -1e-9 * normal.length_squared();
            let k = (0..3).min_by(|&i, &j| opposite[i].total_cmp(&opposite[j])).unwrap_or(0);
            if opposite[k] >= beyond {
                return Some(triangle);
            }
            if self.creases[triangle as usize][k] {
                return None;
            }
            triangle = surface.neighbours[triangle as usize][k];
        }
        Some(triangle)
    }
}

/// The closest point of the drawn triangles. The normal turns with `p` about a corner, and about an edge across it only: along the
/// edge the point moves with `p`, as it does within a triangle.
fn on_crease(surface: &Surface, closest: &SurfacePoint) -> FootPoint {
    let (normal, distance) = (closest.normal, closest.signed_distance);
    let across = across(normal);
    let corners = surface.corners(closest.triangle);
    let mut beside = (0..3).filter(|&k| closest.barycentric[k] < ON_EDGE);
    let shift = match (beside.next(), beside.next()) {
        (None, _) => across,
        (Some(k), None) => {
            let edge = (corners[(k + 2) % 3] - corners[(k + 1) % 3]).normalize_or_zero();
            outer(edge, edge)
        }
        _ => DMat3::ZERO,
    };
    let turning = if distance.abs() > 1e-9 { (across - shift) * (1.0 / distance) } else { DMat3::ZERO };
    FootPoint {
        triangle: closest.triangle,
        position: closest.position,
        normal,
        distance,
        turning,
        shift,
        on_crease: true,
    }
}
