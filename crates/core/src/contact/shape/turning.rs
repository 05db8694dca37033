//! The direction in which a contact may face at a point of a tool: the gradient of its signed distance, with its edges rounded. At a
//! sharp edge the gradient itself turns over at once.
//!
//! How it turns is the second derivative of the distance, 1/m.
//! Along the gradient `g` it is zero, and across it that of the parallel surface through the point: `1/L` around a point or a line
//! at the distance `L`, zero over a plane.

use glam::{DMat3, DVec3, Vec3Swizzles};

use super::{ToolShape, ellipsoid, punch};
use crate::tensor::{across, outer};

/// Least distance from a point or a line around which the gradient turns, over the shape's thickness.
const LEAST_RADIUS: f64 = 1e-3;

impl ToolShape {
    /// Gradient of the signed distance at a point, as of the shape with edges rounded by half its thickness at least, and its derivative
    /// by the point, 1/m.
    pub fn rounded_gradient(&self, point: DVec3) -> (DVec3, DMat3) {
        let least = LEAST_RADIUS * self.thickness();
        match *self {
            Self::Sphere { .. } => around(point, least),
            Self::Ellipsoid { semi_axes } => around_ellipsoid(semi_axes, point),
            Self::Capsule { half_length, .. } => {
                let nearest = point.z.clamp(0.0, 2.0 * half_length);
                let offset = point - DVec3::Z * nearest;
                let (gradient, turning) = around(offset, least);
                let along = if nearest == point.z { outer(DVec3::Z, DVec3::Z) } else { DMat3::ZERO };
                (gradient, turning - along * (1.0 / offset.length().max(least)))
            }
            Self::Punch { radius, rounding } => {
                around_punch((radius, punch::at_least_rounded(radius, rounding)), point, least)
            }
            Self::Surface(ref surface) => surface.rounded_gradient(point),
        }
    }

    /// The direction of [`ToolShape::rounded_gradient`] alone.
    pub fn rounded_direction(&self, point: DVec3) -> DVec3 {
        match *self {
            Self::Punch { radius, rounding } => {
                punch::signed_distance(radius, punch::at_least_rounded(radius, rounding), point).1
            }
            Self::Surface(ref surface) => surface.rounded_direction(point).0,
            _ => self.signed_distance(point).1,
        }
    }
}

/// Around the origin.
fn around(point: DVec3, least: f64) -> (DVec3, DMat3) {
    let length = point.length();
    let gradient = if length > 0.0 { point / length } else { DVec3::NEG_Z };
    (gradient, across(gradient) * (1.0 / length.max(least)))
}

/// At the closest point `y` with the normal `g` along `v_i = y_i/e_i^2` the surface turns by `W = P diag(1/e_i^2) P / |v|`, where `P`
/// projects across `g`; at the distance `s` from it, by `W (1 + s W)^-1`.
fn around_ellipsoid(semi_axes: DVec3, point: DVec3) -> (DVec3, DMat3) {
    let (distance, gradient) = ellipsoid::signed_distance(semi_axes, point);
    let squares = semi_axes * semi_axes;
    let inclined = (point - distance * gradient) / squares;
    let flat = across(gradient);
    let own = flat * DMat3::from_diagonal(squares.recip()) * flat * (1.0 / inclined.length());
    let parallel = DMat3::IDENTITY + own * distance;
    let turning = if parallel.determinant() > LEAST_RADIUS { own * parallel.inverse() } else { DMat3::ZERO };
    (gradient, turning)
}

/// Around the axis the gradient turns everywhere but over the faces, and across the rim where that is rounded.
fn around_punch((radius, rounding): (f64, f64), point: DVec3, least: f64) -> (DVec3, DMat3) {
    let (distance, gradient) = punch::signed_distance(radius, rounding, point);
    let out = point.xy().length();
    let outward = if out > 0.0 { (point.xy() / out).extend(0.0) } else { DVec3::X };
    let around = DVec3::Z.cross(outward);
    let mut turning = outer(around, around) * (gradient.dot(outward) / out.max(least));
    // Over side and faces one of the two is zero.
    if gradient.z != 0.0 && gradient.dot(outward) != 0.0 {
        let rim = around.cross(gradient);
        turning += outer(rim, rim) * (1.0 / (distance + rounding).max(least));
    }
    (gradient, turning)
}
