//! Where a tool that is no sphere meets a body: the plane of the contact, as a smooth function of the tool's pose.
//!
//! The pieces `i` of the surface near the tool, at distances `s_i` from it, have the weights
//!
//! ```text
//! w_i = A_i (1 - s_i/m)^2 eta(n_i . n)        x = sum w_i x_i / sum w_i        n = sum w_i n_i / |sum w_i n_i|
//! ```
//!
//! for `s_i < m`. The contact's middle `x` and normal `n` are means over them, and so are all fields known at the nodes.
//! The factor `eta` leaves out what faces away, as the other side of a plate does. The plane of the contact is raised over `x`
//! to the highest piece that the tool may touch. Everything follows the tool's pose with derivatives that are exact but for
//! the normal inside `eta`, which is the contact's own of the tick before, taken once more.

mod near;

use glam::{DMat3, DVec3};

pub use self::near::{NearPiece, NearPieces, PosedShape};
use super::local::ContactPlane;
use super::local::cells::{End, GridFrame, Heights, LEAST_COSINE, Relief};
use super::smooth::{FanWeights, FootPoint, SmoothSurface};
use super::{SurfaceQuery, Tessellation};
use crate::tensor::{across, outer};

/// Distance from which a piece counts, over the tool's thickness.
const MARGIN: f64 = 0.3;
/// Edge of a piece at most, over the tool's thickness.
const PIECE: f64 = 0.4;
/// Cosines between a piece's normal and the contact's from which it counts, and from which it counts fully.
const FACING: [f64; 2] = [-0.2, 0.5];
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
    /// For tools of a thickness, m, in pieces of which some fit into their width.
    pub fn pieces(
        surface: &crate::mesh::Surface,
        query: &SurfaceQuery,
        smooth: &SmoothSurface,
        thickness: f64,
    ) -> Tessellation {
        Tessellation::new(surface, query, smooth, PIECE * thickness)
    }
}

/// Distance within which a tool of a thickness looks for pieces, m.
pub fn margin(thickness: f64) -> f64 {
    MARGIN * thickness
}

impl FootprintScratch {
    /// Normal of the piece that the tool is deepest in, or next to, among those that face it and the way `gone` that it has
    /// come.
    pub fn first_met(&self, gone: DVec3) -> Option<DVec3> {
        let away = AWAY * gone.length();
        let meets = |near: &&NearPiece| near.normal.dot(near.by_pose[0]) > MET && near.normal.dot(gone) <= away;
        let first = self.near.pieces.iter().filter(meets).min_by(|a, b| a.distance.total_cmp(&b.distance));
        first.map(|near| near.normal)
    }

    /// The footprint of a tool whose pieces have been gathered, and the weights of the fans below it. `None` where it is near no
    /// piece.
    pub fn find(
        &self,
        fine: &Tessellation,
        smooth: &SmoothSurface,
        facing: DVec3,
        weights: &mut FanWeights,
    ) -> Option<Footprint> {
        let first = self.sum(Facing { normal: facing, by: [DMat3::ZERO; 2] })?;
        let facing = first.facing(facing);
        let sums = self.sum(facing)?;
        let Facing { normal, by: normal_by } = sums.facing(facing.normal);
        let inverse = 1.0 / sums.weight;
        let middle = sums.place * inverse;
        let middle_by = [0, 1].map(|k| (sums.place_by[k] - outer(middle, sums.weight_by[k])) * inverse);
        let middle = middle + self.near.centre;
        let own = Facing { normal, by: normal_by };
        let (level, level_by) = self.level(middle, middle_by, own);
        let raised = |k: usize| middle_by[k] + outer(normal, level_by[k]) + normal_by[k] * level;
        let triangle = self.weigh(fine, smooth, (middle, facing), weights);
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

    fn sum(&self, facing: Facing) -> Option<Sums> {
        let mut sums = Sums {
            weight: 0.0,
            weight_by: [DVec3::ZERO; 2],
            place: DVec3::ZERO,
            place_by: [DMat3::ZERO; 2],
            normal: DVec3::ZERO,
            normal_by: [DMat3::ZERO; 2],
        };
        for near in &self.near.pieces {
            let Some((weight, by)) = facing.weigh(near, self.near.margin) else { continue };
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
    fn weigh(
        &self,
        fine: &Tessellation,
        smooth: &SmoothSurface,
        (middle, facing): (DVec3, Facing),
        weights: &mut FanWeights,
    ) -> u32 {
        weights.begin();
        let count = fine.pieces_of_triangle() as u32;
        let (mut nearest, mut all, mut touchable) = ((f64::INFINITY, 0), 0.0, 0.0);
        for near in &self.near.pieces {
            let Some((weight, by)) = facing.weigh(near, self.near.margin) else { continue };
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

impl Facing {
    /// Weight of a piece, and its derivatives by the tool's place and rotation; `None` for one that does not count.
    fn weigh(&self, near: &NearPiece, margin: f64) -> Option<(f64, [DVec3; 2])> {
        let close = 1.0 - near.distance / margin;
        let t = ((near.normal.dot(self.normal) - FACING[0]) / (FACING[1] - FACING[0])).min(1.0);
        if close <= 0.0 || t <= 0.0 {
            return None;
        }
        let (eta, rise) = (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t) / (FACING[1] - FACING[0]));
        let by = [0, 1].map(|k| {
            let turned = self.by[k].transpose() * near.normal;
            (near.by_pose[k] * (-2.0 * close * eta / margin) + turned * (close * close * rise)) * near.area
        });
        Some((near.area * close * close * eta, by))
    }
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
