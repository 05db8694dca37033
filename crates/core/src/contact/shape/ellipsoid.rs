//! Ellipsoid `sum (x_i/e_i)^2 <= 1`.

use glam::DVec3;

use super::LineEntry;

/// Newton's steps for the closest point; eight are enough except within 1e-6 of the medial surface.
const MAX_NEWTON_STEPS: usize = 24;
/// Points closer to a plane of symmetry than this part of the smallest semi-axis are taken as beside it: in the plane itself
/// the closest point may not be unique.
const LEAST_OFFSET: f64 = 1e-12;

/// Distance and its gradient.
///
/// The closest point is `x_i = e_i^2 v_i` with `v_i = y_i/(t + e_i^2)`, where `t` is the root of
/// `s(t) = sum (e_i v_i)^2 = 1` above the pole at `-min e_i^2` (Eberly, Distance from a Point to an Ellipse, an Ellipsoid, or
/// a Hyperellipsoid, 2013). `1/sqrt(s)` is concave and nearly linear in `t` even beside the pole, so that Newton's method
/// from the left stays left and needs few steps (More and Sorensen, Computing a trust region step, 1983). Then the distance
/// is `t |v|`.
pub(super) fn signed_distance(semi_axes: DVec3, point: DVec3) -> (f64, DVec3) {
    let least = LEAST_OFFSET * semi_axes.min_element();
    let offset = point.abs().max(DVec3::splat(least));
    let squares = semi_axes * semi_axes;
    let smallest = squares.min_element();
    // Counted from the pole, which keeps the precision of `t + e_i^2` beside it.
    let above = squares - smallest;
    let scaled = semi_axes * offset;
    // One term alone reaches 1 here, so all together are at least 1.
    let mut t = (scaled - above).max_element();
    for _ in 0..MAX_NEWTON_STEPS {
        let shifted = above + t;
        let terms = scaled / shifted;
        let sum = terms.length_squared();
        let slope = (terms * terms / shifted).element_sum();
        let step = sum * (sum.sqrt() - 1.0) / slope;
        t += step;
        if step.abs() <= 1e-15 * t {
            break;
        }
    }
    let v = offset / (above + t);
    let length = v.length();
    let sign = DVec3::select(point.cmplt(DVec3::ZERO), DVec3::NEG_ONE, DVec3::ONE);
    ((t - smallest) * length, sign * v / length)
}

/// Farthest point in a direction.
pub(super) fn support(semi_axes: DVec3, direction: DVec3) -> DVec3 {
    semi_axes * (semi_axes * direction).normalize_or_zero()
}

/// Where a line enters.
pub(super) fn line_entry(semi_axes: DVec3, origin: DVec3, direction: DVec3) -> Option<LineEntry> {
    let (from, along) = (origin / semi_axes, direction / semi_axes);
    let (a, b) = (along.length_squared(), from.dot(along));
    // Closest approach to the centre, whose length has no cancellation for an origin far away.
    let closest = from - along * (b / a);
    let discriminant = 1.0 - closest.length_squared();
    if discriminant <= 0.0 {
        return None;
    }
    let distance = -b / a - (discriminant / a).sqrt();
    let normal = ((from + distance * along) / semi_axes).normalize();
    Some(LineEntry { distance, normal })
}
