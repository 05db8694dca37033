//! Pieces of a surface near a tool, and their distances from it.

use glam::{DMat3, DVec3};

use super::{OtherPlanes, Plane, PressedSurface};
use crate::contact::shape::ToolShape;
use crate::contact::tessellation::Piece;
use crate::contact::{SurfaceQuery, Tessellation};
use crate::tensor::{across, outer, skew};

/// Motion of a tool, over its thickness, below which the near pieces stay the same.
const MOVED: f64 = 1e-3;
/// Most near pieces: their memory is allocated before the first tick.
const MAX_PIECES: usize = 8192;
const MAX_OPPOSITE: usize = 1024;
/// Factor of the height above the headroom that is added to a piece's distance.
const HEADROOM_SLOPE: f64 = 2.0;
/// Depth, over the tool's half height, beyond which the viewpoint is lifted by the excess.
const UNLIFTED_DEPTH: f64 = 0.5;
/// Radius of a ball around a triangle that its pieces do not leave by rounding.
const BALL_ROUNDING: f64 = 1.0 + 1e-9;

/// A tool's shape at a pose over a surface.
#[derive(Clone, Copy)]
pub struct PlacedShape<'a> {
    /// The tool.
    pub shape: &'a ToolShape,
    /// Position of its origin, m.
    pub position: DVec3,
    /// Its axes as columns.
    pub rotation: DMat3,
    /// Unit normal of the contact, zero before there is one. Points above the tool's middle along it are measured at the middle's
    /// height: a tool that lies completely inside still has contact with the surface that it came through.
    pub contact_normal: DVec3,
    /// Latest depth of the tool in the surface, m.
    pub penetration: f64,
}

/// A piece near the tool.
#[derive(Clone, Copy, Debug, Default)]
pub struct NearPiece {
    /// Its rank.
    pub piece: u32,
    /// Its corners, m.
    pub corners: [DVec3; 3],
    /// The middle of these, m.
    pub middle: DVec3,
    /// Unit outward normal.
    pub normal: DVec3,
    /// Its area, m^2.
    pub area: f64,
    /// Farthest corner from the middle, m.
    pub size: f64,
    /// Share that belongs to the contact: less than one for a wall that rises over it.
    pub contact_share: f64,
    /// Distance of the middle from the tool, m, negative inside.
    pub distance: f64,
    /// Its derivatives by the tool's position, and by its rotation about its origin, m.
    pub by_pose: [DVec3; 2],
    /// The tool's own normal, from the piece towards the tool, as of the latest search until its derivatives have been found.
    pub tool_normal: DVec3,
    /// Share to which it faces the tool.
    pub facing: f64,
    /// Its derivatives by the tool's position and rotation.
    pub facing_by: [DVec3; 2],
}

/// The pieces near a tool.
#[derive(Clone, Debug)]
pub struct NearPieces {
    /// In the order of the search.
    pub pieces: Vec<NearPiece>,
    /// Pieces near the tool's other sides, out of reach of the contact's plane.
    pub opposite: Vec<NearPiece>,
    /// Middle of the tool, m.
    pub centre: DVec3,
    /// Distance from which pieces count, m.
    pub margin: f64,
    /// The plane to which walls have been flattened, beside which others.
    pub(super) flattened_to: Option<(Plane, OtherPlanes)>,
    /// Derivatives of the tool's normals at the pieces by its position and rotation, where they have been found.
    pub(super) turnings: Vec<[DMat3; 2]>,
    /// Key of the latest search, and the present position of the tool, m.
    key: Option<SearchKey>,
    position: DVec3,
}

/// Key of a search for pieces.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SearchKey {
    /// Address of the surface.
    surface: usize,
    rotation: DMat3,
    contact_normal: DVec3,
    penetration: f64,
    searched_at: DVec3,
}

impl Default for NearPieces {
    /// With memory for any tool.
    fn default() -> Self {
        Self {
            pieces: Vec::with_capacity(MAX_PIECES),
            opposite: Vec::with_capacity(MAX_OPPOSITE),
            centre: DVec3::ZERO,
            margin: 0.0,
            flattened_to: None,
            turnings: Vec::with_capacity(MAX_PIECES),
            key: None,
            position: DVec3::ZERO,
        }
    }
}

impl PlacedShape<'_> {
    /// Middle of the tool, m.
    pub fn centre(&self) -> DVec3 {
        self.position + self.rotation * self.shape.centre()
    }

    /// The tool's point that reaches farthest in a direction, m.
    pub fn support(&self, direction: DVec3) -> DVec3 {
        self.position + self.rotation * self.shape.support(self.rotation.transpose() * direction)
    }

    /// Largest height of the surface above its middle, m.
    fn headroom(&self, margin: f64) -> f64 {
        let half = (self.centre() - self.support(-self.contact_normal)).dot(self.contact_normal);
        (self.penetration - half).max(0.0) + margin
    }

    /// The point that pieces must face for the tool to press on them: its middle, lifted along the contact's normal if it lies
    /// deep.
    fn viewpoint(&self, centre: DVec3) -> DVec3 {
        let half = (centre - self.support(-self.contact_normal)).dot(self.contact_normal);
        centre + self.contact_normal * (self.penetration - UNLIFTED_DEPTH * half).max(0.0)
    }

    /// Distance of a point from the tool, and its derivatives by position and rotation.
    fn distance(&self, point: DVec3, centre: DVec3, headroom: f64) -> (f64, [DVec3; 2]) {
        let arm = centre - self.position;
        let above = (point - centre).dot(self.contact_normal).max(0.0);
        let at = point - self.contact_normal * above;
        let (mut distance, gradient) = self.shape.signed_distance(self.rotation.transpose() * (at - self.position));
        let gradient = self.rotation * gradient;
        let mut by_pose = [-gradient, gradient.cross(at - self.position)];
        // The height of the middle moves with the tool.
        let mut rise = if above > 0.0 { gradient.dot(self.contact_normal) } else { 0.0 };
        if above > headroom {
            distance += HEADROOM_SLOPE * (above - headroom);
            rise -= HEADROOM_SLOPE;
        }
        by_pose[0] += self.contact_normal * rise;
        by_pose[1] += arm.cross(self.contact_normal) * rise;
        (distance, by_pose)
    }

    /// The tool's normal at a point, from the point towards the tool.
    fn direction(&self, point: DVec3, centre: DVec3) -> DVec3 {
        let (is_above, at) = self.lowered(point, centre);
        let gradient = self.rotation * self.shape.rounded_direction(self.rotation.transpose() * at);
        if is_above { self.contact_normal * gradient.dot(self.contact_normal) - gradient } else { -gradient }
    }

    /// Whether a point lies above the tool's middle, and the offset from the tool's position of the point, lowered to the middle then.
    fn lowered(&self, point: DVec3, centre: DVec3) -> (bool, DVec3) {
        let above = (point - centre).dot(self.contact_normal);
        (above > 0.0, point - self.contact_normal * above.max(0.0) - self.position)
    }

    /// The tool's normal at a point, and its derivatives by position and rotation.
    ///
    /// With the gradient `g` of the distance, which turns by `H`, and the projection `P` across the contact's normal above the
    /// tool's middle, the normal is `-P g`.
    fn normal(&self, point: DVec3, centre: DVec3) -> (DVec3, [DMat3; 2]) {
        let normal = self.contact_normal;
        let (is_above, at) = self.lowered(point, centre);
        let (gradient, turning) = self.shape.rounded_gradient(self.rotation.transpose() * at);
        let turning = self.rotation * turning * self.rotation.transpose();
        let gradient = self.rotation * gradient;
        if !is_above {
            return (-gradient, [turning, skew(gradient) - turning * skew(at)]);
        }
        let level = across(normal);
        let lifted = outer(normal, (centre - self.position).cross(normal)) + skew(at);
        (-(level * gradient), [level * turning * level, level * (skew(gradient) - turning * lifted)])
    }
}

impl NearPieces {
    /// Finds the pieces of a surface near the tool. If the tool has hardly moved since the last search, as in most steps of
    /// Newton's method, the pieces are the same, and their distances are extrapolated with an error of a millionth of the tool's
    /// thickness.
    pub fn find(&mut self, pressed: &PressedSurface, query: &SurfaceQuery, tool: &PlacedShape<'_>) {
        let key = |searched_at| SearchKey {
            surface: std::ptr::from_ref(pressed) as usize,
            rotation: tool.rotation,
            contact_normal: tool.contact_normal,
            penetration: tool.penetration,
            searched_at,
        };
        if let Some(previous) = self.key
            && previous == key(previous.searched_at)
            && tool.position.distance(previous.searched_at) < MOVED * tool.shape.thickness()
        {
            return self.shift(tool.position - self.position);
        }
        (self.key, self.position) = (Some(key(tool.position)), tool.position);
        self.search(pressed, query, tool);
    }

    /// Invalidates the latest search. A tick must not depend on the searches of previous ticks, and another surface may have the
    /// same address.
    pub fn invalidate(&mut self) {
        self.key = None;
    }

    /// Moves the tool by a displacement, m.
    fn shift(&mut self, displacement: DVec3) {
        self.position += displacement;
        self.centre += displacement;
        for (near, turning) in self.pieces.iter_mut().zip(&self.turnings) {
            near.tool_normal += turning[0] * displacement;
        }
        for near in self.pieces.iter_mut().chain(&mut self.opposite) {
            near.distance += near.by_pose[0].dot(displacement);
            near.facing += near.facing_by[0].dot(displacement);
        }
    }

    /// Finds the tool's normals and their derivatives at the pieces that count, once after a search.
    pub(super) fn find_turnings(&mut self, tool: &PlacedShape<'_>) {
        if !self.turnings.is_empty() {
            return;
        }
        let (centre, reach) = (self.centre, self.margin + MOVED * tool.shape.thickness());
        for near in &mut self.pieces {
            let mut turning = [DMat3::ZERO; 2];
            if near.distance < reach {
                (near.tool_normal, turning) = tool.normal(near.middle, centre);
            }
            self.turnings.push(turning);
        }
    }

    fn search(&mut self, pressed: &PressedSurface, query: &SurfaceQuery, tool: &PlacedShape<'_>) {
        let (fine, margin) = (&pressed.fine, pressed.margin);
        self.flattened_to = None;
        self.turnings.clear();
        self.pieces.clear();
        self.opposite.clear();
        (self.centre, self.margin) = (tool.centre(), margin);
        let (centre, headroom) = (self.centre, tool.headroom(margin));
        let viewpoint = tool.viewpoint(centre);
        let reach =
            |axis: DVec3| tool.support(axis).dot(axis) + margin + (headroom * tool.contact_normal.dot(axis)).max(0.0);
        let high = DVec3::from_array(DVec3::AXES.map(reach));
        let low = -DVec3::from_array(DVec3::AXES.map(|axis| reach(-axis)));
        if !(low.is_finite() && high.is_finite()) {
            return;
        }
        let lifted = View { tool, centre, headroom, viewpoint };
        let unlifted = PlacedShape { contact_normal: DVec3::ZERO, penetration: 0.0, ..*tool };
        let unlifted = View { tool: &unlifted, centre, headroom: 0.0, viewpoint: centre };
        query.for_each_within(low, high, |triangle| {
            let (ball, radius) = fine.ball(triangle);
            let count = fine.pieces_of_triangle() as u32;
            let is_near = lifted.distance(ball).0 < radius + margin;
            // Up to the tool's middle both distances are the same.
            let is_above = (ball - centre).dot(tool.contact_normal) + BALL_ROUNDING * radius > 0.0;
            let is_full = self.pieces.len() + count as usize > MAX_PIECES;
            let is_opposite = (is_above || is_full) && unlifted.distance(ball).0 < radius + margin;
            if !is_near && !is_opposite {
                return;
            }
            for piece in triangle * count..(triangle + 1) * count {
                match lifted.near_piece(fine, piece, margin) {
                    Some(near) if self.pieces.len() < MAX_PIECES => self.pieces.push(near),
                    _ if is_opposite && self.opposite.len() < MAX_OPPOSITE => {
                        self.opposite.extend(unlifted.near_piece(fine, piece, margin));
                    }
                    _ => {}
                }
            }
        });
    }
}

/// A tool over the surface, with what is the same for all pieces.
#[derive(Clone, Copy)]
struct View<'a> {
    tool: &'a PlacedShape<'a>,
    centre: DVec3,
    headroom: f64,
    viewpoint: DVec3,
}

impl View<'_> {
    fn distance(&self, point: DVec3) -> (f64, [DVec3; 2]) {
        self.tool.distance(point, self.centre, self.headroom)
    }

    /// A piece within a margin of the tool.
    fn near_piece(&self, fine: &Tessellation, piece: u32, margin: f64) -> Option<NearPiece> {
        let &Piece { middle, normal, area, size } = fine.piece(piece);
        let (distance, by_pose) = self.distance(middle);
        if distance.is_nan() || distance >= size + margin {
            return None;
        }
        let (facing, facing_by) = self.tool.facing((middle, normal), self.viewpoint);
        Some(NearPiece {
            piece,
            corners: fine.corners(piece),
            middle,
            normal,
            area,
            size,
            contact_share: 1.0,
            distance,
            by_pose,
            // Farther away it counts nothing until the next search.
            tool_normal: match distance < margin + MOVED * self.tool.shape.thickness() {
                true => self.tool.direction(middle, self.centre),
                false => DVec3::ZERO,
            },
            facing,
            facing_by,
        })
    }
}
