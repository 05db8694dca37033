//! Rectangle of the cells on the tangent plane: the smallest that contains the part of the tool below that plane.
//!
//! The rectangle moves with the tool, turns with its longest axis in the plane or with a crest below and grows with its depth, so that cells are as fine as the
//! contact allows, and a tool that slides over a plane meets the same cells everywhere. Its motion is part of the
//! energy's gradient. Its sides are found by duality: for a convex body with the support function `h`, the largest
//! coordinate along `e` of its points below the plane is `min h(e - mu n)` over `mu >= 0`, least where the support lies in
//! the plane. A minimum changes with the pose as if `mu` were constant. In a hollow the contact may be wider: up to half
//! the tool's curvature all of it is still within.

use glam::{DMat3, DVec3};

use super::super::super::shape::ToolShape;
use crate::math::hypot;
use crate::tensor::outer;

/// Most steps towards the direction of a side's support.
const MAX_SUPPORT_STEPS: usize = 50;
/// Height of a straight arc of the tool over its chord, over the tool's size: such an arc is 3e-7 long.
const STRAIGHT: f64 = 1e-14;
/// Distance over the tool's size by which the surface reaches beyond a side whatever the rounding.
const BEYOND: f64 = 1e-9;
/// Least sine of the angle between a tool's long axis and the normal for the grid to follow that axis; the square is the least
/// difference of its extents along the grid's axes, its fourth power that of their squares.
const LEAST_SINE: f64 = 1e-3;

/// `o`: the grid lies obliquely over a crest by a fourth of this number's angle, 0.01. A row of cells that passes a crest at once has
/// no exact gradient.
const OBLIQUE: Parts = Parts(0.9992001066609779, 0.03998933418663416);

/// A side of the rectangle.
#[derive(Clone, Copy, Debug, Default)]
pub struct RectangleSide {
    /// Its coordinate along its axis, m.
    pub coordinate: f64,
    /// `e - mu n` or, on the lower side, `e + mu n`: the coordinate's derivative by a motion of the support.
    pub gradient: DVec3,
    /// The tool's point that determines it, m.
    pub support: DVec3,
    /// The point at this coordinate, m: of the tool or, if the surface ends first, of the surface.
    pub point: DVec3,
    /// The coordinate's derivative by a motion of the surface.
    pub by_surface: DVec3,
}

/// The rectangle, in the frame of the surface.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rectangle {
    /// Its axes.
    pub axes: [DVec3; 2],
    /// Lower and upper side along each axis.
    pub sides: [[RectangleSide; 2]; 2],
    /// Change of its angle about the normal with a rotation of the tool, and of the surface.
    pub angle_by_rotation: [DVec3; 2],
    /// Its derivative by `S`.
    pub angle_by_crest: DMat3,
}

/// A tool in the frame of the surface, whose third axis is the normal.
pub struct ToolInSurfaceFrame<'a> {
    /// Its shape.
    pub shape: &'a ToolShape,
    /// Axes of the tool as columns.
    pub rotation: DMat3,
    /// Its origin, m.
    pub tip: DVec3,
    /// `S`: extents of the surface on a crest.
    pub crest: DMat3,
}

impl ToolInSurfaceFrame<'_> {
    /// Farthest point in a direction.
    pub fn support(&self, direction: DVec3) -> DVec3 {
        self.tip + self.rotation * self.shape.support(self.rotation.transpose() * direction)
    }

    /// The rectangle around the part of the tool below the plane, which must not be empty.
    pub fn rectangle(&self) -> Rectangle {
        let turned = self.axes();
        let sides = turned.axes.map(|axis| {
            let (lower, upper) = (self.side(-axis), self.side(axis));
            [lower.reversed(), upper]
        });
        Rectangle { sides, ..turned }
    }

    /// A rectangle without sides, with its axes in the plane: along those of the tool's extents `E` and of the surface's, `S`, up to
    /// right angles, for a grid that is turned by one is the same. With `q = M_11 - M_22 + 2 i M_12` of each its angle is
    ///
    /// ```text
    /// arg(Q)/4        Q = q_E^2 + o q_S^2        d angle = Im(k dq)        k = (q_E or o q_S) Q*/(2 |Q|^2)
    /// ```
    ///
    /// and of the four angles it is the one next to the tool's own axis.
    fn axes(&self) -> Rectangle {
        let of_tool = self.rotation * self.shape.extents() * self.rotation.transpose();
        let own = Parts::of(&of_tool);
        let (squared, of_surface) = (own.squared(), Parts::of(&self.crest));
        let both = squared.plus(of_surface.squared().times(OBLIQUE));
        let size = both.size();
        if size <= LEAST_SINE.powi(4) {
            return Rectangle { axes: [DVec3::X, DVec3::Y], ..Rectangle::default() };
        }
        let beside = if own.size() > 0.0 { both.times(squared.conjugate()) } else { both };
        let turn = beside.halved().halved();
        let first = if own.size() > 0.0 { own.halved().times(turn) } else { turn };
        let [by_tool, by_crest] =
            [own, of_surface.times(OBLIQUE)].map(|parts| parts.times(both.conjugate()).scaled(0.5 / (size * size)));
        let first = DVec3::new(first.0, first.1, 0.0);
        Rectangle {
            axes: [first, DVec3::Z.cross(first)],
            angle_by_rotation: [by_tool.by_rotation(&of_tool), by_crest.by_rotation(&self.crest)],
            angle_by_crest: by_crest.by_extents(),
            ..Rectangle::default()
        }
    }

    /// The upper side along a direction in the plane.
    fn side(&self, direction: DVec3) -> RectangleSide {
        let mut above = self.support(direction);
        if above.z <= 0.0 {
            return RectangleSide::of_tool(above.dot(direction), direction, above);
        }
        // Supports become lower as their direction turns downwards. The next direction is across the chord of the last two, which
        // ends on a polyhedron, and in between by their heights, which ends elsewhere.
        let (mut level, mut steep) = (direction, DVec3::NEG_Z);
        let mut below = self.support(steep);
        let mut chord = above - below;
        let straight = STRAIGHT * self.shape.bounding_radius();
        for step in 0..MAX_SUPPORT_STEPS {
            let across = direction - DVec3::Z * (chord.dot(direction) / chord.z);
            let by_height = level * -below.z + steep * above.z;
            let next = if step % 2 == 0 { across } else { by_height }.normalize();
            let support = self.support(next);
            if support.z.abs() <= straight {
                let gradient = next / next.dot(direction);
                return RectangleSide::of_tool(direction.dot(support), gradient, support);
            }
            // Nothing lies beyond the chord.
            if step % 2 == 0 && (support - above).dot(next) <= straight {
                break;
            }
            if support.z > 0.0 {
                (level, above) = (next, support);
            } else {
                (steep, below) = (next, support);
            }
            chord = above - below;
        }
        // The chord's slope is `mu`, and it meets the plane between its ends.
        let support = below - chord * (below.z / chord.z);
        let gradient = direction - DVec3::Z * (chord.dot(direction) / chord.z);
        RectangleSide::of_tool(direction.dot(support), gradient, support)
    }

    /// The same rectangle, cut where the surface above the tool's lowest point ends. `end` returns that end along a direction, unless
    /// it is surely beyond a coordinate.
    pub fn within(&self, rectangle: Rectangle, end: impl Fn(DVec3, f64) -> Option<(DVec3, f64)>) -> Rectangle {
        let lowest = self.support(DVec3::NEG_Z);
        let rounding = BEYOND * self.shape.bounding_radius();
        let shorter = |side: RectangleSide, direction: DVec3| {
            let Some((point, by_level)) = end(direction, side.coordinate + rounding) else { return side };
            let coordinate = point.dot(direction);
            if coordinate >= side.coordinate {
                return side;
            }
            // The level is that of the tool's lowest point.
            let gradient = DVec3::Z * by_level;
            RectangleSide { coordinate, gradient, support: lowest, point, by_surface: direction - gradient }
        };
        let sides = [0, 1].map(|k| {
            let ([lower, upper], axis) = (rectangle.sides[k], rectangle.axes[k]);
            [shorter(lower.reversed(), -axis).reversed(), shorter(upper, axis)]
        });
        Rectangle { sides, ..rectangle }
    }
}

impl RectangleSide {
    fn of_tool(coordinate: f64, gradient: DVec3, support: DVec3) -> Self {
        Self { coordinate, gradient, support, point: support, by_surface: DVec3::ZERO }
    }

    /// The side as seen along the opposite direction.
    fn reversed(self) -> Self {
        Self { coordinate: -self.coordinate, gradient: -self.gradient, by_surface: -self.by_surface, ..self }
    }
}

/// A complex number: `M_11 - M_22 + 2 i M_12` of extents, and what is computed from it.
#[derive(Clone, Copy)]
struct Parts(f64, f64);

impl Parts {
    fn of(extents: &DMat3) -> Self {
        Self(extents.x_axis.x - extents.y_axis.y, 2.0 * extents.x_axis.y)
    }

    fn size(self) -> f64 {
        hypot(self.0, self.1)
    }

    fn plus(self, other: Self) -> Self {
        Self(self.0 + other.0, self.1 + other.1)
    }

    fn times(self, other: Self) -> Self {
        Self(self.0 * other.0 - self.1 * other.1, self.0 * other.1 + self.1 * other.0)
    }

    fn squared(self) -> Self {
        self.times(self)
    }

    fn conjugate(self) -> Self {
        Self(self.0, -self.1)
    }

    fn scaled(self, factor: f64) -> Self {
        Self(self.0 * factor, self.1 * factor)
    }

    /// The unit number of half the angle, whose real part is not negative.
    fn halved(self) -> Self {
        let Self(cos, sin) = self.scaled(1.0 / self.size());
        if cos >= 0.0 {
            let half = (0.5 * (1.0 + cos)).sqrt();
            return Self(half, 0.5 * sin / half);
        }
        let half = (0.5 * (1.0 - cos)).sqrt();
        Self(0.5 * sin.abs() / half, half.copysign(sin))
    }

    /// Derivative of `Im(k q)`, with this as `k`, by a rotation of the extents.
    fn by_rotation(self, extents: &DMat3) -> DVec3 {
        let (first, second) = (extents.x_axis, extents.y_axis);
        let real = (first.cross(DVec3::X) - second.cross(DVec3::Y)) * 2.0;
        let imaginary = (second.cross(DVec3::X) + first.cross(DVec3::Y)) * 2.0;
        real * self.1 + imaginary * self.0
    }

    /// The same by the extents themselves.
    fn by_extents(self) -> DMat3 {
        let diagonal = outer(DVec3::X, DVec3::X) - outer(DVec3::Y, DVec3::Y);
        let mixed = outer(DVec3::X, DVec3::Y) + outer(DVec3::Y, DVec3::X);
        diagonal * self.1 + mixed * self.0
    }
}
