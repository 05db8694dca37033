//! Tensors of vectors, and rotations.

use glam::{DMat3, DQuat, DVec3};

use crate::math::atan2;

/// `a b^T`.
pub fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// The matrix of `a x`.
pub fn skew(a: DVec3) -> DMat3 {
    DMat3::from_cols(a.cross(DVec3::X), a.cross(DVec3::Y), a.cross(DVec3::Z))
}

/// Projection on the plane across a unit normal, `I - n n^T`.
pub fn across(normal: DVec3) -> DMat3 {
    DMat3::IDENTITY - outer(normal, normal)
}

/// A symmetric matrix by `xx, xy, xz, yy, yz, zz`.
#[inline(always)]
pub fn symmetric([xx, xy, xz, yy, yz, zz]: [f64; 6]) -> DMat3 {
    DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz])
}

/// Shortest rotation in the world that takes one orientation to another, rad along its axis. By the arctangent: the
/// arccosine of `w` would lose half of the digits of a small angle.
pub fn rotation_vector(from: DQuat, to: DQuat) -> DVec3 {
    if from == to {
        return DVec3::ZERO;
    }
    let turn = to * from.conjugate();
    let turn = if turn.w < 0.0 { -turn } else { turn };
    let sine = turn.xyz().length();
    if sine == 0.0 { DVec3::ZERO } else { turn.xyz() * (2.0 * atan2(sine, turn.w) / sine) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotation_vector_is_the_axis_times_the_angle_for_large_and_tiny_turns_alike() {
        let axis = DVec3::new(2.0, -1.0, 2.0) / 3.0;
        let from = DQuat::from_rotation_y(0.7);
        for angle in [3.1, 1.0, 1e-3, 1e-9, 0.0] {
            let to = DQuat::from_axis_angle(axis, angle) * from;
            for sign in [1.0, -1.0] {
                assert!((rotation_vector(from, to * sign) - axis * angle).length() < 1e-15 + 1e-13 * angle);
            }
        }
    }
}
