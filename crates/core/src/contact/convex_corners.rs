//! Sharp convex corners of a surface, deep in which a sphere has no closed form.
//!
//! A sphere that is pressed into a corner by more than half of its radius lies beside it as much as on it. There its pressure is
//! computed on cells, as that of other tools. With the distance `q` of the sphere's centre from the nearest corner, over its radius,
//! the share of cells goes from one to zero. It is a function of the sphere's position over the surface at rest alone, so the mean of
//! both energies with this weight is again one energy.
//!
//! Elsewhere a sphere has the closed form (`convex_edges`, `corner_share`): on cells its force on a block's corner is 20 to 40 % too
//! small, and closed paths around it lose 2 % of the energy.

use std::f64::consts::TAU;

use glam::DVec3;

use super::footprint::{PressedSurface, smooth_step};
use super::smooth::SmoothSurface;
use super::{SurfaceQuery, TriangleLists};
use crate::math::atan2;
use crate::memory::Ranges;
use crate::mesh::Surface;

/// Distances of the sphere's centre from a corner, over its radius, up to which its contact is all on cells, and from which it has
/// none.
const NEAR: [f64; 2] = [0.1, 0.5];
/// Corners up to this distance from a triangle, over the radius, are listed for it: the sphere's centre may lie as deep below the
/// triangle as it is far from the corner.
const LISTED: f64 = 2.0;
/// Least number of convex creases that meet in a corner, and least angle that its faces lack of a whole turn, rad: a cube's lack
/// `pi / 2`. Creases of a rim may meet in a saddle, whose faces have more than a whole turn, and under which nothing is missing.
const LEAST_CREASES: usize = 3;
const LEAST_LACKING: f64 = 0.2;

/// A surface with sharp convex corners, for a sphere.
pub struct CornerSurface {
    /// The surface in pieces.
    pub pressed: PressedSurface,
    /// Positions of the corners, m.
    corners: Vec<DVec3>,
    /// Those near each drawn triangle.
    near: TriangleLists,
    radius: f64,
}

impl CornerSurface {
    /// For a sphere of `radius`, m; `None` for a surface without such corners. `pressed` makes its pieces.
    pub fn new(
        (surface, query, smooth): (&Surface, &SurfaceQuery, &SmoothSurface),
        radius: f64,
        pressed: impl FnOnce() -> PressedSurface,
    ) -> Option<Self> {
        let corners = convex_corners(surface, smooth);
        if corners.is_empty() {
            return None;
        }
        let reach = DVec3::splat(LISTED * radius);
        let near = TriangleLists::new(surface, query, corners.iter().map(|&corner| [corner - reach, corner + reach]));
        Some(Self { pressed: pressed(), corners, near, radius })
    }

    /// Share of cells in the contact of a sphere at a position near a triangle, and its gradient, 1/m.
    pub fn share(&self, triangle: u32, position: DVec3) -> (f64, DVec3) {
        let offsets = self.near.at(triangle).iter().map(|&corner| position - self.corners[corner as usize]);
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
        ranges.add(&self.corners);
        self.near.add_memory(ranges);
    }
}

/// Positions of the nodes in which several creases meet whose faces turn away from each other, m.
pub(super) fn convex_corners(surface: &Surface, smooth: &SmoothSurface) -> Vec<DVec3> {
    let mut nodes = vec![(0, TAU); surface.positions.len()];
    for node in smooth.convex_creases(surface).flat_map(|crease| crease.nodes) {
        nodes[node as usize].0 += 1;
    }
    for (t, triangle) in surface.triangles.iter().enumerate() {
        let ends = surface.corners(t as u32);
        for k in 0..3 {
            let [next, last] = [ends[(k + 1) % 3] - ends[k], ends[(k + 2) % 3] - ends[k]];
            nodes[triangle[k] as usize].1 -= atan2(next.cross(last).length(), next.dot(last));
        }
    }
    let is_corner = |&(_, (count, lacking)): &(_, (usize, f64))| count >= LEAST_CREASES && lacking > LEAST_LACKING;
    surface.positions.iter().zip(nodes).filter(is_corner).map(|(&at, _)| at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::smooth::tests::{ball, cube};
    use crate::mesh::Faces;

    fn of(surface: &Surface, radius: f64) -> Option<CornerSurface> {
        let query = SurfaceQuery::new(surface).expect("triangles");
        let smooth = SmoothSurface::new(surface);
        let fields = vec![Default::default(); smooth.fans().len()];
        CornerSurface::new((surface, &query, &smooth), radius, || {
            PressedSurface::new(surface, &query, &smooth, &fields, radius)
        })
    }

    #[test]
    fn a_ball_has_no_corners_and_a_cube_has_eight() {
        assert!(of(&ball(24), 0.1).is_none());
        assert_eq!(of(&cube(), 0.1).expect("corners").corners.len(), 8);
    }

    /// Three ridges that meet between three valleys, `height` above and below the middle.
    fn ridges(height: f64) -> Surface {
        let around = (0..6).map(|k| {
            let angle = f64::from(k) * TAU / 6.0;
            DVec3::new(angle.cos(), angle.sin(), if k % 2 == 0 { height } else { -height })
        });
        let faces = (0..6).map(|k| [0, 1 + k, 1 + (k + 1) % 6]).collect();
        Surface::new(std::iter::once(DVec3::ZERO).chain(around).collect(), Faces::Linear(faces)).expect("a surface")
    }

    #[test]
    fn ridges_that_meet_in_a_saddle_are_no_corner() {
        let surface = ridges(0.6);
        let smooth = SmoothSurface::new(&surface);
        let meet = smooth.convex_creases(&surface).filter(|crease| crease.nodes.contains(&0)).count();
        assert_eq!((meet, convex_corners(&surface, &smooth)), (LEAST_CREASES, Vec::new()));
    }

    #[test]
    fn the_share_is_one_on_a_corner_and_falls_off_beside_it_with_its_gradient() {
        let (surface, radius) = (cube(), 0.1);
        let corners = of(&surface, radius).expect("corners");
        let query = SurfaceQuery::new(&surface).expect("triangles");
        let share = |x: f64| {
            let position = DVec3::new(x, 1.0, 1.0 + 0.05 * radius);
            let triangle = query.closest(&surface, position).expect("a point").triangle;
            corners.share(triangle, position)
        };
        assert_eq!(share(1.0), (1.0, DVec3::ZERO));
        assert_eq!(share(0.5), (0.0, DVec3::ZERO));
        let mut before = 0.0;
        for k in 0..60 {
            let x = 0.75 + 0.004 * f64::from(k);
            let (part, slope) = share(x);
            let difference = (share(x + 1e-7).0 - share(x - 1e-7).0) / 2e-7;
            assert!((slope.x - difference).abs() < 1e-5 / radius, "{x} {slope} {difference}");
            assert!(part >= before, "{x}");
            before = part;
        }
    }
}
