//! A surface with continuous normals through the nodes of the mesh, and the closest point on it.
//!
//! Drawn triangles are off a curved surface by an eighth of their edge's square over its radius: a sphere of 5 mm that
//! slides over facets of 5 mm on a body of radius 40 mm would feel 0.08 mm of that, 4 % of a press of 2 mm. Contact
//! uses the zero of a smooth function instead (`blend`), made of quadrics at the nodes (`fans`). At a crease of the surface, where
//! this function ends, the closest point is that of the drawn triangles.

mod blend;
mod fans;
mod foot;
mod neighbourhood;
mod weights;

use glam::DVec3;
use pulp::Arch;

pub use fans::Fan;
pub use foot::{DrawnSurface, FootPoint};
pub use neighbourhood::Neighbourhood;
pub use weights::{Blended, FanWeights, MAX_FANS};

use self::fans::Fans;
use self::neighbourhood::LANES;
use crate::memory::Ranges;
use crate::mesh::{Surface, is_convex};

/// Fans of nodes whose normals are turned farther than this from a triangle's do not belong to it (cosine).
const SAME_SIDE: f64 = 0.0;
/// Distance over a triangle's size up to which a point beside it is evaluated with its fans.
const MARGIN: f64 = 1.2;

/// A crease whose faces turn away from each other.
pub struct ConvexCrease {
    /// Nodes at its ends.
    pub nodes: [u32; 2],
    /// Their positions, m.
    pub ends: [DVec3; 2],
    /// Normals of both faces, first of the one that it goes round counter-clockwise.
    pub normals: [DVec3; 2],
}

/// Fans of a surface, and the fans that reach each triangle.
pub struct SmoothSurface {
    pub(super) fans: Vec<Fan>,
    /// Whether each fan is touchable.
    pub(super) touchable: Vec<bool>,
    /// For each triangle the fans of its corners, and for each fan those that share a triangle with it.
    pub(super) of_corners: Vec<[u32; 3]>,
    pub(super) neighbours: Vec<Vec<u32>>,
    creases: Vec<[bool; 3]>,
    /// For each triangle the start of its fans in `reaching`, the start of those beyond creases, and the end.
    ranges: Vec<[u32; 3]>,
    reaching: Vec<u32>,
    arch: Arch,
}

impl SmoothSurface {
    /// Adds the memory that a tick reads.
    pub(crate) fn add_memory(&self, ranges: &mut Ranges) {
        ranges.add(&self.fans);
        ranges.add(&self.touchable);
        ranges.add(&self.of_corners);
        ranges.add(&self.neighbours);
        self.neighbours.iter().for_each(|of_fan| ranges.add(of_fan));
        ranges.add(&self.creases);
        ranges.add(&self.ranges);
        ranges.add(&self.reaching);
    }

    /// Fits the surface; all of it is touchable.
    pub fn new(surface: &Surface) -> Self {
        let Fans { fans, of_corners, neighbours, creases } = Fans::new(surface);
        let touchable = vec![true; fans.len()];
        let walked = of_corners.clone();
        let (ranges, reaching, arch) = (Vec::new(), Vec::new(), Arch::new());
        let mut smooth = Self { fans, touchable, of_corners, neighbours, creases, ranges, reaching, arch };
        let mut walk = Walk {
            surface,
            of_corners: &walked,
            visited: vec![u32::MAX; surface.triangles.len()],
            listed: vec![u32::MAX; smooth.fans.len()],
            queue: Vec::new(),
        };
        for t in 0..surface.triangles.len() as u32 {
            smooth.list_fans(&mut walk, t);
        }
        smooth
    }

    /// The same surface with only some fans touchable.
    pub fn touchable_at(self, touchable: Vec<bool>) -> Self {
        Self { touchable, ..self }
    }

    /// The fans.
    pub fn fans(&self) -> &[Fan] {
        &self.fans
    }

    /// Fans of a triangle's corners.
    pub fn fans_of(&self, triangle: u32) -> [u32; 3] {
        self.of_corners[triangle as usize]
    }

    /// Whether a fan is touchable.
    pub fn is_touchable(&self, fan: u32) -> bool {
        self.touchable[fan as usize]
    }

    /// All fans that may have weight at a foot on a triangle.
    pub fn fans_reaching(&self, triangle: u32) -> &[u32] {
        let [from, _, to] = self.ranges[triangle as usize];
        &self.reaching[from as usize..to as usize]
    }

    /// Whether each edge of a triangle is a crease.
    pub fn creases_of(&self, triangle: u32) -> [bool; 3] {
        self.creases[triangle as usize]
    }

    /// Creases whose faces turn away from each other.
    pub fn convex_creases<'a>(&'a self, surface: &'a Surface) -> impl Iterator<Item = ConvexCrease> + 'a {
        surface.neighbours.iter().enumerate().flat_map(move |(t, across)| {
            let (ends, nodes, creases) = (surface.corners(t as u32), surface.triangles[t], self.creases[t]);
            let both = move |k: usize| creases[k] && across[k] != u32::MAX && across[k] as usize > t;
            (0..3).filter(move |&k| both(k)).filter_map(move |k| {
                let next = (k + 1) % 3;
                let crease = ConvexCrease {
                    nodes: [nodes[k], nodes[next]],
                    ends: [ends[k], ends[next]],
                    normals: [t, across[k] as usize].map(|t| surface.normals[t]),
                };
                let [first, second] = crease.normals;
                is_convex(first, second, ends[next] - ends[k]).then_some(crease)
            })
        })
    }

    /// For each node of the surface whether a crease ends or passes there.
    pub fn crease_nodes(&self, surface: &Surface) -> Vec<bool> {
        let mut nodes = vec![false; surface.positions.len()];
        for (corners, creases) in surface.triangles.iter().zip(&self.creases) {
            for k in (0..3).filter(|&k| creases[k]) {
                nodes[corners[k] as usize] = true;
                nodes[corners[(k + 1) % 3] as usize] = true;
            }
        }
        nodes
    }

    /// Fields at the fans, each blended with those around it: interpolated linearly between the corners of a triangle they are as
    /// smooth as blended ones.
    pub fn smoothed<const N: usize>(&self, fields: &[[f64; N]]) -> Vec<[f64; N]> {
        let mut weights = FanWeights::new(Neighbourhood::new(std::iter::once(self)));
        let even = |(rank, fan): (usize, &Fan)| {
            let foot = FootPoint { triangle: fan.triangle, ..FootPoint::at(fan.position, fan.normal) };
            self.weigh(&foot, &mut weights);
            if weights.is_outside() { fields[rank] } else { weights.blend(fields).values }
        };
        self.fans.iter().enumerate().map(even).collect()
    }

    /// Mean spacing of the nodes around a fan, m.
    pub(super) fn spacing_around(&self, fan: &Fan) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for near in self.same_side(fan.triangle) {
            sum += near.spacing;
            count += 1.0;
        }
        if count > 0.0 { sum / count } else { fan.spacing }
    }

    /// Fans that reach a triangle without crossing a crease.
    fn same_side(&self, triangle: u32) -> impl Iterator<Item = &Fan> {
        let [from, to, _] = self.ranges[triangle as usize];
        self.reaching[from as usize..to as usize].iter().map(|&fan| &self.fans[fan as usize])
    }

    /// Most groups of lanes that the fans of a triangle fill.
    fn most_groups(&self) -> usize {
        let groups = |fans: u32| (fans as usize).div_ceil(LANES);
        self.ranges.iter().map(|[from, between, to]| groups(between - from) + groups(to - between)).max().unwrap_or(0)
    }

    /// Lists the fans that reach a triangle, first those on its side of all creases. These are ordered by direction, so that
    /// neighbouring fans reach the same points.
    fn list_fans(&mut self, walk: &mut Walk<'_>, triangle: u32) {
        let corners = walk.surface.corners(triangle);
        let centre: DVec3 = corners.into_iter().sum::<DVec3>() / 3.0;
        let size = corners.iter().map(|c| c.distance(centre)).fold(0.0, f64::max);
        let normal = walk.surface.normals[triangle as usize];
        let from = self.reaching.len() as u32;
        walk.queue.clear();
        walk.queue.push(triangle);
        walk.visited[triangle as usize] = triangle;
        let mut between = from;
        for crossing in [false, true] {
            let mut next = 0;
            while next < walk.queue.len() {
                let t = walk.queue[next] as usize;
                next += 1;
                let mut reaches_triangle = false;
                for &rank in &walk.of_corners[t] {
                    let fan = &self.fans[rank as usize];
                    let near = fan.position.distance(centre) < fan.reach + MARGIN * size;
                    if near && fan.normal.dot(normal) > SAME_SIDE - f64::from(u8::from(crossing)) * 0.7 {
                        reaches_triangle = true;
                        if walk.listed[rank as usize] != triangle {
                            walk.listed[rank as usize] = triangle;
                            self.reaching.push(rank);
                        }
                    }
                }
                for (k, &other) in walk.surface.neighbours[t].iter().enumerate() {
                    let open = other != u32::MAX && (crossing || !self.creases[t][k]);
                    if reaches_triangle && open && walk.visited[other as usize] != triangle {
                        walk.visited[other as usize] = triangle;
                        walk.queue.push(other);
                    }
                }
            }
            if !crossing {
                let (fans, along) = (&self.fans, corners[0] - centre);
                let angle = |rank: &u32| {
                    let fan = &fans[*rank as usize];
                    let offset = fan.position - centre;
                    // Those that reach everywhere come first.
                    let anywhere = offset.length() + size < fan.reach;
                    if anywhere { f64::NEG_INFINITY } else { turn(along.dot(offset), normal.cross(along).dot(offset)) }
                };
                self.reaching[from as usize..].sort_by(|a, b| angle(a).total_cmp(&angle(b)));
                between = self.reaching.len() as u32;
            }
        }
        self.ranges.push([from, between, self.reaching.len() as u32]);
    }
}

/// Grows with the angle of a vector, from -2 to 2.
fn turn(x: f64, y: f64) -> f64 {
    let part = x / (x.abs() + y.abs()).max(f64::MIN_POSITIVE);
    if y < 0.0 { part - 1.0 } else { 1.0 - part }
}

/// Memory of a walk over the triangles.
struct Walk<'a> {
    surface: &'a Surface,
    of_corners: &'a [[u32; 3]],
    visited: Vec<u32>,
    listed: Vec<u32>,
    queue: Vec<u32>,
}

#[cfg(test)]
pub(crate) mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::contact::SurfaceQuery;

    /// Memory for a surface.
    pub(crate) fn near(smooth: &SmoothSurface) -> Neighbourhood {
        Neighbourhood::new(std::iter::once(smooth))
    }

    /// A ball of radius one, of `n` rows of triangles.
    pub(crate) fn ball(n: u32) -> Surface {
        let mut positions = vec![DVec3::Z];
        for i in 1..n {
            let polar = PI * f64::from(i) / f64::from(n);
            // Turned from row to row, so that no edge runs along a meridian.
            positions.extend((0..2 * n).map(|j| {
                let turn = PI * (f64::from(j) + 0.5 * f64::from(i)) / f64::from(n);
                DVec3::new(polar.sin() * turn.cos(), polar.sin() * turn.sin(), polar.cos())
            }));
        }
        positions.push(-DVec3::Z);
        let (last, row) = (positions.len() as u32 - 1, 2 * n);
        let at = |i: u32, j: u32| 1 + (i - 1) * row + j % row;
        let mut faces = Vec::new();
        for j in 0..row {
            faces.push([0, at(1, j), at(1, j + 1)]);
            faces.push([last, at(n - 1, j + 1), at(n - 1, j)]);
            for i in 1..n - 1 {
                faces.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
                faces.push([at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)]);
            }
        }
        Surface::new(positions, faces.into()).expect("a closed surface")
    }

    /// A cube of side one.
    pub(crate) fn cube() -> Surface {
        let corner = |i: usize| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64);
        let faces = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4], [2, 6, 3], [3, 6, 7], [0, 4, 2]];
        let faces = [&faces[..], &[[2, 4, 6], [1, 3, 5], [3, 7, 5]]].concat();
        Surface::new((0..8).map(corner).collect(), faces.into()).expect("a cube")
    }

    fn points(radius: f64) -> impl Iterator<Item = DVec3> {
        (0..400).map(move |k| {
            let (z, turn) = (0.9 * (0.37 * f64::from(k)).sin(), 2.399 * f64::from(k));
            let across = (1.0 - z * z).sqrt();
            radius * DVec3::new(across * turn.cos(), across * turn.sin(), z)
        })
    }

    /// Facets of this ball lie up to 1.2 % of the radius below it.
    #[test]
    fn the_distance_of_a_ball_is_that_of_the_ball_and_its_derivatives_are_exact() {
        let surface = ball(16);
        let (smooth, query) = (SmoothSurface::new(&surface), SurfaceQuery::new(&surface).expect("triangles"));
        let (mut worst, mut near) = (0.0f64, near(&smooth));
        let drawn = DrawnSurface { surface: &surface, query: &query };
        for p in points(1.2) {
            let mut foot = |p| smooth.foot_anywhere(drawn, p, &mut near).expect("a foot");
            let at = foot(p);
            assert!(!at.on_crease);
            worst = worst.max((at.distance - 0.2).abs());
            assert!((at.position + at.normal * at.distance - p).length() < 1e-9);
            let h = 1e-5;
            for axis in DVec3::AXES {
                let (ahead, behind) = (foot(p + h * axis), foot(p - h * axis));
                assert!(((ahead.distance - behind.distance) / (2.0 * h) - at.normal.dot(axis)).abs() < 1e-6);
                assert!(((ahead.normal - behind.normal) / (2.0 * h) - at.turning * axis).length() < 1e-3);
                assert!(((ahead.position - behind.position) / (2.0 * h) - at.shift * axis).length() < 1e-3);
            }
        }
        assert!(worst < 3e-4, "{worst}");
        let fan = &smooth.fans()[40];
        assert!((fan.mean - 1.0).abs() < 0.05 && (fan.gauss - 1.0).abs() < 0.1, "{} {}", fan.mean, fan.gauss);
    }

    #[test]
    fn weights_sum_to_one_and_their_gradients_are_exact() {
        let surface = ball(16);
        let (smooth, query) = (SmoothSurface::new(&surface), SurfaceQuery::new(&surface).expect("triangles"));
        let drawn = DrawnSurface { surface: &surface, query: &query };
        let heights: Vec<_> = smooth.fans().iter().map(|fan| [fan.position.z]).collect();
        let mut weights = FanWeights::new(near(&smooth));
        let mut height = |p| {
            let foot = smooth.foot_anywhere(drawn, p, &mut weights.near).expect("a foot");
            smooth.weigh(&foot, &mut weights);
            assert!((weights.iter().map(|(_, weight)| weight).sum::<f64>() - 1.0).abs() < 1e-12);
            let blended = weights.blend(&heights);
            (blended.values[0], blended.slope(0))
        };
        for p in points(1.1) {
            let (_, slope) = height(p);
            for axis in DVec3::AXES {
                let difference = (height(p + 1e-5 * axis).0 - height(p - 1e-5 * axis).0) / 2e-5;
                assert!((difference - slope.dot(axis)).abs() < 1e-5, "{difference} {}", slope.dot(axis));
            }
        }
    }

    #[test]
    fn a_cube_has_three_fans_a_corner_and_is_flat_between_its_creases() {
        let surface = cube();
        let (smooth, query) = (SmoothSurface::new(&surface), SurfaceQuery::new(&surface).expect("triangles"));
        assert_eq!(smooth.fans().len(), 24);
        let (drawn, mut near) = (DrawnSurface { surface: &surface, query: &query }, near(&smooth));
        let mut foot = |p| smooth.foot_anywhere(drawn, p, &mut near).expect("a foot");
        let over = foot(DVec3::new(0.3, 0.6, 1.2));
        assert!((over.distance - 0.2).abs() < 1e-12 && over.normal.distance(DVec3::Z) < 1e-12, "{over:?}");
        let beside = foot(DVec3::new(1.1, 0.5, 1.1));
        assert!(beside.on_crease && (beside.distance - 0.02f64.sqrt()).abs() < 1e-12);
        // Followed from the face, the foot stops at the crease.
        let followed = smooth.foot(drawn, DVec3::new(1.1, 0.5, 1.1), &over, &mut near);
        assert!(followed.expect("a foot").position.distance(beside.position) < 1e-12);
        assert!(smooth.foot_anywhere(drawn, DVec3::splat(f64::NAN), &mut near).is_none());
    }

    /// Beside an edge the foot moves along it and its normal turns across it; beside a corner the foot stays.
    #[test]
    fn derivatives_of_a_foot_on_a_crease_are_exact() {
        let surface = cube();
        let (smooth, query) = (SmoothSurface::new(&surface), SurfaceQuery::new(&surface).expect("triangles"));
        let (drawn, mut near) = (DrawnSurface { surface: &surface, query: &query }, near(&smooth));
        let mut foot = |p| smooth.foot_anywhere(drawn, p, &mut near).expect("a foot");
        for p in [DVec3::new(1.1, 0.5, 1.05), DVec3::new(0.3, -0.02, 1.2), DVec3::new(1.1, 1.2, 1.05)] {
            let (at, h) = (foot(p), 1e-5);
            assert!(at.on_crease);
            for axis in DVec3::AXES {
                let (ahead, behind) = (foot(p + h * axis), foot(p - h * axis));
                assert!(((ahead.normal - behind.normal) / (2.0 * h) - at.turning * axis).length() < 1e-6);
                assert!(((ahead.position - behind.position) / (2.0 * h) - at.shift * axis).length() < 1e-6);
            }
        }
    }
}
