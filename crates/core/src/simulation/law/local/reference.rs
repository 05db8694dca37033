//! The point of a tool whose closest point on the body's surface is where the two meet.
//!
//! A point fixed in a long tool would be far from where it touches. This one moves with the normal `n` of the surface, as the
//! support of an ellipsoid with the semi-axes `D` of the tool does, less a ball of the smallest of them:
//!
//! ```text
//! c(n) = centre - (A - m^2) n / sqrt(n.A n),     A = R D^2 R^T,     m = min D
//! ```
//!
//! For an ellipsoid it lies on the normal through the deepest point; for a sphere it is the centre. Its place over the
//! surface follows from `r = p + c(n(r))`, by Newton's method, so that with `J = dc/dn` and `L = I - J dn/dr`
//!
//! ```text
//! L dr = dp + dtheta x c - J (dtheta x n)
//! ```

use glam::{DMat3, DVec3};

use crate::contact::shape::ToolShape;
use crate::contact::smooth::{DrawnSurface, FootPoint, Neighbourhood, SmoothSurface};
use crate::tensor::outer;

/// Newton's steps at most; two are usual.
const STEPS: usize = 6;
/// A miss of this much, over the tool's size, is none.
const SETTLED: f64 = 1e-9;
/// Least determinant of `L`. Below it the body is about as hollow as the tool is round, and the centre takes the point's place.
const LEAST_DETERMINANT: f64 = 0.1;
/// Height of a punch's middle over its radius.
const PUNCH_MIDDLE: f64 = 2.0;

/// How the closest point of the reference point follows the tool's pose.
#[derive(Clone, Copy, Debug)]
pub struct Reference {
    /// `c`, m.
    offset: DVec3,
    /// `J`, m.
    by_normal: DMat3,
    /// `L^-1`.
    inverse: DMat3,
    normal: DVec3,
}

impl Reference {
    /// The foot of the reference point of a tool at `place`, followed from an earlier one.
    pub fn find(
        (smooth, drawn): (&SmoothSurface, DrawnSurface<'_>),
        shape: &ToolShape,
        (place, rotation): (DVec3, DMat3),
        from: &FootPoint,
        near: &mut Neighbourhood,
    ) -> Option<(FootPoint, Self)> {
        let core = Core::new(shape, rotation);
        let mut foot_of = |at: DVec3, from: &FootPoint| smooth.foot(drawn, at, from, near);
        let settled = SETTLED * shape.bounding_radius();
        let mut at = place + core.offset(from.normal);
        let mut foot = foot_of(at, from)?;
        for _ in 0..STEPS {
            let Some(reference) = core.follow(&foot) else { break };
            let miss = place + reference.offset - at;
            if miss.length() <= settled {
                return Some((foot, reference));
            }
            at += reference.inverse * miss;
            foot = foot_of(at, &foot)?;
        }
        let offset = core.centre;
        let foot = foot_of(place + offset, &foot)?;
        Some((foot, Self { offset, by_normal: DMat3::ZERO, inverse: DMat3::IDENTITY, normal: foot.normal }))
    }

    /// The foot of a tool on the plane through an earlier one.
    pub fn held(shape: &ToolShape, (place, rotation): (DVec3, DMat3), at: &FootPoint) -> Option<(FootPoint, Self)> {
        let flat = FootPoint { turning: DMat3::ZERO, ..*at };
        let reference = Core::new(shape, rotation).follow(&flat)?;
        Some((at.held(place + reference.offset), reference))
    }

    /// A gradient by the place of the reference point as one by the tool's place and one by its rotation about its tip.
    pub fn by_pose(&self, gradient: DVec3) -> (DVec3, DVec3) {
        let by_place = self.inverse.transpose() * gradient;
        let by_rotation = self.offset.cross(by_place) - self.normal.cross(self.by_normal.transpose() * by_place);
        (by_place, by_rotation)
    }

    /// `dn/dp` of a tool that does not turn, from `dn/dr`.
    pub fn turning(&self, foot: &FootPoint) -> DMat3 {
        foot.turning * self.inverse
    }
}

/// The ellipsoid whose support is followed, in the frame of the body.
struct Core {
    centre: DVec3,
    /// `A` and `A - m^2`, m^2.
    squares: DMat3,
    excess: DMat3,
}

impl Core {
    fn new(shape: &ToolShape, rotation: DMat3) -> Self {
        let lengths = semi_axes(shape);
        let turned = |diagonal: DVec3| rotation * DMat3::from_diagonal(diagonal) * rotation.transpose();
        let squares = lengths * lengths;
        Self {
            centre: rotation * shape.centre(),
            squares: turned(squares),
            excess: turned(squares - squares.min_element()),
        }
    }

    fn offset(&self, normal: DVec3) -> DVec3 {
        self.centre - self.excess * normal / normal.dot(self.squares * normal).sqrt()
    }

    /// The point and its derivatives; `None` where it cannot be followed.
    fn follow(&self, foot: &FootPoint) -> Option<Reference> {
        let normal = foot.normal;
        let (towards, along) = (self.squares * normal, self.excess * normal);
        let height = normal.dot(towards).sqrt();
        let by_normal = outer(along, towards) * (1.0 / height.powi(3)) - self.excess * (1.0 / height);
        let l = DMat3::IDENTITY - by_normal * foot.turning;
        let determinant = l.determinant();
        if determinant.is_nan() || determinant <= LEAST_DETERMINANT {
            return None;
        }
        Some(Reference { offset: self.centre - along / height, by_normal, inverse: l.inverse(), normal })
    }
}

/// Semi-axes of an ellipsoid about as large as the tool, m.
fn semi_axes(shape: &ToolShape) -> DVec3 {
    match *shape {
        ToolShape::Sphere { radius } => DVec3::splat(radius),
        ToolShape::Ellipsoid { semi_axes } => semi_axes,
        ToolShape::Capsule { radius, half_length } => DVec3::new(radius, radius, radius + half_length),
        ToolShape::Punch { radius, .. } => DVec3::new(radius, radius, PUNCH_MIDDLE * radius),
        ToolShape::Surface(_) => {
            let centre = shape.centre();
            DVec3::from_array(DVec3::AXES.map(|axis| (shape.support(axis) - centre).dot(axis)))
        }
    }
}

/// How far a tool at `place` reaches below the plane through a foot, m; negative where it does not.
pub fn depth_below(shape: &ToolShape, (place, rotation): (DVec3, DMat3), foot: &FootPoint) -> f64 {
    let deepest = place + rotation * shape.support(-(rotation.transpose() * foot.normal));
    (foot.position - deepest).dot(foot.normal)
}
