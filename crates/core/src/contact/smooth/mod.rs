//! A surface with continuous normals through the nodes of the mesh, and the closest point on it.
//!
//! Drawn triangles are off a curved surface by an eighth of their edge's square over its radius: a sphere of 5 mm that
//! slides over facets of 5 mm on a body of radius 40 mm would feel 0.08 mm of that, 4 % of a press of 2 mm. Contact
//! meets the zero of a smooth function instead (`blend`), made of quadrics at the nodes (`fans`). Where it ends, at a
//! crease of the surface, the closest point is that of the drawn triangles.

mod blend;
mod fans;
mod foot;
mod weights;

use glam::DVec3;

pub use fans::Fan;
pub use foot::FootPoint;
pub use weights::{FanWeights, MAX_FANS};

use self::fans::Fans;
use crate::mesh::Surface;

/// Fans of nodes whose normals are turned farther than this from a triangle's do not belong to it (cosine).
const SAME_SIDE: f64 = 0.0;
/// Part of a triangle's size by which a point may lie beside it and still be met by its fans.
const MARGIN: f64 = 1.2;

/// Fans of a surface, and which of them each triangle meets.
pub struct SmoothSurface {
    pub(super) fans: Vec<Fan>,
    /// Whether the node of each fan may be touched.
    pub(super) touchable: Vec<bool>,
    creases: Vec<[bool; 3]>,
    /// For each triangle where its fans begin in `met`, where those begin that lie beyond creases, and the end.
    ranges: Vec<[u32; 3]>,
    met: Vec<u32>,
}

impl SmoothSurface {
    /// Fits the surface; `touchable` tells of each node whether it may be touched.
    pub fn new(surface: &Surface, touchable: impl Fn(u32) -> bool) -> Self {
        let Fans { fans, of_corners, creases } = Fans::new(surface);
        let touchable = fans.iter().map(|fan| touchable(fan.node)).collect();
        let mut smooth = Self { fans, touchable, creases, ranges: Vec::new(), met: Vec::new() };
        let mut walk = Walk {
            surface,
            of_corners: &of_corners,
            visited: vec![u32::MAX; surface.triangles.len()],
            kept: vec![u32::MAX; smooth.fans.len()],
            queue: Vec::new(),
        };
        for t in 0..surface.triangles.len() as u32 {
            smooth.meet(&mut walk, t);
        }
        smooth
    }

    /// The fans.
    pub fn fans(&self) -> &[Fan] {
        &self.fans
    }

    /// Mean spacing of the nodes around a fan, m.
    pub(super) fn spacing_around(&self, fan: &Fan) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for near in self.own(fan.triangle) {
            sum += near.spacing;
            count += 1.0;
        }
        if count > 0.0 { sum / count } else { fan.spacing }
    }

    /// Fans that a triangle meets without crossing a crease.
    fn own(&self, triangle: u32) -> impl Iterator<Item = &Fan> {
        let [from, to, _] = self.ranges[triangle as usize];
        self.met[from as usize..to as usize].iter().map(|&fan| &self.fans[fan as usize])
    }

    /// Ranks of all fans that a triangle meets.
    fn all(&self, triangle: u32) -> &[u32] {
        let [from, _, to] = self.ranges[triangle as usize];
        &self.met[from as usize..to as usize]
    }

    /// Lists the fans that reach a triangle, first those on its side of all creases.
    fn meet(&mut self, walk: &mut Walk<'_>, triangle: u32) {
        let corners = walk.surface.corners(triangle);
        let centre: DVec3 = corners.into_iter().sum::<DVec3>() / 3.0;
        let size = corners.iter().map(|c| c.distance(centre)).fold(0.0, f64::max);
        let normal = walk.surface.normals[triangle as usize];
        let from = self.met.len() as u32;
        walk.queue.clear();
        walk.queue.push(triangle);
        walk.visited[triangle as usize] = triangle;
        let mut between = from;
        for crossing in [false, true] {
            let mut next = 0;
            while next < walk.queue.len() {
                let t = walk.queue[next] as usize;
                next += 1;
                let mut reached = false;
                for &rank in &walk.of_corners[t] {
                    let fan = &self.fans[rank as usize];
                    let near = fan.position.distance(centre) < fan.reach + MARGIN * size;
                    if near && fan.normal.dot(normal) > SAME_SIDE - f64::from(u8::from(crossing)) * 0.7 {
                        reached = true;
                        if walk.kept[rank as usize] != triangle {
                            walk.kept[rank as usize] = triangle;
                            self.met.push(rank);
                        }
                    }
                }
                for (k, &other) in walk.surface.neighbours[t].iter().enumerate() {
                    let open = other != u32::MAX && (crossing || !self.creases[t][k]);
                    if reached && open && walk.visited[other as usize] != triangle {
                        walk.visited[other as usize] = triangle;
                        walk.queue.push(other);
                    }
                }
            }
            if !crossing {
                between = self.met.len() as u32;
            }
        }
        self.ranges.push([from, between, self.met.len() as u32]);
    }
}

/// Memory of a walk over the triangles.
struct Walk<'a> {
    surface: &'a Surface,
    of_corners: &'a [[u32; 3]],
    visited: Vec<u32>,
    kept: Vec<u32>,
    queue: Vec<u32>,
}
