//! Sharp convex edges of a surface, near which a sphere has no closed form.
//!
//! Under a sphere on an edge or a corner the body is no half-space: half or a quarter of it is missing, and what is left is softer.
//! There its pressure is computed on cells, as that of other tools. With the distance `q` of the sphere's centre from the nearest
//! edge, over its radius, the share of cells goes from one to zero. It is a function of the sphere's position over the surface
//! at rest alone, so the mean of both energies with this weight is again one energy.

use std::collections::BTreeSet;

use glam::DVec3;

use super::SurfaceQuery;
use super::footprint::{PressedSurface, smooth_step};
use super::smooth::SmoothSurface;
use crate::memory::Ranges;
use crate::mesh::Surface;

/// Distances of the sphere's centre from an edge, over its radius, up to which its contact is all on cells, and from which it has
/// none. A shallow contact lies then 0.5 and 0.9 radii beside the edge, where a half-space is 8 and 1 % harder than the body.
const NEAR: [f64; 2] = [1.12, 1.35];
/// Edges up to this distance from a triangle, over the radius, are listed for it: the sphere's centre may lie as deep below the
/// triangle as it is far from the edge.
const LISTED: f64 = 2.0 * NEAR[1];

/// A surface with sharp convex edges, for a sphere.
pub struct EdgeSurface {
    /// The surface in pieces.
    pub pressed: PressedSurface,
    /// Both ends of each edge, m.
    edges: Vec<[DVec3; 2]>,
    /// For each drawn triangle the start of its edges in `near`; one more for the end.
    offsets: Vec<u32>,
    near: Vec<u32>,
    radius: f64,
}

impl EdgeSurface {
    /// For a sphere of `radius`, m; `None` for a surface without such edges. `pressed` makes its pieces.
    pub fn new(
        (surface, query, smooth): (&Surface, &SurfaceQuery, &SmoothSurface),
        radius: f64,
        pressed: impl FnOnce() -> PressedSurface,
    ) -> Option<Self> {
        let edges = convex_edges(surface, smooth);
        if edges.is_empty() {
            return None;
        }
        let mut lists = vec![BTreeSet::new(); surface.triangles.len()];
        for (rank, &[from, to]) in edges.iter().enumerate() {
            let reach = DVec3::splat(LISTED * radius);
            query.for_each_within(from.min(to) - reach, from.max(to) + reach, |triangle| {
                lists[triangle as usize].insert(rank as u32);
            });
        }
        let mut offsets = vec![0];
        let mut near = Vec::new();
        for list in lists {
            near.extend(list);
            offsets.push(near.len() as u32);
        }
        Some(Self { pressed: pressed(), edges, offsets, near, radius })
    }

    /// Share of cells in the contact of a sphere at a position near a triangle, and its gradient, 1/m.
    pub fn share(&self, triangle: u32, position: DVec3) -> (f64, DVec3) {
        let [from, to] = [0, 1].map(|next| self.offsets[triangle as usize + next] as usize);
        let offset = |&edge: &u32| {
            let [from, to] = self.edges[edge as usize];
            let along = to - from;
            let part = ((position - from).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            position - from - along * part
        };
        let offsets = self.near[from..to].iter().map(offset);
        let Some(nearest) = offsets.min_by(|a, b| a.length_squared().total_cmp(&b.length_squared())) else {
            return (0.0, DVec3::ZERO);
        };
        let distance = nearest.length();
        let (beyond, slope) = smooth_step(distance / self.radius, NEAR);
        (1.0 - beyond, nearest * (-slope / (self.radius * distance.max(f64::MIN_POSITIVE))))
    }

    /// Adds the memory that a tick reads.
    pub(crate) fn add_memory(&self, ranges: &mut Ranges) {
        self.pressed.add_memory(ranges);
        ranges.add(&self.edges);
        ranges.add(&self.offsets);
        ranges.add(&self.near);
    }
}

/// Both ends of each crease whose faces turn away from each other.
fn convex_edges(surface: &Surface, smooth: &SmoothSurface) -> Vec<[DVec3; 2]> {
    let mut edges = Vec::new();
    for (t, across) in surface.neighbours.iter().enumerate() {
        let corners = surface.corners(t as u32);
        let creases = smooth.creases_of(t as u32);
        for k in (0..3).filter(|&k| creases[k] && across[k] != u32::MAX && across[k] as usize > t) {
            let (from, to) = (corners[k], corners[(k + 1) % 3]);
            let [first, second] = [t, across[k] as usize].map(|t| surface.normals[t]);
            if first.cross(second).dot(to - from) > 0.0 {
                edges.push([from, to]);
            }
        }
    }
    edges
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::smooth::tests::{ball, cube};

    fn of(surface: &Surface, radius: f64) -> Option<EdgeSurface> {
        let query = SurfaceQuery::new(surface).expect("triangles");
        let smooth = SmoothSurface::new(surface);
        let fields = vec![Default::default(); smooth.fans().len()];
        EdgeSurface::new((surface, &query, &smooth), radius, || {
            PressedSurface::new(surface, &query, &smooth, &fields, radius)
        })
    }

    #[test]
    fn a_ball_has_no_edges_and_a_cube_has_twelve() {
        assert!(of(&ball(24), 0.1).is_none());
        assert_eq!(of(&cube(), 0.1).expect("edges").edges.len(), 12);
    }

    #[test]
    fn the_share_is_one_on_an_edge_and_falls_off_beside_it_with_its_gradient() {
        let (surface, radius) = (cube(), 0.1);
        let edges = of(&surface, radius).expect("edges");
        let query = SurfaceQuery::new(&surface).expect("triangles");
        let share = |x: f64| {
            let position = DVec3::new(x, 0.5, 1.0 + 0.9 * radius);
            let triangle = query.closest(&surface, position).expect("a point").triangle;
            edges.share(triangle, position)
        };
        assert_eq!(share(1.0), (1.0, DVec3::ZERO));
        assert_eq!(share(0.5), (0.0, DVec3::ZERO));
        let mut before = 0.0;
        for k in 0..40 {
            let x = 0.84 + 0.004 * f64::from(k);
            let (part, slope) = share(x);
            let difference = (share(x + 1e-7).0 - share(x - 1e-7).0) / 2e-7;
            assert!((slope.x - difference).abs() < 1e-5 / radius, "{x} {slope} {difference}");
            assert!(part >= before, "{x}");
            before = part;
        }
    }
}
