//! Where a tool that is no sphere meets a body: the plane of the contact, as a smooth function of the tool's pose.
//!
//! The pieces `i` of the surface near the tool, at distances `s_i` from it, have the weights
//!
//! ```text
//! w_i = A_i (1 - s_i/m)^2 eta(n_i . d_i)      x = sum w_i x_i / sum w_i        n = sum w_i n_i / |sum w_i n_i|
//! ```
//!
//! for `s_i < m`. The contact's middle `x` and normal `n` are means over them, and so are all fields known at the nodes.
//! The factor `eta` leaves out what faces away from the tool's middle, in the direction `d_i`, as the other side of a plate does.
//! The plane of the contact is raised over `x` to the highest piece that the tool may touch. All this is a function of the tool's
//! pose alone with exact derivatives, as long as the tool's middle has not sunk in; from then on the middle is taken as lifted
//! along the contact's normal of the tick before.
//!
//! Heights over one plane cannot describe a floor and a wall that stands on it. A wall that rises over the plane of the tick before
//! is therefore taken down to it, wholly where it is steeper than 78 degrees, not at all up to 45, and pressed as a further place of
//! the same tool, on a plane of its own.

mod near;

use glam::{DMat3, DVec3};

pub use self::near::{NearPiece, NearPieces, PosedShape};
use super::local::ContactPlane;
use super::local::cells::{End, GridFrame, Heights, LEAST_COSINE, Relief};
use super::smooth::{FanWeights, FootPoint, SmoothSurface};
use super::{SurfaceQuery, Tessellation};
use crate::tensor::{across, outer};

/// Distance from which a piece counts, over the tool's thickness, and over the edge of a piece at the least: more than any point
/// of a piece is from its middle.
const MARGIN: [f64; 2] = [0.3, 0.75];
/// Edge of a piece at most, over the tool's thickness.
const PIECE: f64 = 0.4;
/// Cosines between a piece's normal and the direction to the tool's middle from which it counts, and counts fully.
const FACING: [f64; 2] = [-0.4, 1.0];
/// Cosines between the normals of a wall that rises over the contact's plane and of that plane from which it belongs to the
/// contact, and does so fully.
const ALIKE: [f64; 2] = [0.2, 0.7];
/// How far the contact's middle lies before a piece, over the margin, for that to be such a wall, and to be one fully.
const BEFORE: [f64; 2] = [0.0, 0.5];
/// A piece that is so much of a wall is pressed as a place of its own.
const WALL: f64 = 0.9;
/// Normals whose sum is shorter than this part of their weights have no common direction.
const COMMON: f64 = 0.05;
/// A piece that does not touch the tool raises the plane by this many times its distance less.
const LOWERED: f64 = 4.0;
/// Largest cosine between a piece's normal and the way that the tool has come: it does not come through the body.
const AWAY: f64 = 0.5;
/// Least cosine between a piece's normal and the direction to the tool for it to be where a contact begins.
const MET: f64 = 0.2;

/// A surface that a tool which is no sphere is pressed on.
pub struct PressedSurface {
    /// In pieces as fine as the tool needs.
    pub fine: Tessellation,
    /// Distance from the tool within which pieces count, m.
    pub margin: f64,
    /// What the tool meets at the fans, each evened with those around it.
    pub fields: Vec<super::FanFields>,
}

/// The plane of a contact, and how it follows the tool's place and its rotation about its origin.
#[derive(Clone, Copy, Debug)]
pub struct Footprint {
    /// The drawn triangle next to the middle.
    pub triangle: u32,
    /// Mean place of the contact on the body, m.
    pub middle: DVec3,
    /// Its derivatives by the tool's place and by its rotation.
    pub middle_by: [DMat3; 2],
    /// Unit outward normal.
    pub normal: DVec3,
    /// Its derivatives.
    pub normal_by: [DMat3; 2],
    /// Point of the plane over the middle, m.
    pub origin: DVec3,
    /// Its derivatives.
    pub origin_by: [DMat3; 2],
}

/// A contact's plane as it is known before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// A point of it, m.
    pub point: DVec3,
    /// Unit outward normal.
    pub normal: DVec3,
}

/// Memory of a search.
#[derive(Clone, Debug, Default)]
pub struct FootprintScratch {
    /// The pieces near the tool.
    pub near: NearPieces,
}

/// A direction that pieces face, and how it follows the tool.
#[derive(Clone, Copy)]
struct Facing {
    normal: DVec3,
    by: [DMat3; 2],
}

/// Sums over pieces; places are counted from the tool's middle.
#[derive(Clone, Copy)]
struct Sums {
    weight: f64,
    weight_by: [DVec3; 2],
    place: DVec3,
    place_by: [DMat3; 2],
    normal: DVec3,
    normal_by: [DMat3; 2],
}

impl PressedSurface {
    /// Divides the smooth surface into pieces for tools of a `thickness`, m: so small that several lie under a tool.
    /// `fields` are those of each fan (compliance, moduli); they are smoothed over neighbouring fans.
    pub fn new(
        surface: &crate::mesh::Surface,
        query: &SurfaceQuery,
        smooth: &SmoothSurface,
        fields: &[super::FanFields],
        thickness: f64,
    ) -> Self {
        let fine = Tessellation::new(surface, query, smooth, PIECE * thickness);
        let margin = (MARGIN[0] * thickness).max(MARGIN[1] * fine.edge);
        Self { fine, margin, fields: smooth.evened(fields) }
    }
}

impl FootprintScratch {
    /// Plane of the piece that the tool is deepest in, or next to, among those that face it and the way `gone` that it has
    /// come.
    pub fn first_met(&self, gone: DVec3) -> Option<Plane> {
        let away = AWAY * gone.length();
        let meets = |near: &&NearPiece| near.normal.dot(near.by_pose[0]) > MET && near.normal.dot(gone) <= away;
        let first = self.near.pieces.iter().filter(meets).min_by(|a, b| a.distance.total_cmp(&b.distance));
        first.map(|near| Plane { point: near.middle, normal: near.normal })
    }

    /// Plane of a wall that stands on all planes that a tool is known to press on, or faces them across the tool, where the tool is
    /// nearest to it, and how far it is from it, m.
    pub fn wall_beside(&self, known: &[Plane]) -> Option<(Plane, f64)> {
        let is_wall = |near: &&NearPiece| {
            near.facing > MET && known.iter().all(|plane| near.share_of_wall(plane, self.near.margin) > WALL)
        };
        let pieces = self.near.pieces.iter().chain(&self.near.opposite);
        let nearest = pieces.filter(is_wall).min_by(|a, b| a.distance.total_cmp(&b.distance))?;
        Some((Plane { point: nearest.middle, normal: nearest.normal }, nearest.distance))
    }

    /// The footprint of a tool whose pieces have been gathered, and the weights of the fans below it. `None` where it is near no
    /// piece.
    pub fn find(
        &mut self,
        fine: &Tessellation,
        smooth: &SmoothSurface,
        known: Plane,
        weights: &mut FanWeights,
    ) -> Option<Footprint> {
        self.take_down(fine, known);
        let sums = self.sum()?;
        let Facing { normal, by: normal_by } = sums.facing(known.normal);
        let inverse = 1.0 / sums.weight;
        let middle = sums.place * inverse;
        let middle_by = [0, 1].map(|k| (sums.place_by[k] - outer(middle, sums.weight_by[k])) * inverse);
        let middle = middle + self.near.centre;
        let own = Facing { normal, by: normal_by };
        let (level, level_by) = self.level(middle, middle_by, own);
        let raised = |k: usize| middle_by[k] + outer(normal, level_by[k]) + normal_by[k] * level;
        let triangle = self.weigh(fine, smooth, middle, weights);
        Some(Footprint {
            triangle,
            middle,
            middle_by,
            normal,
            normal_by,
            origin: middle + normal * level,
            origin_by: [raised(0), raised(1)],
        })
    }

    /// Takes walls down to a plane.
    fn take_down(&mut self, fine: &Tessellation, plane: Plane) {
        let before = self.near.taken_down.replace(plane);
        if before == Some(plane) {
            return;
        }
        for near in &mut self.near.pieces {
            if before.is_some() {
                near.corners = fine.corners(near.piece);
            }
            near.take_down(&plane, self.near.margin);
        }
    }

    fn sum(&self) -> Option<Sums> {
        let mut sums = Sums {
            weight: 0.0,
            weight_by: [DVec3::ZERO; 2],
            place: DVec3::ZERO,
            place_by: [DMat3::ZERO; 2],
            normal: DVec3::ZERO,
            normal_by: [DMat3::ZERO; 2],
        };
        for near in &self.near.pieces {
            let Some((weight, by)) = near.weigh(self.near.margin) else { continue };
            let place = near.middle - self.near.centre;
            sums.weight += weight;
            sums.place += place * weight;
            sums.normal += near.normal * weight;
            for k in 0..2 {
                sums.weight_by[k] += by[k];
                sums.place_by[k] += outer(place, by[k]);
                sums.normal_by[k] += outer(near.normal, by[k]);
            }
        }
        (sums.weight > 0.0).then_some(sums)
    }

    /// Height of the plane over the middle, m, and its derivatives: no lower than any piece that the tool may touch.
    fn level(&self, middle: DVec3, middle_by: [DMat3; 2], facing: Facing) -> (f64, [DVec3; 2]) {
        let (mut level, mut by) = (f64::NEG_INFINITY, [DVec3::ZERO; 2]);
        for near in self.near.pieces.iter().filter(|near| near.normal.dot(facing.normal) > 0.0) {
            let apart = near.distance - self.near.margin;
            for corner in near.corners {
                let height = (corner - middle).dot(facing.normal) - LOWERED * apart.max(0.0);
                if height > level {
                    level = height;
                    by = [0, 1].map(|k| {
                        let lowered = if apart > 0.0 { near.by_pose[k] * LOWERED } else { DVec3::ZERO };
                        facing.by[k].transpose() * (corner - middle)
                            - middle_by[k].transpose() * facing.normal
                            - lowered
                    });
                }
            }
        }
        if level.is_finite() { (level, by) } else { (0.0, [DVec3::ZERO; 2]) }
    }

    /// Gives the fans the weights of the pieces of their triangles; the triangle next to the middle.
    fn weigh(&self, fine: &Tessellation, smooth: &SmoothSurface, middle: DVec3, weights: &mut FanWeights) -> u32 {
        weights.begin();
        let count = fine.pieces_of_triangle() as u32;
        let (mut nearest, mut all, mut touchable) = ((f64::INFINITY, 0), 0.0, 0.0);
        for near in &self.near.pieces {
            let Some((weight, by)) = near.weigh(self.near.margin) else { continue };
            let triangle = near.piece / count;
            let apart = near.middle.distance_squared(middle);
            nearest = if apart < nearest.0 { (apart, triangle) } else { nearest };
            for (&fan, part) in smooth.fans_of(triangle).iter().zip(fine.barycentric(near.piece)) {
                all += weight * part;
                if !smooth.is_touchable(fan) {
                    continue;
                }
                touchable += weight * part;
                weights.add(fan, weight * part, by.map(|by| by * part));
            }
        }
        weights.touchable = if all > 0.0 { touchable / all } else { 0.0 };
        weights.normalise();
        nearest.1
    }
}

impl NearPiece {
    /// Weight of a piece, and its derivatives by the tool's place and rotation; `None` for one that does not count.
    fn weigh(&self, margin: f64) -> Option<(f64, [DVec3; 2])> {
        let close = 1.0 - self.distance / margin;
        let (eta, rise) = rising(self.facing, FACING);
        if close <= 0.0 || eta <= 0.0 {
            return None;
        }
        let (by_distance, by_facing) = (-2.0 * close * eta / margin, close * close * rise);
        let area = self.area * self.joined;
        let by = [0, 1].map(|k| (self.by_pose[k] * by_distance + self.facing_by[k] * by_facing) * area);
        Some((area * close * close * eta, by))
    }

    /// How much it is a wall that rises before a plane: one for one that is steep, and stands in front of the plane's point.
    fn share_of_wall(&self, plane: &Plane, margin: f64) -> f64 {
        let (alike, _) = rising(self.normal.dot(plane.normal), ALIKE);
        let (before, _) = rising((plane.point - self.middle).dot(self.normal) / margin, BEFORE);
        (1.0 - alike) * before
    }

    /// Takes a wall that rises over the contact down to its plane, the more the steeper it is. Over an edge nothing is taken down:
    /// the middle lies behind both sides.
    fn take_down(&mut self, plane: &Plane, margin: f64) {
        let share = self.share_of_wall(plane, margin);
        self.joined = 1.0 - share;
        if share > 0.0 {
            for corner in &mut self.corners {
                let height = (*corner - plane.point).dot(plane.normal);
                *corner -= plane.normal * (height.max(0.0) * share);
            }
        }
    }
}

/// Rises from zero to one between two bounds, and its slope.
fn rising(at: f64, [from, to]: [f64; 2]) -> (f64, f64) {
    let t = ((at - from) / (to - from)).clamp(0.0, 1.0);
    (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t) / (to - from))
}

impl Sums {
    /// The mean normal; `known` where there is none.
    fn facing(&self, known: DVec3) -> Facing {
        let length = self.normal.length();
        if length <= COMMON * self.weight {
            return Facing { normal: known, by: [DMat3::ZERO; 2] };
        }
        let normal = self.normal / length;
        Facing { normal, by: self.normal_by.map(|by| across(normal) * by * (1.0 / length)) }
    }
}

impl PressedSurface {
    /// Adds the memory that a tick reads.
    pub(crate) fn add_memory(&self, ranges: &mut crate::memory::Ranges) {
        self.fine.add_memory(ranges);
        ranges.add(&self.fields);
    }
}

impl Footprint {
    /// The middle as a foot of the tool's place.
    pub fn foot(&self, place: DVec3) -> FootPoint {
        FootPoint {
            triangle: self.triangle,
            position: self.middle,
            normal: self.normal,
            distance: (place - self.middle).dot(self.normal),
            turning: self.normal_by[0],
            shift: self.middle_by[0],
            on_crease: false,
        }
    }
}

/// The pieces near a tool, as a relief under its cells.
pub struct NearRelief<'a> {
    /// The pieces.
    pub near: &'a NearPieces,
    /// The surface that they are of.
    pub fine: &'a Tessellation,
}

impl Relief for NearRelief<'_> {
    fn end(&self, plane: &ContactPlane, direction: DVec3, lowest: f64) -> Option<End> {
        let facing = |near: &&NearPiece| near.normal.dot(plane.axes.z_axis) > 0.0;
        End::of(self.near.pieces.iter().filter(facing).map(|near| near.corners), plane, direction, lowest)
    }

    fn fill(&self, frame: &GridFrame, heights: &mut Heights) {
        let normal = frame.axes.z_axis;
        let faces = |of: DVec3| of.dot(normal) >= LEAST_COSINE;
        for near in self.near.pieces.iter().filter(|near| faces(near.normal)) {
            heights.add_facet(frame, near.corners, self.fine.bends(near.piece));
        }
        for near in self.near.pieces.iter().filter(|near| faces(near.normal)) {
            for k in 0..3 {
                let edge = [near.corners[k], near.corners[(k + 1) % 3]];
                match self.fine.across(near.piece, k).map(|beyond| (beyond, self.fine.normal(beyond))) {
                    Some((beyond, turned)) if faces(turned) => {
                        if near.piece < beyond && self.fine.is_crease(near.piece, k) {
                            heights.even_edge(frame, edge, [near.normal, turned]);
                        }
                    }
                    _ => heights.add_edge(frame, edge, near.normal),
                }
            }
        }
    }
}
