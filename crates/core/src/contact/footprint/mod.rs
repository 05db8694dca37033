//! Footprint of a tool that is not a sphere: the plane of its contact, as a smooth function of the tool's pose.
//!
//! The pieces `i` of the surface near the tool, at distances `s_i` from it, have the weights
//!
//! ```text
//! w_i = A_i (1 - s_i/m)^2 eta(n_i . d_i)      x = sum w_i x_i / sum w_i        n = sum w_i n_i / |sum w_i n_i|
//! ```
//!
//! for `s_i < m`. The contact's middle `x` and normal `n` are means over them, and so are all fields known at the nodes. Over a sharp
//! edge `n_i` is the tool's own normal instead (`edge_normal`), for the mean of the sides' turns over between them. The factor
//! `eta` excludes pieces that face away from the tool's middle, in the direction `d_i`, as the other side of a plate does, and below
//! a capsule's shaft those whose normal is along its axis (`facing`). The plane of the contact is raised over `x` to the highest piece that the tool
//! may touch. All this is a function of the tool's pose alone with exact derivatives, as long as the tool's middle has not sunk in;
//! from then on the middle is taken as lifted along the contact's normal of the tick before.
//!
//! Heights over one plane cannot describe a floor and a wall that stands on it. A wall that rises over the plane of the previous
//! tick is therefore flattened to that plane, completely if it is steeper than 78 degrees and not at all up to 45. It is pressed by
//! an additional contact of the same tool, on a plane of its own. A piece belongs to the plane that it is most parallel to.

mod crest;
mod edge_normal;
mod facing;
mod near;

use glam::{DMat3, DVec3};

pub use self::crest::Crest;
pub use self::near::{NearPiece, NearPieces, PlacedShape};
use super::local::ContactPlane;
use super::local::cells::{GridFrame, Heights, LEAST_COSINE, Relief, SurfaceEnd, Wedge};
use super::smooth::{FanWeights, FootPoint, SmoothSurface};
use super::{SurfaceQuery, Tessellation};
use crate::tensor::{across, outer};

/// Distance within which a piece counts, over the tool's thickness, and its least value over the edge of a piece: larger than the
/// distance of any point of a piece from its middle.
const MARGIN: [f64; 2] = [0.3, 0.75];
/// Longest edge of a piece, over the tool's thickness.
const PIECE: f64 = 0.4;
/// Cosines between the normals of a rising wall and of the contact's plane from which the wall belongs to the contact, and belongs
/// fully.
const SAME_CONTACT: [f64; 2] = [0.2, 0.7];
/// Distance of a wall from the contact's middle, across the edge between them and over the tool's thickness, from which it need not
/// be steep to be another place.
const APART: f64 = 2.0;
/// By how much a piece is more parallel to another plane of the tool, as a difference of cosines, from which it begins to belong to
/// that one, and belongs to it fully.
const BETTER_PLANE: [f64; 2] = [0.0, 0.3];
/// Distances of the contact's middle in front of a piece, over the margin, from which the piece is such a wall, and fully one.
const IN_FRONT: [f64; 2] = [0.0, 0.5];
/// Share of a wall from which a piece is pressed by an additional contact.
const WALL_SHARE: f64 = 0.9;
/// Length of the sum of normals, over the sum of their weights, below which they have no common direction.
const LEAST_COMMON_NORMAL: f64 = 0.05;
/// Distance of a piece from the tool lowers its height for the plane by this factor.
const DISTANCE_SLOPE: f64 = 4.0;
/// Largest cosine between a piece's normal and the motion of the tool, which does not come through the body.
const MOTION_COSINE: f64 = 0.5;
/// Least cosine between a piece's normal and the direction to the tool for a contact to begin there.
const LEAST_FACING: f64 = 0.2;
/// Least share to which a wall faces the tool: that of about the same cosine to the tool's middle.
const LEAST_FACING_WALL: f64 = 0.394;

/// A surface for tools that are not spheres.
pub struct PressedSurface {
    /// Its pieces, as fine as the tool needs.
    pub fine: Tessellation,
    /// Distance from the tool within which pieces count, m.
    pub margin: f64,
    /// Fields at the fans, each smoothed with those around it.
    pub fields: Vec<super::FanFields>,
}

/// The plane of a contact, and its derivatives by the tool's position and its rotation about its origin.
#[derive(Clone, Copy, Debug)]
pub struct Footprint {
    /// The drawn triangle next to the middle.
    pub triangle: u32,
    /// Mean position of the contact on the body, m.
    pub middle: DVec3,
    /// Its derivatives by the tool's position and by its rotation.
    pub middle_by: [DMat3; 2],
    /// Unit outward normal.
    pub normal: DVec3,
    /// Its derivatives.
    pub normal_by: [DMat3; 2],
    /// Point of the plane over the middle, m.
    pub origin: DVec3,
    /// Its derivatives.
    pub origin_by: [DMat3; 2],
    /// The crest that it lies on.
    pub crest: Option<Crest>,
}

/// A contact's plane of the previous tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// A point of it, m.
    pub point: DVec3,
    /// Unit outward normal.
    pub normal: DVec3,
}

/// Most other planes that a tool presses on.
pub const MAX_OTHERS: usize = 3;

/// Planes that a tool presses on beside that of a contact, `None` for none.
pub type OtherPlanes = [Option<Plane>; MAX_OTHERS];

/// Memory of a search.
#[derive(Clone, Debug, Default)]
pub struct FootprintScratch {
    /// The pieces near the tool.
    pub near: NearPieces,
    /// The tool's other planes: pieces that are more parallel to one of them belong to it.
    pub others: OtherPlanes,
}

/// Mean normal of the pieces, and its derivatives by the tool's position and rotation.
#[derive(Clone, Copy)]
struct MeanNormal {
    normal: DVec3,
    by: [DMat3; 2],
}

/// Weight or share of a piece, and its derivatives by the tool's position and rotation.
type Weight = (f64, [DVec3; 2]);

/// Sums over pieces; positions are relative to the tool's middle.
#[derive(Clone, Copy)]
struct Sums {
    weight: f64,
    weight_by: [DVec3; 2],
    place: DVec3,
    place_by: [DMat3; 2],
    normal: DVec3,
    normal_by: [DMat3; 2],
    /// Of places along their pieces' normals.
    offset: f64,
    /// Weight of the walls beside them, which are no part of the contact.
    walls: f64,
    /// Difference of the tool's normals, as of the latest search, and the pieces' own, where the former may count.
    difference: DVec3,
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
        Self { fine, margin, fields: smooth.smoothed(fields) }
    }
}

impl FootprintScratch {
    /// Plane of the piece that the tool is deepest in, or next to, among those that face it and its `displacement`.
    pub fn first_touched(&self, displacement: DVec3) -> Option<Plane> {
        let away = MOTION_COSINE * displacement.length();
        let meets = |near: &&NearPiece| {
            near.normal.dot(near.by_pose[0]) > LEAST_FACING && near.normal.dot(displacement) <= away
        };
        let first = self.near.pieces.iter().filter(meets).min_by(|a, b| a.distance.total_cmp(&b.distance));
        first.map(|near| Plane { point: near.middle, normal: near.normal })
    }

    /// Plane of the nearest piece of a wall that stands on all planes that a tool presses on, or faces them across the tool. Pieces
    /// out of reach of the plane that was `pressed` last have no part in it, so that a less steep one is a wall too: a long tool lies
    /// with both its ends in a flat valley.
    pub fn wall_beside(&self, pressed: &Plane, thickness: f64) -> Option<Plane> {
        let margin = self.near.margin;
        let faces = |near: &&NearPiece| near.facing > LEAST_FACING_WALL;
        let stands_on = |near: &NearPiece, plane: &Plane| near.share_of_wall(plane, &[], margin) > WALL_SHARE;
        let stands_on_others = |near: &&NearPiece| self.others.iter().flatten().all(|plane| stands_on(near, plane));
        let within = self.near.pieces.iter().filter(|near| stands_on(near, pressed));
        let beyond = self
            .near
            .opposite
            .iter()
            .filter(|near| stands_on(near, pressed) || near.faces_across(pressed, margin, APART * thickness));
        let walls = within.chain(beyond).filter(faces).filter(stands_on_others);
        let nearest = walls.min_by(|a, b| a.distance.total_cmp(&b.distance))?;
        Some(Plane { point: nearest.middle, normal: nearest.normal })
    }

    /// The footprint of a tool whose near pieces are known, and the weights of the fans below it. `None` if no piece is near.
    pub fn find(
        &mut self,
        tool: &PlacedShape<'_>,
        (fine, smooth): (&Tessellation, &SmoothSurface),
        known: Plane,
        weights: &mut FanWeights,
    ) -> Option<Footprint> {
        self.flatten_walls(fine, known);
        let reach = edge_normal::reach(tool.shape);
        let mut sums = self.sum(reach)?;
        let crest = reach.and_then(|reach| self.turn_to_tool(tool, reach, &mut sums));
        let MeanNormal { normal, by: normal_by } = sums.mean_normal(known.normal);
        let inverse = 1.0 / sums.weight;
        let middle = sums.place * inverse;
        let middle_by = [0, 1].map(|k| (sums.place_by[k] - outer(middle, sums.weight_by[k])) * inverse);
        let middle = middle + self.near.centre;
        let mean_normal = MeanNormal { normal, by: normal_by };
        let (level, level_by) = self.level(fine, (middle, middle_by), mean_normal);
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
            crest,
        })
    }

    /// Flattens walls to a plane.
    fn flatten_walls(&mut self, fine: &Tessellation, plane: Plane) {
        let before = self.near.flattened_to.replace((plane, self.others));
        if before == Some((plane, self.others)) {
            return;
        }
        for near in &mut self.near.pieces {
            if before.is_some() {
                near.corners = fine.corners(near.piece);
            }
            near.flatten_walls(&plane, &self.others, self.near.margin);
        }
    }

    fn sum(&self, reach: Option<f64>) -> Option<Sums> {
        let mut sums = Sums {
            weight: 0.0,
            weight_by: [DVec3::ZERO; 2],
            place: DVec3::ZERO,
            place_by: [DMat3::ZERO; 2],
            normal: DVec3::ZERO,
            normal_by: [DMat3::ZERO; 2],
            offset: 0.0,
            walls: 0.0,
            difference: DVec3::ZERO,
        };
        for near in &self.near.pieces {
            let Some([(weight, by), (whole, _)]) = near.weigh_with_wall(self.near.margin) else { continue };
            let place = near.middle - self.near.centre;
            sums.walls += whole - weight;
            sums.weight += weight;
            sums.place += place * weight;
            sums.normal += near.normal * weight;
            sums.offset += place.dot(near.normal) * weight;
            if let Some(reach) = reach {
                sums.difference += near.difference(reach) * weight;
            }
            for k in 0..2 {
                sums.weight_by[k] += by[k];
                sums.place_by[k] += outer(place, by[k]);
                sums.normal_by[k] += outer(near.normal, by[k]);
            }
        }
        (sums.weight > 0.0).then_some(sums)
    }

    /// Height of the plane over the middle, m, and its derivatives: no lower than any point of a piece that the tool may touch.
    /// Were one higher, a flat tool would have a force before it reaches the plane.
    fn level(
        &self,
        fine: &Tessellation,
        (middle, middle_by): (DVec3, [DMat3; 2]),
        mean: MeanNormal,
    ) -> (f64, [DVec3; 2]) {
        let (mut level, mut by) = (f64::NEG_INFINITY, [DVec3::ZERO; 2]);
        for near in self.near.pieces.iter().filter(|near| near.normal.dot(mean.normal) > 0.0) {
            let apart = near.distance - self.near.margin;
            let lower = DISTANCE_SLOPE * apart.max(0.0);
            let highest =
                near.corners.map(|corner| (corner - middle).dot(mean.normal)).into_iter().fold(f64::MIN, f64::max);
            if highest + fine.most_over_corners() - lower <= level {
                continue;
            }
            for (top, over) in fine.highest_points(near.piece, near.corners, mean.normal) {
                let height = (top - middle).dot(mean.normal) + over - lower;
                if height > level {
                    level = height;
                    by = [0, 1].map(|k| {
                        let lowered = if apart > 0.0 { near.by_pose[k] * DISTANCE_SLOPE } else { DVec3::ZERO };
                        mean.by[k].transpose() * (top - middle) - middle_by[k].transpose() * mean.normal - lowered
                    });
                }
            }
        }
        if level.is_finite() { (level, by) } else { (0.0, [DVec3::ZERO; 2]) }
    }

    /// Sets the weights of the fans from those of the pieces of their triangles; returns the triangle next to the middle.
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
    /// Weight of a piece in the contact, and its derivatives by the tool's position and rotation; `None` for zero.
    fn weigh(&self, margin: f64) -> Option<Weight> {
        self.weigh_with_wall(margin).map(|[weight, _]| weight)
    }

    /// Weight of a piece in the contact, and that in the contact and in a wall together; `None` where the latter is zero.
    fn weigh_with_wall(&self, margin: f64) -> Option<[Weight; 2]> {
        let nearness = 1.0 - self.distance / margin;
        if nearness <= 0.0 {
            return None;
        }
        let eta = self.facing;
        if eta <= 0.0 {
            return None;
        }
        let by_distance = -2.0 * nearness * eta / margin;
        let by_pose =
            |k: usize| (self.by_pose[k] * by_distance + self.facing_by[k] * (nearness * nearness)) * self.area;
        let by = [by_pose(0), by_pose(1)];
        let whole = self.area * nearness * nearness * eta;
        let share = self.contact_share;
        Some([(whole * share, [by[0] * share, by[1] * share]), (whole, by)])
    }

    /// Share to which the piece is a wall rising over a plane: one if it is steep, or more parallel to one of the `others`, and the
    /// plane's point lies in front of it.
    fn share_of_wall(&self, plane: &Plane, others: &[Option<Plane>], margin: f64) -> f64 {
        let cosine = self.normal.dot(plane.normal);
        let better = others.iter().flatten().map(|other| self.normal.dot(other.normal)).fold(-1.0, f64::max);
        let (belonging, _) = smooth_step(cosine, SAME_CONTACT);
        let (elsewhere, _) = smooth_step(better - cosine, BETTER_PLANE);
        (1.0 - belonging * (1.0 - elsewhere)) * self.share_in_front(plane, margin)
    }

    /// Share to which the plane's point lies in front of the piece.
    fn share_in_front(&self, plane: &Plane, margin: f64) -> f64 {
        smooth_step((plane.point - self.middle).dot(self.normal) / margin, IN_FRONT).0
    }

    /// Whether the piece and the plane face each other, at an angle at which they cannot be one contact, and at a distance from the
    /// plane's point across their common edge, m.
    fn faces_across(&self, plane: &Plane, margin: f64, distance: f64) -> bool {
        let (edge, offset) = (self.normal.cross(plane.normal).normalize_or_zero(), self.middle - plane.point);
        let is_apart = (offset - edge * offset.dot(edge)).length() > distance;
        is_apart && self.normal.dot(plane.normal) < SAME_CONTACT[1] && self.share_in_front(plane, margin) > WALL_SHARE
    }

    /// Flattens a wall that rises over the contact to its plane, the more the steeper it is. Over a convex edge nothing is
    /// flattened: the middle lies behind both sides.
    fn flatten_walls(&mut self, plane: &Plane, others: &OtherPlanes, margin: f64) {
        let share = self.share_of_wall(plane, others, margin);
        self.contact_share = 1.0 - share;
        if share > 0.0 {
            for corner in &mut self.corners {
                let height = (*corner - plane.point).dot(plane.normal);
                *corner -= plane.normal * (height.max(0.0) * share);
            }
        }
    }
}

/// Smooth step from zero to one between two bounds, and its slope.
pub(super) fn smooth_step(at: f64, [from, to]: [f64; 2]) -> (f64, f64) {
    let t = ((at - from) / (to - from)).clamp(0.0, 1.0);
    (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t) / (to - from))
}

impl Sums {
    /// The mean normal; `known` where there is none.
    fn mean_normal(&self, known: DVec3) -> MeanNormal {
        let length = self.normal.length();
        if length <= LEAST_COMMON_NORMAL * self.weight {
            return MeanNormal { normal: known, by: [DMat3::ZERO; 2] };
        }
        let normal = self.normal / length;
        MeanNormal { normal, by: self.normal_by.map(|by| across(normal) * by * (1.0 / length)) }
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
    /// The middle as a foot of the tool's position.
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
    /// Their surface.
    pub fine: &'a Tessellation,
}

impl NearRelief<'_> {
    /// Normal, of any length, of a piece as its wall is flattened: its slope is less by the wall's share.
    fn flattened_normal(&self, piece: &NearPiece) -> DVec3 {
        let Some((plane, others)) = &self.near.flattened_to else { return piece.normal };
        let upright = plane.normal * piece.normal.dot(plane.normal);
        upright + (piece.normal - upright) * (1.0 - piece.share_of_wall(plane, others, self.near.margin))
    }
}

impl Relief for NearRelief<'_> {
    fn end(&self, plane: &ContactPlane, direction: DVec3, (lowest, enough): (f64, f64)) -> Option<SurfaceEnd> {
        let facing = |near: &&NearPiece| near.normal.dot(plane.axes.z_axis) > 0.0;
        let corners = self.near.pieces.iter().filter(facing).map(|near| near.corners);
        SurfaceEnd::of(corners, plane, direction, (lowest, enough))
    }

    fn fill(&self, frame: &GridFrame, heights: &mut Heights) {
        let normal = frame.axes.z_axis;
        let faces = |of: DVec3| of.dot(normal) >= LEAST_COSINE;
        for near in self.near.pieces.iter().filter(|near| faces(near.normal)) {
            heights.add_facet(frame, near.corners, self.fine.bulges(near.piece));
        }
        for near in &self.near.pieces {
            for k in 0..3 {
                let edge = [near.corners[k], near.corners[(k + 1) % 3]];
                let across =
                    self.fine.across(near.piece, k).map(|neighbour| (neighbour, self.fine.piece(neighbour).normal));
                let is_crease = self.fine.is_crease(near.piece, k);
                if let Some((neighbour, other_normal)) = across
                    && faces(near.normal)
                    && faces(other_normal)
                {
                    if near.piece < neighbour && is_crease {
                        let other =
                            NearPiece { normal: other_normal, middle: self.fine.piece(neighbour).middle, ..*near };
                        heights.smooth_edge(frame, edge, [near, &other].map(|piece| self.flattened_normal(piece)));
                    }
                } else if faces(near.normal) {
                    heights.add_edge(frame, edge, Some(near.normal));
                } else if let Some((_, other_normal)) = across
                    && is_crease
                    && !faces(other_normal)
                    && (near.normal + other_normal).dot(normal) > 0.0
                {
                    // A blade with both sides steeper than heights may be.
                    heights.add_edge(frame, edge, None);
                }
                if let Some((_, other_normal)) = across.filter(|_| is_crease)
                    && let Some(wedge) = Wedge::new(near.normal, other_normal, edge[1] - edge[0])
                {
                    heights.soften(frame, edge, &wedge, self.near.margin);
                }
            }
        }
    }
}
