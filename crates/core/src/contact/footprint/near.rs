//! Pieces of a surface near a tool, and how far the tool is from each.

use glam::{DMat3, DVec3};

use super::{Plane, PressedSurface};
use crate::contact::shape::ToolShape;
use crate::contact::{SurfaceQuery, Tessellation};

/// A tool that has moved by less than this, over its thickness, is next to the same pieces.
const MOVED: f64 = 1e-3;
/// Most pieces that are looked at: their memory is there before a tick.
const MOST_PIECES: usize = 8192;
const MOST_OPPOSITE: usize = 1024;
/// A piece farther above the middle of the tool than it can be is pushed away by this many times the difference.
const BEYOND: f64 = 2.0;
/// The viewpoint of a tool that has sunk in deeper than this part of its half height is lifted by the rest of the depth.
const UNLIFTED: f64 = 0.5;
/// Next to the viewpoint directions are blurred over this part of the tool's thickness.
const BLUR: f64 = 0.1;

/// A tool over a surface.
#[derive(Clone, Copy)]
pub struct PosedShape<'a> {
    /// The tool.
    pub shape: &'a ToolShape,
    /// Where its origin is, m.
    pub place: DVec3,
    /// Its axes as columns.
    pub rotation: DMat3,
    /// Unit normal of the contact as it is known, zero where none is. What lies above the tool's middle along it is measured
    /// at that height: a tool that has sunk in as a whole still meets the surface that it came through.
    pub facing: DVec3,
    /// How deep the tool is in the surface as far as it is known, m.
    pub sunk: f64,
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
    /// Share that belongs to the contact: less than one of a wall that rises over it.
    pub joined: f64,
    /// Of the middle from the tool, m, negative inside.
    pub distance: f64,
    /// Its derivatives by the tool's place, and by its rotation about its origin, m.
    pub by_pose: [DVec3; 2],
    /// Cosine between the normal and the direction to the tool's viewpoint.
    pub facing: f64,
    /// Its derivatives by the tool's place and rotation.
    pub facing_by: [DVec3; 2],
}

/// The pieces near a tool.
#[derive(Clone, Debug)]
pub struct NearPieces {
    /// In the order of the search.
    pub pieces: Vec<NearPiece>,
    /// Those that the tool's other side is near to, beyond what the contact's plane can reach.
    pub opposite: Vec<NearPiece>,
    /// Middle of the tool, m.
    pub centre: DVec3,
    /// Distance from which pieces count, m.
    pub margin: f64,
    /// The plane to which walls have been taken down.
    pub(super) taken_down: Option<Plane>,
    /// What they have been looked for with, and the tool's place then, m.
    key: Option<Key>,
    place: DVec3,
}

/// All but the place.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Key {
    /// Address of the surface.
    surface: usize,
    rotation: DMat3,
    facing: DVec3,
    sunk: f64,
    looked_for_at: DVec3,
}

impl Default for NearPieces {
    /// With the memory for any tool.
    fn default() -> Self {
        Self {
            pieces: Vec::with_capacity(MOST_PIECES),
            opposite: Vec::with_capacity(MOST_OPPOSITE),
            centre: DVec3::ZERO,
            margin: 0.0,
            taken_down: None,
            key: None,
            place: DVec3::ZERO,
        }
    }
}

impl PosedShape<'_> {
    /// Middle of the tool, m.
    pub fn centre(&self) -> DVec3 {
        self.place + self.rotation * self.shape.centre()
    }

    /// The tool's point that reaches farthest in a direction, m.
    pub fn support(&self, direction: DVec3) -> DVec3 {
        self.place + self.rotation * self.shape.support(self.rotation.transpose() * direction)
    }

    /// How far above its middle the surface may lie, m.
    fn headroom(&self, margin: f64) -> f64 {
        let half = (self.centre() - self.support(-self.facing)).dot(self.facing);
        (self.sunk - half).max(0.0) + margin
    }

    /// The point that pieces must face for the tool to press on them: its middle, lifted along the contact's normal if it has sunk in.
    fn viewpoint(&self, centre: DVec3) -> DVec3 {
        let half = (centre - self.support(-self.facing)).dot(self.facing);
        centre + self.facing * (self.sunk - UNLIFTED * half).max(0.0)
    }

    /// Cosine between a normal and the direction to the viewpoint, and its derivatives by place and rotation.
    fn sight(&self, (point, normal): (DVec3, DVec3), viewpoint: DVec3) -> (f64, [DVec3; 2]) {
        let towards = viewpoint - point;
        let blur = BLUR * self.shape.thickness();
        let inverse = 1.0 / (towards.length_squared() + blur * blur).sqrt();
        let cosine = normal.dot(towards) * inverse;
        let gradient = (normal - towards * (cosine * inverse)) * inverse;
        (cosine, [gradient, (viewpoint - self.place).cross(gradient)])
    }

    /// Distance of a point from the tool, and its derivatives by place and rotation.
    fn distance(&self, point: DVec3, centre: DVec3, headroom: f64) -> (f64, [DVec3; 2]) {
        let arm = centre - self.place;
        let above = (point - centre).dot(self.facing).max(0.0);
        let at = point - self.facing * above;
        let (mut distance, gradient) = self.shape.signed_distance(self.rotation.transpose() * (at - self.place));
        let gradient = self.rotation * gradient;
        let mut by_pose = [-gradient, gradient.cross(at - self.place)];
        // The middle moves with the tool, and what is measured at its height with it.
        let mut rise = if above > 0.0 { gradient.dot(self.facing) } else { 0.0 };
        if above > headroom {
            distance += BEYOND * (above - headroom);
            rise -= BEYOND;
        }
        by_pose[0] += self.facing * rise;
        by_pose[1] += arm.cross(self.facing) * rise;
        (distance, by_pose)
    }
}

impl NearPieces {
    /// Finds the pieces of a surface that lie next to the tool. A tool that has hardly moved since, as in most steps of Newton's
    /// method, has the same ones: their distances follow from their derivatives, with an error of a millionth of its thickness.
    pub fn gather(&mut self, pressed: &PressedSurface, query: &SurfaceQuery, tool: &PosedShape<'_>) {
        let key = |looked_for_at| Key {
            surface: std::ptr::from_ref(pressed) as usize,
            rotation: tool.rotation,
            facing: tool.facing,
            sunk: tool.sunk,
            looked_for_at,
        };
        if let Some(known) = self.key
            && known == key(known.looked_for_at)
            && tool.place.distance(known.looked_for_at) < MOVED * tool.shape.thickness()
        {
            return self.shift(tool.place - self.place);
        }
        (self.key, self.place) = (Some(key(tool.place)), tool.place);
        self.look_for(pressed, query, tool);
    }

    /// Forgets where the pieces were looked for. What a tick computes must not depend on the ticks before, and the surface may be
    /// another one at the same address.
    pub fn forget(&mut self) {
        self.key = None;
    }

    /// Moves the tool by so much, m.
    fn shift(&mut self, way: DVec3) {
        self.place += way;
        self.centre += way;
        for near in self.pieces.iter_mut().chain(&mut self.opposite) {
            near.distance += near.by_pose[0].dot(way);
            near.facing += near.facing_by[0].dot(way);
        }
    }

    fn look_for(&mut self, pressed: &PressedSurface, query: &SurfaceQuery, tool: &PosedShape<'_>) {
        let (fine, margin) = (&pressed.fine, pressed.margin);
        self.taken_down = None;
        self.pieces.clear();
        self.opposite.clear();
        (self.centre, self.margin) = (tool.centre(), margin);
        let (centre, headroom) = (self.centre, tool.headroom(margin));
        let viewpoint = tool.viewpoint(centre);
        let whole = PosedShape { facing: DVec3::ZERO, sunk: 0.0, ..*tool };
        let reach = |axis: DVec3| tool.support(axis).dot(axis) + margin + (headroom * tool.facing.dot(axis)).max(0.0);
        let high = DVec3::from_array(DVec3::AXES.map(reach));
        let low = -DVec3::from_array(DVec3::AXES.map(|axis| reach(-axis)));
        if !(low.is_finite() && high.is_finite()) {
            return;
        }
        query.for_each_within(low, high, |triangle| {
            let (ball, radius) = fine.ball(triangle);
            let count = fine.pieces_of_triangle() as u32;
            let close = tool.distance(ball, centre, headroom).0 < radius + margin;
            let beyond = whole.distance(ball, centre, 0.0).0 < radius + margin;
            if !close && !beyond {
                return;
            }
            for piece in triangle * count..(triangle + 1) * count {
                let near = measured(fine, tool, piece, (centre, headroom, viewpoint));
                if near.distance < near.size + margin && self.pieces.len() < MOST_PIECES {
                    self.pieces.push(near);
                } else if beyond {
                    let near = measured(fine, &whole, piece, (centre, 0.0, centre));
                    if near.distance < near.size + margin && self.opposite.len() < MOST_OPPOSITE {
                        self.opposite.push(near);
                    }
                }
            }
        });
    }
}

fn measured(
    fine: &Tessellation,
    tool: &PosedShape<'_>,
    piece: u32,
    (centre, headroom, viewpoint): (DVec3, f64, DVec3),
) -> NearPiece {
    let corners = fine.corners(piece);
    let [a, b, c] = corners;
    let middle = (a + b + c) / 3.0;
    let across = (b - a).cross(c - a);
    let size = corners.iter().map(|corner| corner.distance_squared(middle)).fold(0.0, f64::max).sqrt();
    let (distance, by_pose) = tool.distance(middle, centre, headroom);
    let (normal, area) = (across.normalize_or_zero(), 0.5 * across.length());
    let (facing, facing_by) = tool.sight((middle, normal), viewpoint);
    NearPiece { piece, corners, middle, normal, area, size, joined: 1.0, distance, by_pose, facing, facing_by }
}
