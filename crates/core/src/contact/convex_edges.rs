//! Sharp convex edges of a surface, over which the compliance below a sphere goes on without a kink.
//!
//! The closest point `x(p)` of a sphere's centre stops at a sharp edge, and with it the compliance `C(x)`: its gradient across the
//! edge, which inclines the force, would end at once where the centre passes the plane through the edge along the face's normal.
//! So the compliance is taken at a point that slows down before the edge. With `s`, m, the distance of the closest point from the
//! edge within its face, or less the distance by which the centre has passed that plane, and the unit vector `n` into the face,
//!
//! ```text
//! x~ = x + delta(s) n        delta = (w - |s|)^2 / (4 w)   for |s| < w
//! ```
//!
//! has a continuous derivative by `p`.

use std::collections::BTreeSet;

use glam::{DMat3, DVec3};

use super::SurfaceQuery;
use super::smooth::{FootPoint, SmoothSurface};
use crate::memory::Ranges;
use crate::mesh::Surface;
use crate::tensor::outer;

/// A sharp convex edge.
#[derive(Clone, Copy, Debug)]
struct Edge {
    ends: [DVec3; 2],
    /// Unit vectors from the edge into both faces, and these faces' normals.
    into: [DVec3; 2],
    normals: [DVec3; 2],
}

/// Sharp convex edges of a surface, for a sphere.
pub struct ConvexEdges {
    edges: Vec<Edge>,
    /// For each drawn triangle the start of its edges in `near`; one more for the end.
    offsets: Vec<u32>,
    near: Vec<u32>,
    /// `w`, m.
    width: f64,
    radius: f64,
    par: [f64; 6],
}

/// A point at which the compliance is taken, and how its derivative turns with the sphere's centre across the edge.
pub struct SmoothedFoot {
    pub foot: FootPoint,
    /// For both faces the unit vector into them, and the second derivative along it, 1/m.
    pub bends: [(DVec3, f64); 2],
    /// Share
    pub rho: (f64, DVec3, DMat3),
}

impl ConvexEdges {
    /// For a sphere of `radius`, m; `None` for a surface without such edges.
    pub fn new((surface, query, smooth): (&Surface, &SurfaceQuery, &SmoothSurface), radius: f64) -> Option<Self> {
        let share: f64 = std::env::var("PW").ok().and_then(|v| v.parse().ok()).unwrap_or(0.3);
        let width = share * radius;
        let par: Vec<f64> = std::env::var("RHO").unwrap_or("0.3,-0.5,0.667,0,0,0".into()).split(',').map(|v| v.parse().unwrap()).collect();
        let par: [f64; 6] = par.try_into().unwrap();
        if width == 0.0 && par[0] == 1.0 { return None; }
        let edges = convex_edges(surface, smooth);
        if edges.is_empty() {
            return None;
        }
        let mut lists = vec![BTreeSet::new(); surface.triangles.len()];
        let reach = DVec3::splat(2.0 * radius);
        for (rank, edge) in edges.iter().enumerate() {
            let [a, b] = edge.ends;
            query.for_each_within(a.min(b) - reach, a.max(b) + reach, |triangle| {
                lists[triangle as usize].insert(rank as u32);
            });
        }
        let mut offsets = vec![0];
        let mut near = Vec::new();
        for list in lists {
            near.extend(list);
            offsets.push(near.len() as u32);
        }
        Some(Self { edges, offsets, near, width, radius, par })
    }

    fn nearest(&self, triangle: u32, position: DVec3) -> Option<(&Edge, f64)> {
        let [from, to] = [0, 1].map(|next| self.offsets[triangle as usize + next] as usize);
        let edges = self.near[from..to].iter().map(|&edge| &self.edges[edge as usize]);
        edges
            .map(|edge| {
                let (a, along) = (edge.ends[0], edge.ends[1] - edge.ends[0]);
                let t = ((position - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
                (edge, position.distance_squared(a + along * t))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Whether two feet lie beside the same edge.
    pub fn share_an_edge(&self, one: &FootPoint, other: &FootPoint) -> bool {
        let near = |foot: &FootPoint| self.nearest(foot.triangle, foot.position).filter(|(_, squared)| *squared < self.radius * self.radius);
        let (Some((one, _)), Some((other, _))) = (near(one), near(other)) else { return false };
        one.ends.iter().any(|end| other.ends.contains(end))
    }

    /// Of a foot.
    pub fn smoothed(&self, foot: &FootPoint, place: DVec3) -> Option<SmoothedFoot> {
        let [from, to] = [0, 1].map(|next| self.offsets[foot.triangle as usize + next] as usize);
        let edges = self.near[from..to].iter().map(|&edge| &self.edges[edge as usize]);
        let squared = |edge: &Edge| {
            let (a, along) = (edge.ends[0], edge.ends[1] - edge.ends[0]);
            let t = ((foot.position - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
            foot.position.distance_squared(a + along * t)
        };
        let edge = edges.min_by(|a, b| squared(a).total_cmp(&squared(b)))?;
        let along = (edge.ends[1] - edge.ends[0]).normalize_or_zero();
        let mut smoothed = SmoothedFoot { rho: (1.0, DVec3::ZERO, DMat3::ZERO), foot: *foot, bends: [(DVec3::ZERO, 0.0); 2] };
        let from_edge = |at: DVec3| { let o = at - edge.ends[0]; o - along * along.dot(o) };
        let w = self.width;
        let own = usize::from(foot.normal.dot(edge.normals[1]) > foot.normal.dot(edge.normals[0]));
        // (value of s, its gradient) for both faces.
        let mut s = [0.0; 2];
        let mut slopes = [DVec3::ZERO; 2];
        for k in 0..2 {
            (s[k], slopes[k]) = if foot.on_crease || k != own {
                (from_edge(place).dot(edge.into[k]), edge.into[k])
            } else {
                (from_edge(foot.position).dot(edge.into[k]), foot.shift * edge.into[k])
            };
        }
        // The other face's part ends away from the edge.
        let (fade, fade_slope) = if foot.on_crease { (1.0, 0.0) } else {
            let t = (s[own] / w).clamp(0.0, 1.0);
            (1.0 - t * t * (3.0 - 2.0 * t), -6.0 * t * (1.0 - t) / w)
        };
        let mut any = false;
        let [least, from, to, ..] = self.par;
        let r = self.radius;
        let g = |s: f64| {
            let width = (to - from) * r;
            let t = (s - from * r) / width;
            let size = 1.0 - least;
            if t <= 0.0 { (least, 0.0, 0.0) } else if t >= 1.0 { (1.0, 0.0, 0.0) } else { (least + size * t * t * (3.0 - 2.0 * t), size * 6.0 * t * (1.0 - t) / width, size * (6.0 - 12.0 * t) / (width * width)) }
        };
        let (at, at_slope, at_hessian) = if foot.on_crease && s[0] < 0.0 && s[1] < 0.0 {
            let [x, y] = s;
            let h = x.hypot(y);
            let (h3, h5) = (h.powi(3), h.powi(5));
            let [n, m] = slopes;
            let hessian = outer(n, n) * (3.0 * y.powi(3) * x / h5) + outer(m, m) * (3.0 * x.powi(3) * y / h5) - (outer(n, m) + outer(m, n)) * (3.0 * x * x * y * y / h5);
            (-x * y / h, n * (-y.powi(3) / h3) + m * (-x.powi(3) / h3), hessian)
        } else {
            (s[own], slopes[own], DMat3::ZERO)
        };
        let (value, by, bend) = g(at);
        let gradient = at_slope * by;
        let hessian = outer(at_slope, at_slope) * bend + at_hessian * by;
        smoothed.rho = (value, gradient, hessian);
        if value != 1.0 { any = true; }
        for k in 0..2 {
            if s[k].abs() >= w || w == 0.0 { continue; }
            let left = w - s[k].abs();
            let (delta, first, second) = (left * left / (4.0 * w), -s[k].signum() * left / (2.0 * w), 0.5 / w);
            let n = edge.into[k];
            if k == own || foot.on_crease {
                smoothed.foot.position += n * delta;
                smoothed.foot.shift += outer(n, slopes[k]) * first;
                smoothed.bends[k] = (n, second);
                any = true;
            } else if fade > 0.0 {
                smoothed.foot.position += n * (delta * fade);
                smoothed.foot.shift += outer(n, slopes[k]) * (first * fade) + outer(n, slopes[own]) * (delta * fade_slope);
                any = true;
            }
        }
        any.then_some(smoothed)
    }

    /// Adds the memory that a tick reads.
    pub(crate) fn add_memory(&self, ranges: &mut Ranges) {
        ranges.add(&self.edges);
        ranges.add(&self.offsets);
        ranges.add(&self.near);
    }
}

/// Creases whose faces turn away from each other.
fn convex_edges(surface: &Surface, smooth: &SmoothSurface) -> Vec<Edge> {
    let mut edges = Vec::new();
    for (t, across) in surface.neighbours.iter().enumerate() {
        let ends = surface.corners(t as u32);
        let creases = smooth.creases_of(t as u32);
        for k in (0..3).filter(|&k| creases[k] && across[k] != u32::MAX && across[k] as usize > t) {
            let (a, b) = (ends[k], ends[(k + 1) % 3]);
            let normals = [t, across[k] as usize].map(|t| surface.normals[t]);
            let along = (b - a).normalize_or_zero();
            if normals[0].cross(normals[1]).dot(b - a) > 0.0 {
                let into = [normals[0].cross(along), along.cross(normals[1])];
                edges.push(Edge { ends: [a, b], into, normals });
            }
        }
    }
    edges
}
#[allow(unused)]
fn unused(_: DMat3) {}
