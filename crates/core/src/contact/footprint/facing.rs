//! Share to which a piece of a surface faces a tool.
//!
//! A tool presses on pieces that face its middle, and not on the other side of a plate. For a capsule that is not enough: with its
//! middle past the edge of a block on which it lies, the side face below faces the middle, but the capsule's shaft passes over that
//! face at a right angle. So a piece whose normal is along the axis must also face the nearest point of the axis: over the shaft it
//! never does, beside a round end it does as it faces a ball.

use glam::DVec3;

use super::{PlacedShape, Weight, smooth_step};
use crate::contact::shape::ToolShape;

/// Cosines between a piece's normal and the direction to the tool's middle from which it faces the tool, and faces it fully.
const FACING_MIDDLE: [f64; 2] = [-0.4, 1.0];
/// The same of the direction to the nearest point of a capsule's axis.
const FACING_AXIS: [f64; 2] = [0.0, 0.4];
/// Cosines between a piece's normal and a capsule's axis from which it must face the axis, and must so fully.
const ALONG_AXIS: [f64; 2] = [0.5, 0.9];
/// Next to the point that is faced, directions are blurred over this part of the tool's thickness.
const BLUR: f64 = 0.1;

impl PlacedShape<'_> {
    /// Share to which a piece at a point with a normal faces the tool, whose middle counts as lying at `middle`.
    pub(super) fn facing(&self, (point, normal): (DVec3, DVec3), middle: DVec3) -> Weight {
        let (share, gradient) = self.facing_point((point, normal), middle, FACING_MIDDLE);
        let by = [gradient, (middle - self.position).cross(gradient)];
        let ToolShape::Capsule { half_length, .. } = *self.shape else { return (share, by) };
        let (factor, factor_by) = self.facing_axis((point, normal), middle, half_length);
        (share * factor, [0, 1].map(|k| by[k] * factor + factor_by[k] * share))
    }

    /// Factor of the share for a capsule: the share to which a piece whose normal is along the axis faces the nearest point of the axis,
    /// and one where the normal is across it.
    ///
    /// Over the shaft that point `v` slides along the axis `a`, so that `t = v - point` stays across it. With the gradient `g` of the
    /// share by `t`, and the projection `P` across `a`, the derivatives are `P g` and `(v - position) x P g - (g . a) (a x t)`.
    fn facing_axis(&self, (point, normal): (DVec3, DVec3), middle: DVec3, half_length: f64) -> Weight {
        let axis = self.rotation.z_axis;
        let cosine = normal.dot(axis);
        let (must, rise) = smooth_step(cosine.abs(), ALONG_AXIS);
        if must <= 0.0 {
            return (1.0, [DVec3::ZERO; 2]);
        }
        let along = (point - middle).dot(axis);
        let nearest = middle + axis * along.clamp(-half_length, half_length);
        let (share, gradient) = self.facing_point((point, normal), nearest, FACING_AXIS);
        let arm = nearest - self.position;
        let by = if along.abs() < half_length {
            let level = gradient.reject_from_normalized(axis);
            [level, arm.cross(level) - axis.cross(nearest - point) * gradient.dot(axis)]
        } else {
            [gradient, arm.cross(gradient)]
        };
        let by_turn = axis.cross(normal) * (cosine.signum() * rise * (share - 1.0));
        (1.0 + must * (share - 1.0), [by[0] * must, by[1] * must + by_turn])
    }

    /// Share to which a piece faces a viewpoint, between two cosines, and its gradient by that point.
    fn facing_point(&self, (point, normal): (DVec3, DVec3), viewpoint: DVec3, bounds: [f64; 2]) -> (f64, DVec3) {
        let towards = viewpoint - point;
        let blur = BLUR * self.shape.thickness();
        let inverse = 1.0 / (towards.length_squared() + blur * blur).sqrt();
        let cosine = normal.dot(towards) * inverse;
        let (share, rise) = smooth_step(cosine, bounds);
        (share, (normal - towards * (cosine * inverse)) * (inverse * rise))
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DQuat};

    use super::*;

    const CAPSULE: ToolShape = ToolShape::Capsule { radius: 0.003, half_length: 0.009 };

    fn placed(position: DVec3, rotation: DQuat) -> PlacedShape<'static> {
        let rotation = DMat3::from_quat(rotation);
        PlacedShape { shape: &CAPSULE, position, rotation, contact_normal: DVec3::ZERO, penetration: 0.0 }
    }

    #[test]
    fn the_shaft_does_not_press_on_a_face_that_it_passes_over() {
        // The axis lies along x from -3 to 15 mm, over the edge of a block at x = 0.
        let tool = placed(DVec3::new(-0.003, 0.0, 0.002), DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2));
        let share = |point: DVec3, normal: DVec3| tool.facing((point, normal), tool.centre()).0;
        assert!(share(DVec3::new(0.0, 0.0, -0.001), DVec3::X) < 1e-9);
        assert!(share(DVec3::new(-0.001, 0.0, 0.0), DVec3::Z) > 0.1);
        // A face before its end does face it.
        assert!(share(DVec3::new(-0.006, 0.0, 0.002), DVec3::X) > 0.9);
    }

    #[test]
    fn the_derivatives_are_those_of_the_share() {
        const STEP: f64 = 1e-8;
        let (at, turn) = (DVec3::new(0.001, -0.002, 0.003), DQuat::from_rotation_x(0.3));
        let mut seen = 0;
        for k in 0..200 {
            let angle = f64::from(k);
            let point = at + DVec3::new((1.3 * angle).sin(), (2.1 * angle).cos(), 3.0 * (0.7 * angle).sin()) * 0.005;
            let normal = DVec3::new((0.9 * angle).cos(), (1.7 * angle).sin(), (0.4 * angle).cos()).normalize();
            let share = |at: DVec3, turn: DQuat| {
                let tool = placed(at, turn);
                tool.facing((point, normal), tool.centre()).0
            };
            let tool = placed(at, turn);
            let (whole, by) = tool.facing((point, normal), tool.centre());
            seen += usize::from(whole > 0.01 && whole < 0.99);
            for (axis, direction) in DVec3::AXES.into_iter().enumerate() {
                let moved = |step: f64| share(at + direction * step, turn);
                let turned = |step: f64| share(at, DQuat::from_scaled_axis(direction * step) * turn);
                let position = (moved(STEP) - moved(-STEP)) / (2.0 * STEP);
                let rotation = (turned(1e2 * STEP) - turned(-1e2 * STEP)) / (2e2 * STEP);
                assert!(
                    (by[0][axis] - position).abs() < 1e-4 * (1.0 + position.abs()),
                    "{k}: {} {position}",
                    by[0][axis]
                );
                assert!(
                    (by[1][axis] - rotation).abs() < 1e-4 * (1.0 + rotation.abs()),
                    "{k}: {} {rotation}",
                    by[1][axis]
                );
            }
        }
        assert!(seen > 50, "{seen}");
    }
}
