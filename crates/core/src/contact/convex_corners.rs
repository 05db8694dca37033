//! Sharp convex corners of a surface, and its blades, on which a sphere has no closed form.
//!
//! A sphere that is pressed into a corner by more than half of its radius lies beside it as much as on it. There its pressure is
//! computed on cells, as that of other tools. With the distance `q` of the sphere's centre from the nearest corner, over its radius,
//! the share of cells goes from one to zero. It is a function of the sphere's position over the surface at rest alone, so the mean of
//! both energies with this weight is again one energy.
//!
//! On a blade, an edge of less than 70 degrees, the sphere's closed form is too stiff by 17 % and more from the first touch on: at 60
//! degrees 50 % half a millimetre deep, at 30 degrees 870 %. There the share is that of the distance from the blade's edge.
//!
//! Elsewhere a sphere has the closed form (`convex_edges`, `corner_share`): on cells its force on a block's corner is 20 to 40 % too
//! small, and closed paths around it lose 2 % of the energy.

use std::f64::consts::TAU;

use glam::DVec3;

use super::footprint::{PressedSurface, smooth_step};
use super::sharp_edge::{Edge, convex_edges, keep_long};
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
/// The same of blades: distances from their edge.
const NEAR_BLADE: [f64; 2] = [1.2, 1.8];
const LISTED_BLADE: f64 = 2.0 * NEAR_BLADE[1];
/// Turn of the normal over an edge, over a right angle, from which it is a blade: of one of 70 degrees.
const BLADE: f64 = 1.22;
/// Least number of convex creases that meet in a corner, and least angle that its faces lack of a whole turn, rad: a cube's lack
/// `pi / 2`. Creases of a rim may meet in a saddle, whose faces have more than a whole turn, and under which nothing is missing.
const LEAST_CREASES: usize = 3;
const LEAST_LACKING: f64 = 0.2;

/// A surface with sharp convex corners or blades, for a sphere.
pub struct CornerSurface {
    /// The surface in pieces.
    pub pressed: PressedSurface,
    /// Positions of the corners, m.
    corners: Vec<DVec3>,
    /// Those near each drawn triangle.
    near: TriangleLists,
    /// Pieces of blades.
    blades: Vec<Edge>,
    /// Those near each drawn triangle.
    near_blades: TriangleLists,
    radius: f64,
}

impl CornerSurface {
    /// For a sphere of `radius`, m; `None` for a surface without such corners. `pressed` makes its pieces.
    pub fn new(
        (surface, query, smooth): (&Surface, &SurfaceQuery, &SmoothSurface),
        radius: f64,
        pressed: impl FnOnce() -> PressedSurface,
    ) -> Option<Self> {
        let (corners, blades) = (convex_corners(surface, smooth), blades(surface, smooth, radius));
        if corners.is_empty() && blades.is_empty() {
            return None;
        }
        let reach = DVec3::splat(LISTED * radius);
        let near = TriangleLists::new(surface, query, corners.iter().map(|&corner| [corner - reach, corner + reach]));
        let boxes = blades.iter().map(|blade| blade.box_around(LISTED_BLADE * radius));
        let near_blades = TriangleLists::new(surface, query, boxes);
        Some(Self { pressed: pressed(), corners, near, blades, near_blades, radius })
    }

    /// Share of cells in the contact of a sphere at a position near a triangle, and its gradient, 1/m.
    pub fn share(&self, triangle: u32, position: DVec3) -> (f64, DVec3) {
        let corners = self.near.at(triangle).iter().map(|&corner| position - self.corners[corner as usize]);
        let from_blade = |&piece: &u32| position - self.blades[piece as usize].closest(position);
        let (corner, by_corner) = self.share_at(corners, NEAR);
        let (blade, by_blade) = self.share_at(self.near_blades.at(triangle).iter().map(from_blade), NEAR_BLADE);
        (corner + blade - corner * blade, by_corner * (1.0 - blade) + by_blade * (1.0 - corner))
    }

    /// One up to the nearer and zero from the farther of two distances, by the shortest of some offsets, and its gradient.
    fn share_at(&self, offsets: impl Iterator<Item = DVec3>, within: [f64; 2]) -> (f64, DVec3) {
        let Some(nearest) = offsets.min_by(|a, b| a.length_squared().total_cmp(&b.length_squared())) else {
            return (0.0, DVec3::ZERO);
        };
        let distance = nearest.length();
        let (beyond, slope) = smooth_step(distance / self.radius, within);
        (1.0 - beyond, nearest * (-slope / (self.radius * distance.max(f64::MIN_POSITIVE))))
    }

    /// Adds the memory that a tick reads.
    pub(crate) fn add_memory(&self, ranges: &mut Ranges) {
        self.pressed.add_memory(ranges);
        ranges.add(&self.corners);
        self.near.add_memory(ranges);
        ranges.add(&self.blades);
        self.near_blades.add_memory(ranges);
    }
}

/// Pieces of sharp edges so thin that a sphere's closed form is that of another body.
fn blades(surface: &Surface, smooth: &SmoothSurface, radius: f64) -> Vec<Edge> {
    let mut edges = convex_edges(surface, smooth);
    edges.retain(|edge| edge.turn > BLADE);
    keep_long(&mut edges, radius);
    edges
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

    /// A prism with the edge of `degrees` along y at the origin, its bisector along x.
    fn prism(degrees: f64) -> Surface {
        let half = 0.5 * degrees.to_radians();
        let corners =
            [DVec3::ZERO, DVec3::new(-half.cos(), 0.0, half.sin()), DVec3::new(-half.cos(), 0.0, -half.sin())];
        let positions = [0.5, -0.5].iter().flat_map(|&y| corners.map(|at| at + y * DVec3::Y)).collect();
        let faces = vec![[0, 2, 1], [3, 4, 5], [0, 4, 3], [0, 1, 4], [0, 5, 2], [0, 3, 5], [1, 5, 4], [1, 2, 5]];
        let surface = Surface::new(positions, Faces::Linear(faces)).expect("a surface");
        assert!(surface.normals[2].z > 0.0 && surface.normals[4].z < 0.0, "outwards");
        surface
    }

    #[test]
    fn a_sphere_over_a_blade_is_on_cells_and_falls_off_beside_it() {
        let radius = 0.05;
        let blades = |degrees: f64| of(&prism(degrees), radius).expect("corners").blades.len();
        // The base of the prism has two more edges, of half the angle that is left.
        assert_eq!((blades(30.0), blades(60.0), blades(80.0)), (1, 3, 2));
        let surface = prism(30.0);
        let (corners, query) =
            (of(&surface, radius).expect("corners"), SurfaceQuery::new(&surface).expect("triangles"));
        let share = |position: DVec3| {
            let triangle = query.closest(&surface, position).expect("a point").triangle;
            corners.share(triangle, position)
        };
        assert_eq!(share(DVec3::X * radius), (1.0, DVec3::ZERO));
        let h = 1e-6 * radius;
        for out in [1.3, 1.5, 1.7] {
            let at = DVec3::new(0.6, 0.0, 0.8) * out * radius;
            let (part, slope) = share(at);
            assert!(part > 0.0 && part < 1.0);
            for axis in DVec3::AXES {
                let difference = (share(at + h * axis).0 - share(at - h * axis).0) / (2.0 * h);
                assert!((slope.dot(axis) - difference).abs() < 1e-5 / radius, "{at} {slope} {difference}");
            }
        }
        assert_eq!(share(DVec3::new(0.6, 0.0, 0.8) * 1.81 * radius).0, 0.0);
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
