//! Rectangle of the cells on the tangent plane: the smallest that contains the part of the tool below that plane.
//!
//! The rectangle moves with the tool, turns with its longest axis in the plane or with a crest below, and grows with its depth, so that
//! cells are as fine as the contact allows, and a tool that slides over a plane meets the same cells everywhere. Its motion is part of the
//! energy's gradient. Its sides are found by duality: for a convex body with the support function `h`, the largest
//! coordinate along `e` of its points below the plane is `min h(e - mu n)` over `mu >= 0`, least where the support lies in
//! the plane. A minimum changes with the pose as if `mu` were constant. In a hollow the contact may be wider: up to half
//! the tool's curvature all of it is still within.

use glam::{DMat3, DVec2, DVec3};

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
const OBLIQUE: DVec2 = DVec2::new(0.9992001066609779, 0.03998933418663416);

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
        let (own, of_surface) = (parts(&of_tool), parts(&self.crest));
        let squared = own.rotate(own);
        let both = squared + of_surface.rotate(of_surface).rotate(OBLIQUE);
        let size = hypot(both.x, both.y);
        if size <= LEAST_SINE.powi(4) {
            return Rectangle { axes: [DVec3::X, DVec3::Y], ..Rectangle::default() };
        }
        let first = match own == DVec2::ZERO {
            true => halved(halved(both)),
            false => halved(own).rotate(halved(halved(both.rotate(conjugate(squared))))),
        };
        let [by_tool, by_crest] =
            [own, of_surface.rotate(OBLIQUE)].map(|parts| parts.rotate(conjugate(both)) * (0.5 / (size * size)));
        let first = first.extend(0.0);
        Rectangle {
            axes: [first, DVec3::Z.cross(first)],
            angle_by_rotation: [by_rotation(by_tool, &of_tool), by_rotation(by_crest, &self.crest)],
            angle_by_crest: by_extents(by_crest),
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

/// `M_11 - M_22 + 2 i M_12` of extents, a complex number as those below: [`DVec2::rotate`] multiplies them.
fn parts(extents: &DMat3) -> DVec2 {
    DVec2::new(extents.x_axis.x - extents.y_axis.y, 2.0 * extents.x_axis.y)
}

fn conjugate(number: DVec2) -> DVec2 {
    DVec2::new(number.x, -number.y)
}

/// The unit number of half the angle, whose real part is not negative.
fn halved(number: DVec2) -> DVec2 {
    let DVec2 { x: cos, y: sin } = number * (1.0 / hypot(number.x, number.y));
    if cos >= 0.0 {
        let half = (0.5 * (1.0 + cos)).sqrt();
        return DVec2::new(half, 0.5 * sin / half);
    }
    let half = (0.5 * (1.0 - cos)).sqrt();
    DVec2::new(0.5 * sin.abs() / half, half.copysign(sin))
}

/// Derivative of `Im(k q)` by a rotation of the extents, for a constant `k`.
fn by_rotation(k: DVec2, extents: &DMat3) -> DVec3 {
    let (first, second) = (extents.x_axis, extents.y_axis);
    let real = (first.cross(DVec3::X) - second.cross(DVec3::Y)) * 2.0;
    let imaginary = (second.cross(DVec3::X) + first.cross(DVec3::Y)) * 2.0;
    real * k.y + imaginary * k.x
}

/// The same by the extents themselves.
fn by_extents(k: DVec2) -> DMat3 {
    let diagonal = outer(DVec3::X, DVec3::X) - outer(DVec3::Y, DVec3::Y);
    let mixed = outer(DVec3::X, DVec3::Y) + outer(DVec3::Y, DVec3::X);
    diagonal * k.y + mixed * k.x
}
