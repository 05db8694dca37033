//! Rotation vector between two orientations.

use crate::math::atan2;
use glam::{DQuat, DVec3};

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
    fn is_the_axis_times_the_angle_for_large_and_tiny_turns_alike() {
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
