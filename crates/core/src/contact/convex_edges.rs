//! Sharp convex edges of a surface, beside which a sphere presses less than a half-space.
//!
//! Two functions of the sphere's centre `p`, by its position in the plane across the edge. With the unit vectors `n_k` from the edge
//! into its two faces, `s_k` is the distance of the closest point from the edge in face `k`, and negative, `n_k . (p - x)`, where the
//! closest point `x` lies on the edge.
//!
//! *The half-space.* The material beyond the edge is missing. Direct solutions for a sphere of 6 mm beside edges of 60, 90 and 120
//! degrees (`edge_block` of the tests) give 0.36, 0.58 and 0.73 of Hertz's force for shallow presses right on the edge, and less
//! beyond it. So its modulus has the share
//!
//! ```text
//! rho = 1 - m (1 - L) (1 - step((t/R - B_0) / (B_1 - B_0)))        step(x) = x^2 (3 - 2 x)
//! t = s_k on face k        t = -s_1 s_2 / sqrt(s_1^2 + s_2^2) over the edge
//! ```
//!
//! with `m` by the angle between the faces' normals. `t` and its derivative are continuous: over the edge `s_2` is negative where
//! `s_1` passes zero. Shares of several edges multiply. An edge may end where the surface becomes smooth, as creases on a rim do:
//! beyond its end the share rises to one within a radius. Shorter edges than the radius do not count.
//!
//! *The body.* The closest point stops at the edge, and the gradient of the compliance `C(x)`, which inclines the force, would end
//! there at once. So the compliance is taken at a point that slows down before the edge,
//!
//! ```text
//! x + sum_k e_k n_k (w - |s_k|)^2 / (4 w)        for |s_k| < w
//! ```
//!
//! with `e_k = 1` on face `k`, and `e_1 = s_2^2/(s_1^2 + s_2^2)` over the edge, so that the point goes round it evenly.
//!
//! Both are functions of `p` alone, so that the force is the gradient of one energy as before.

use glam::{DMat3, DVec3};

use super::corner_share::ConvexCorner;
use super::footprint::smooth_step;
use super::modulus_share::Share;
use super::sharp_edge::{Edge, convex_edges, keep_long, keep_single};
use super::smooth::{FootPoint, SmoothSurface};
use super::{SurfaceQuery, TriangleLists};
use crate::math::hypot;
use crate::memory::Ranges;
use crate::mesh::Surface;
use crate::tensor::outer;

/// `B_0`, `B_1`.
const BESIDE: [f64; 2] = [-0.5, 0.667];
/// `w` over the sphere's radius.
const SLOWED: f64 = 0.3;
/// Edges up to this distance from a triangle, over the radius, are listed for it, and as ones that a sphere may slip past.
const LISTED: f64 = 1.0;
const LISTED_AROUND: f64 = 4.0;
/// Cosines between the normal of a foot and that of a face of an edge from which the edge counts, and counts fully.
const FACING: [f64; 2] = [0.0, 0.5];
/// Length over the sphere's radius from which an edge counts, and distances beyond its end from which it counts in part, and not.
const SHORTEST: f64 = 1.0;
const ENDING: [f64; 2] = [0.0, 1.0];
/// Largest turn of the normal over a right angle: a thinner blade bends as a whole.
const MOST_TURN: f64 = 1.5;
/// Distance of another edge in about the same direction, over the radius, from which an edge counts.
const ALONE: f64 = 2.0;
/// Most edges beside which a sphere is at once; any others are not followed.
const MOST_CHAINS: usize = 4;
/// Relative difference of squared distances that counts as none.
const SAME_DISTANCE: f64 = 1e-9;
/// Distance of a foot from an edge on which it lies, over the radius.
const ON_EDGE: f64 = 1e-6;

/// Sharp convex edges of a surface, for a sphere.
pub struct ConvexEdges {
    edges: Vec<Edge>,
    corners: Vec<ConvexCorner>,
    /// Those near each drawn triangle.
    near_corners: TriangleLists,
    /// Those near each drawn triangle; pieces of one edge follow each other.
    near: TriangleLists,
    /// Those as near as any that a sphere may slip past.
    around: TriangleLists,
    radius: f64,
}

/// A sphere beside sharp edges.
#[derive(Clone, Copy, Debug)]
pub struct BesideEdges {
    /// Share of the half-space's modulus.
    pub share: Share,
    /// The foot at which the body's compliance is taken.
    pub slowed: FootPoint,
    /// Directions in which that foot's derivative changes with the centre, and how fast, 1/m.
    bends: [(DVec3, f64); 2 * MOST_CHAINS],
    bend_count: usize,
}

/// Position across an edge: `s_k` of both faces and their gradients, and the face on which the foot lies; none on the edge itself.
/// A foot on another edge, whose normal turns away from that face, counts in part.
struct Across {
    places: [f64; 2],
    slopes: [DVec3; 2],
    face: Option<usize>,
    part: f64,
    part_slope: DVec3,
}

impl BesideEdges {
    /// Beside none yet.
    fn at(foot: &FootPoint) -> Self {
        Self { share: Share::WHOLE, slowed: *foot, bends: Default::default(), bend_count: 0 }
    }

    /// Adds a direction.
    fn bend(&mut self, direction: DVec3, rate: f64) {
        if let Some(place) = self.bends.get_mut(self.bend_count) {
            *place = (direction, rate);
            self.bend_count += 1;
        }
    }

    /// Second derivatives by the centre of a function of the slowed foot with a gradient, as far as they come from the foot's own.
    pub fn bending(&self, gradient: DVec3) -> DMat3 {
        let bends = self.bends[..self.bend_count].iter();
        bends.map(|&(n, rate)| outer(n, n) * (rate * gradient.dot(n))).sum()
    }
}

impl Edge {
    /// Squared distance of a foot, m^2, by which the piece of an edge is chosen. Around the common end of two pieces it is the same for
    /// both: there the one farther from the centre counts, so that the position across the edge is continuous.
    fn remoteness(&self, foot: DVec3, centre: DVec3) -> f64 {
        let off = (centre - self.ends[0]).reject_from_normalized(self.along);
        self.distance_squared(foot) - SAME_DISTANCE * off.length_squared()
    }

    /// Position of the centre of a sphere of some radius, with a foot, across the edge.
    fn across(&self, foot: &FootPoint, centre: DVec3, radius: f64) -> Across {
        let tolerance = ON_EDGE * radius;
        let on_edge = foot.on_crease && self.distance_squared(foot.position) < tolerance * tolerance;
        if on_edge {
            let places = self.into.map(|into| (centre - self.ends[0]).dot(into));
            return Across { places, slopes: self.into, face: None, part: 1.0, part_slope: DVec3::ZERO };
        }
        let face = usize::from(foot.normal.dot(self.normals[1]) > foot.normal.dot(self.normals[0]));
        let (mut places, mut slopes) = ([f64::NEG_INFINITY; 2], [DVec3::ZERO; 2]);
        places[face] = (foot.position - self.ends[0]).dot(self.into[face]);
        slopes[face] = foot.shift * self.into[face];
        let (mut part, rise) = smooth_step(foot.normal.dot(self.normals[face]), FACING);
        let mut part_slope = foot.turning * self.normals[face] * rise;
        for (k, outward) in [-self.along, self.along].into_iter().enumerate().filter(|&(k, _)| self.is_last[k]) {
            let beyond = (foot.position - self.ends[k]).dot(outward) / radius;
            let (gone, rate) = smooth_step(beyond, ENDING);
            part_slope = part_slope * (1.0 - gone) - foot.shift * outward * (part * rate / radius);
            part *= 1.0 - gone;
        }
        Across { places, slopes, face: Some(face), part, part_slope }
    }

    /// `rho` for a sphere of a radius.
    fn share(&self, across: &Across, radius: f64) -> Share {
        let at = match across.face {
            Some(face) => Share { value: across.places[face], gradient: across.slopes[face], hessian: DMat3::ZERO },
            None => across.over_edge(),
        };
        let width = (BESIDE[1] - BESIDE[0]) * radius;
        let x = (at.value / radius - BESIDE[0]) / (BESIDE[1] - BESIDE[0]);
        if x >= 1.0 {
            return Share::WHOLE;
        }
        let x = x.max(0.0);
        let deficit = self.deficit * across.part;
        let missing = 1.0 - x * x * (3.0 - 2.0 * x);
        let rate = deficit * 6.0 * x * (1.0 - x) / width;
        let bend = if x > 0.0 { deficit * (6.0 - 12.0 * x) / (width * width) } else { 0.0 };
        Share {
            value: 1.0 - deficit * missing,
            gradient: at.gradient * rate - across.part_slope * (self.deficit * missing),
            hessian: outer(at.gradient, at.gradient) * bend + at.hessian * rate,
        }
    }

    /// Slows the foot down before the edge, and turns it round the edge over it.
    fn slow(&self, across: &Across, width: f64, beside: &mut BesideEdges) {
        for k in (0..2).filter(|&k| across.face.is_none_or(|face| face == k)) {
            let (s, slope, into) = (across.places[k], across.slopes[k], self.into[k]);
            let left = width - s.abs();
            if left <= 0.0 {
                continue;
            }
            // Of `-|s|`; right on the edge the foot itself does not move.
            let falling = if across.face.is_some() || s > 0.0 { -1.0 } else { 1.0 };
            let (share, share_slope) = across.share_of_face(k);
            let part = across.part * share;
            let moved = left * left / (4.0 * width);
            beside.slowed.position += into * (moved * part);
            beside.slowed.shift += outer(into, slope) * (part * falling * left / (2.0 * width));
            beside.slowed.shift += outer(into, across.part_slope * share + share_slope * across.part) * moved;
            beside.bend(into, part * 0.5 / width);
        }
    }
}

impl Across {
    /// Over the edge, the unit vector of its position in the plane across it, both places at most zero, and its length, m; `None` for
    /// the edge itself.
    fn direction(&self) -> Option<([f64; 2], f64)> {
        let [x, y] = self.places.map(|place| place.min(0.0));
        let size = hypot(x, y);
        (size > 0.0).then_some(([x / size, y / size], size))
    }

    /// Share of a face in the way of the foot, one on the face itself and over its border, zero over that of the other one, and its
    /// gradient, 1/m.
    fn share_of_face(&self, k: usize) -> (f64, DVec3) {
        if self.face.is_some() {
            return (1.0, DVec3::ZERO);
        }
        let Some((unit, size)) = self.direction() else { return (0.5, DVec3::ZERO) };
        let (own, other) = (unit[k], unit[1 - k]);
        let gradient = (self.slopes[1 - k] * own - self.slopes[k] * other) * (2.0 * own * other / size);
        (other * other, gradient)
    }

    /// `-s_1 s_2 / sqrt(s_1^2 + s_2^2)`.
    fn over_edge(&self) -> Share {
        let Some(([x, y], size)) = self.direction() else { return Share { value: 0.0, ..Share::WHOLE } };
        let [n, m] = self.slopes;
        let mixed = outer(n, m);
        Share {
            value: -x * y * size,
            gradient: -(n * (y * y * y) + m * (x * x * x)),
            hessian: (outer(n, n) * (x * y * y * y) + outer(m, m) * (x * x * x * y)
                - (mixed + mixed.transpose()) * (x * x * y * y))
                * (3.0 / size),
        }
    }
}

impl ConvexEdges {
    /// For a sphere of `radius`, m; `None` for a surface without such edges.
    pub fn new((surface, query, smooth): (&Surface, &SurfaceQuery, &SmoothSurface), radius: f64) -> Option<Self> {
        let mut edges = convex_edges(surface, smooth);
        edges.retain(|edge| edge.turn <= MOST_TURN);
        keep_single(&mut edges, ALONE * radius);
        keep_long(&mut edges, SHORTEST * radius);
        if edges.is_empty() {
            return None;
        }
        let listed =
            |reach: f64| TriangleLists::new(surface, query, edges.iter().map(|edge| edge.box_around(reach * radius)));
        let (near, around) = (listed(LISTED), listed(LISTED_AROUND));
        let ending = |at: DVec3| {
            let ends = move |edge: &&Edge| (0..2).any(|k| edge.is_last[k] && edge.ends[k] == at);
            edges.iter().filter(ends).map(|edge| edge.normals)
        };
        let corners = ConvexCorner::all(surface, smooth, ending);
        let boxes = corners.iter().map(|corner| corner.box_around(radius));
        let near_corners = TriangleLists::new(surface, query, boxes);
        Some(Self { edges, corners, near_corners, near, around, radius })
    }

    /// Where a sphere with its centre and foot there is beside sharp edges; `None` elsewhere.
    pub fn beside(&self, foot: &FootPoint, centre: DVec3) -> Option<BesideEdges> {
        let (mut near, corners) = (self.near.at(foot.triangle), self.near_corners.at(foot.triangle));
        if near.is_empty() && corners.is_empty() {
            return None;
        }
        let mut found = None;
        while let Some(&first) = near.first() {
            let chain = self.edges[first as usize].chain;
            let count = near.iter().take_while(|&&edge| self.edges[edge as usize].chain == chain).count();
            let pieces = near[..count].iter().map(|&edge| &self.edges[edge as usize]);
            let remote = pieces.map(|edge| (edge.remoteness(foot.position, centre), edge));
            let nearest = remote.min_by(|one, other| one.0.total_cmp(&other.0));
            near = &near[count..];
            let Some((_, edge)) = nearest else { continue };
            let across = edge.across(foot, centre, self.radius);
            let beyond = across.face.is_some_and(|face| across.places[face] >= BESIDE[1] * self.radius);
            if beyond || across.part == 0.0 {
                continue;
            }
            let beside = found.get_or_insert_with(|| BesideEdges::at(foot));
            beside.share = beside.share.times(&edge.share(&across, self.radius));
            edge.slow(&across, SLOWED * self.radius, beside);
        }
        for &corner in corners {
            if let Some(share) = self.corners[corner as usize].share(centre, self.radius) {
                let beside = found.get_or_insert_with(|| BesideEdges::at(foot));
                beside.share = beside.share.times(&share);
            }
        }
        found
    }

    /// Numbers of the edges that a sphere with a foot may slip past: those within its radius, or within its `depth`, m. An edge that it
    /// bends down slips past it to its side, and the foot is then as far below the edge as its centre.
    fn chains_around(&self, foot: &FootPoint, depth: f64) -> impl Iterator<Item = u32> {
        let (position, reach) = (foot.position, self.radius.max(depth));
        let around = self.around.at(foot.triangle).iter().map(|&edge| &self.edges[edge as usize]);
        around.filter(move |edge| edge.distance_squared(position) < reach * reach).map(|edge| edge.chain)
    }

    /// Whether there is any such edge.
    pub fn may_slip(&self, foot: &FootPoint, depth: f64) -> bool {
        self.chains_around(foot, depth).next().is_some()
    }

    /// Whether one edge is such for both feet.
    pub fn are_beside_one(&self, one: &FootPoint, other: &FootPoint, depth: f64) -> bool {
        self.chains_around(one, depth).any(|chain| self.chains_around(other, depth).any(|found| found == chain))
    }

    /// Adds the memory that a tick reads.
    pub(crate) fn add_memory(&self, ranges: &mut Ranges) {
        ranges.add(&self.edges);
        ranges.add(&self.corners);
        self.near.add_memory(ranges);
        self.around.add_memory(ranges);
        self.near_corners.add_memory(ranges);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::smooth::DrawnSurface;
    use crate::contact::smooth::tests::{cube, near};

    /// A cube and its edges for a sphere of a radius.
    fn on_cube(radius: f64) -> (Surface, SurfaceQuery, SmoothSurface, ConvexEdges) {
        let surface = cube();
        let (smooth, query) = (SmoothSurface::new(&surface), SurfaceQuery::new(&surface).expect("triangles"));
        let edges = ConvexEdges::new((&surface, &query, &smooth), radius).expect("edges");
        (surface, query, smooth, edges)
    }

    #[test]
    fn short_edges_do_not_count() {
        let (surface, smooth) = (cube(), SmoothSurface::new(&cube()));
        let query = SurfaceQuery::new(&surface).expect("triangles");
        let count = |radius: f64| ConvexEdges::new((&surface, &query, &smooth), radius).is_some();
        assert!(count(0.45) && !count(1.01));
    }

    /// One foot on the top, the other on the side three halves of a radius below the edge between them.
    #[test]
    fn feet_on_both_sides_of_an_edge_belong_together_within_the_depth() {
        let (surface, query, smooth, edges) = on_cube(0.2);
        let (drawn, mut near) = (DrawnSurface { surface: &surface, query: &query }, near(&smooth));
        let mut foot = |centre| smooth.foot_anywhere(drawn, centre, &mut near).expect("a foot");
        let [top, side, far] = [(0.9, 1.1), (1.1, 0.7), (0.5, 1.1)].map(|(x, z)| foot(DVec3::new(x, 0.5, z)));
        for (depth, expected) in [(0.1, false), (0.29, false), (0.31, true)] {
            assert_eq!(edges.are_beside_one(&top, &side, depth), expected, "{depth}");
        }
        assert!(edges.may_slip(&top, 0.1) && !edges.may_slip(&side, 0.1) && edges.may_slip(&side, 0.31));
        assert!(!edges.may_slip(&far, 0.31));
    }

    /// Along a way from the top over an edge to the side, near a corner, and low over the edge.
    #[test]
    fn shares_and_feet_have_continuous_derivatives() {
        let radius = 0.2;
        let (surface, query, smooth, edges) = on_cube(radius);
        let (drawn, mut near) = (DrawnSurface { surface: &surface, query: &query }, near(&smooth));
        let mut beside = |centre: DVec3| {
            let foot = smooth.foot_anywhere(drawn, centre, &mut near).expect("a foot");
            edges.beside(&foot, centre)
        };
        assert!(beside(DVec3::new(0.5, 0.5, 1.1)).is_none());
        for (along, height, fall) in [(0.5, 0.2, 0.25), (0.95, 0.2, 0.25), (0.5, 0.03, 0.0)] {
            let way = |k: f64| DVec3::new(0.86 + 0.3 * k, along, 1.0 + height - fall * k);
            let mut before: Option<BesideEdges> = None;
            for step in 0..400 {
                let centre = way(f64::from(step) / 400.0);
                let Some(at) = beside(centre) else { continue };
                assert!(at.share.value > 0.0 && at.share.value <= 1.0);
                let h = 1e-6;
                for axis in DVec3::AXES {
                    let [ahead, behind] = [h, -h].map(|h| beside(centre + h * axis).expect("beside an edge"));
                    let slope = (ahead.share.value - behind.share.value) / (2.0 * h);
                    assert!((slope - at.share.gradient.dot(axis)).abs() < 1e-3 / radius, "{centre}");
                    let moved = (ahead.slowed.position - behind.slowed.position) / (2.0 * h);
                    let shift = at.slowed.shift * axis;
                    assert!((moved - shift).length() < 1e-3, "{centre} {moved} {shift}");
                }
                if let Some(before) = before {
                    assert!(before.share.gradient.distance(at.share.gradient) < 0.3 / radius, "{centre}");
                    assert!(before.slowed.position.distance(at.slowed.position) < 2e-3, "{centre}");
                }
                before = Some(at);
            }
            assert!(before.is_some());
        }
    }

    #[test]
    fn second_derivatives_are_those_of_the_share() {
        let radius = 0.2;
        let (surface, query, smooth, edges) = on_cube(radius);
        let (drawn, mut near) = (DrawnSurface { surface: &surface, query: &query }, near(&smooth));
        let mut share = |centre: DVec3| {
            let foot = smooth.foot_anywhere(drawn, centre, &mut near).expect("a foot");
            edges.beside(&foot, centre).expect("beside an edge").share
        };
        for centre in [DVec3::new(0.95, 0.5, 1.1), DVec3::new(1.06, 0.5, 1.09), DVec3::new(0.96, 0.95, 1.1)] {
            let h = 1e-6;
            for axis in DVec3::AXES {
                let bent = (share(centre + h * axis).gradient - share(centre - h * axis).gradient) / (2.0 * h);
                assert!((bent - share(centre).hessian * axis).length() < 1e-5 / radius.powi(2), "{centre}");
            }
        }
    }
}
