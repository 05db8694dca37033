//! Rectangle of the cells on the tangent plane: the smallest that contains the part of the tool below that plane.
//!
//! The rectangle moves with the tool, turns with its longest axis in the plane and grows with its depth, so that cells are as fine as the
//! contact allows, and a tool that slides over a plane meets the same cells everywhere. Its motion is part of the
//! energy's gradient. Its sides are found by duality: for a convex body with the support function `h`, the largest
//! coordinate along `e` of its points below the plane is `min h(e - mu n)` over `mu >= 0`, least where the support lies in
//! the plane. A minimum changes with the pose as if `mu` were constant. In a hollow the contact may be wider: up to half
//! the tool's curvature all of it is still within.

use glam::{DMat3, DVec3};

use super::super::super::shape::ToolShape;
use crate::math::hypot;

/// Most steps towards the direction of a side's support.
const MAX_SUPPORT_STEPS: usize = 50;
/// Height of a straight arc of the tool over its chord, over the tool's size: such an arc is 3e-7 long.
const STRAIGHT: f64 = 1e-14;
/// Distance over the tool's size by which the surface reaches beyond a side whatever the rounding.
const BEYOND: f64 = 1e-9;
/// Least sine of the angle between a tool's long axis and the normal for the grid to follow that axis; the square is the least
/// difference of its extents along the grid's axes.
const LEAST_SINE: f64 = 1e-3;

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
    /// Change of its angle about the normal with a rotation of the tool.
    pub angle_by_rotation: DVec3,
}

/// A tool in the frame of the surface, whose third axis is the normal.
pub struct ToolInSurfaceFrame<'a> {
    /// Its shape.
    pub shape: &'a ToolShape,
    /// Axes of the tool as columns.
    pub rotation: DMat3,
    /// Its origin, m.
    pub tip: DVec3,
}

impl ToolInSurfaceFrame<'_> {
    /// Farthest point in a direction.
    pub fn support(&self, direction: DVec3) -> DVec3 {
        self.tip + self.rotation * self.shape.support(self.rotation.transpose() * direction)
    }

    /// The rectangle around the part of the tool below the plane, which must not be empty.
    pub fn rectangle(&self) -> Rectangle {
        let (axes, angle_by_rotation) = self.axes();
        let sides = axes.map(|axis| {
            let (lower, upper) = (self.side(-axis), self.side(axis));
            [lower.reversed(), upper]
        });
        Rectangle { axes, sides, angle_by_rotation }
    }

    /// Axes of the grid in the plane, those of the shape's extents across the normal, and the change of their angle with a rotation
    /// of the tool. With the extents `E`, whose parts along both axes differ by `d`, it is `(E e_2 x e_1 + E e_1 x e_2)/d`.
    fn axes(&self) -> ([DVec3; 2], DVec3) {
        let extents = self.rotation * self.shape.extents() * self.rotation.transpose();
        let (difference, mixed) = (extents.x_axis.x - extents.y_axis.y, 2.0 * extents.x_axis.y);
        let spread = hypot(difference, mixed);
        if spread <= LEAST_SINE * LEAST_SINE {
            return ([DVec3::X, DVec3::Y], DVec3::ZERO);
        }
        let (sin, cos) = half_angle(difference / spread, mixed / spread);
        let (first, second) = (DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0));
        let turning = (extents * second).cross(first) + (extents * first).cross(second);
        ([first, second], turning / spread)
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

/// Sine and cosine, the latter not negative, of half of an angle.
fn half_angle(cos: f64, sin: f64) -> (f64, f64) {
    if cos >= 0.0 {
        let half = (0.5 * (1.0 + cos)).sqrt();
        return (0.5 * sin / half, half);
    }
    let half = (0.5 * (1.0 - cos)).sqrt();
    (half.copysign(sin), 0.5 * sin.abs() / half)
}
