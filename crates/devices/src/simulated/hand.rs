//! The hand that follows a target.
//!
//! A pointer moves about a hundred times a second; passed on as it comes, its stairs would be felt and heard. The tip
//! follows the target as a critically damped second-order system,
//!
//! ```text
//! x'' = omega^2 (target - x) - 2 omega x',      omega = 1 / TIME_CONSTANT,
//! ```
//!
//! advanced by its exact solution over each period, so that the path does not depend on the tick rate. The orientation
//! follows by the same equation for the rotation vector `theta` from the target's orientation to the tool's, with
//! `theta' = angular velocity`: exact for turns about one axis, and right to the second order of `theta` otherwise.

use glam::{DQuat, DVec3};
use libm::{exp, sincos};

use crate::{Pose, Twist};

/// Time constant with which the tip follows its target, s: a step is followed to 98 % in about six of them.
pub const TIME_CONSTANT: f64 = 0.008;

/// Offsets (m, rad) and rates below it are none: a hand at rest would end in subnormal numbers, which are slow.
const AT_REST: f64 = 1e-140;

/// Where the hand is and how it moves.
#[derive(Clone, Copy, Default)]
pub struct Hand {
    pub pose: Pose,
    pub twist: Twist,
}

impl Hand {
    /// Does not move.
    pub fn resting(pose: Pose) -> Self {
        Self { pose, twist: Twist::default() }
    }

    pub fn is_finite(&self) -> bool {
        self.pose.is_finite()
    }

    /// Follows a target for a period, s.
    pub fn follow(&mut self, target: Pose, period: f64) {
        let (offset, linear) = decay(self.pose.position - target.position, self.twist.linear, period);
        let (angle, angular) = decay(self.pose.rotation_from(&target), self.twist.angular, period);
        self.pose.position = target.position + offset;
        self.pose.orientation = (rotation_of(angle) * target.orientation).normalize();
        self.twist = Twist { linear, angular };
    }
}

/// Zero in place of components below [`AT_REST`].
fn settled(vector: DVec3) -> DVec3 {
    let of = |x: f64| if x.abs() < AT_REST { 0.0 } else { x };
    DVec3::new(of(vector.x), of(vector.y), of(vector.z))
}

/// Rotation by a vector, rad along its axis.
fn rotation_of(vector: DVec3) -> DQuat {
    let angle = vector.length();
    if angle == 0.0 {
        return DQuat::IDENTITY;
    }
    let (sine, cosine) = sincos(0.5 * angle);
    DQuat::from_vec4((vector * (sine / angle)).extend(cosine))
}

/// Offset from the target and its rate after a period.
fn decay(offset: DVec3, rate: DVec3, period: f64) -> (DVec3, DVec3) {
    let (decay, omega) = (exp(-period / TIME_CONSTANT), 1.0 / TIME_CONSTANT);
    let slope = rate + omega * offset;
    (settled((offset + slope * period) * decay), settled((rate - omega * slope * period) * decay))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hand_at_rest_ends_at_rest_without_subnormal_numbers() {
        let mut hand = Hand::resting(Pose::at(DVec3::new(0.1, -0.2, 0.3)));
        for _ in 0..20_000 {
            hand.follow(Pose::at(DVec3::ZERO), 1e-3);
            let numbers = [hand.pose.position, hand.twist.linear, hand.twist.angular];
            assert!(numbers.iter().flat_map(|v| v.to_array()).all(|x| !x.is_subnormal()), "{numbers:?}");
        }
        assert_eq!((hand.pose.position, hand.twist.linear), (DVec3::ZERO, DVec3::ZERO));
    }
}
