//! Flat punch: a cylinder along +z whose edges are rounded. All points of the boundary lie `rounding` from a smaller
//! cylinder with sharp edges.

use glam::{DVec2, DVec3, Vec3Swizzles};

use super::LineEntry;

/// Length of the cylinder over its radius.
pub(super) const LENGTH: f64 = 4.0;
/// Newton's steps along a line. From outside the distance is convex along it, so they never pass the entry; more would only
/// sharpen lines that graze.
const MAX_LINE_STEPS: usize = 24;

/// Least rounding for the directions in which a contact may face, over the radius.
const LEAST_ROUNDING: f64 = 0.5;

/// A rounding, or the least one for the directions in which a contact may face.
pub(super) fn at_least_rounded(radius: f64, rounding: f64) -> f64 {
    rounding.max(LEAST_ROUNDING * radius)
}

/// Distance and its gradient.
pub(super) fn signed_distance(radius: f64, rounding: f64, point: DVec3) -> (f64, DVec3) {
    let half = 0.5 * LENGTH * radius;
    let across = point.xy().length();
    let outward = if across > 0.0 { (point.xy() / across).extend(0.0) } else { DVec3::X };
    let forward = DVec3::Z * if point.z < half { -1.0 } else { 1.0 };
    // Distances beyond side and face of the sharp cylinder.
    let beyond = DVec2::new(across - (radius - rounding), (point.z - half).abs() - (half - rounding));
    if beyond.min_element() > 0.0 {
        let length = beyond.length();
        return (length - rounding, (beyond.x * outward + beyond.y * forward) / length);
    }
    if beyond.x > beyond.y { (beyond.x - rounding, outward) } else { (beyond.y - rounding, forward) }
}

/// Farthest point in a direction; straight ahead that is the middle of the face, sideways that of the cylinder's line.
pub(super) fn support(radius: f64, rounding: f64, direction: DVec3) -> DVec3 {
    let half = 0.5 * LENGTH * radius;
    let across = direction.xy().normalize_or_zero().extend(0.0);
    let end = if direction.z == 0.0 { 0.0 } else { direction.z.signum() * (half - rounding) };
    DVec3::Z * (half + end) + (radius - rounding) * across + rounding * direction.normalize_or_zero()
}

/// Where a line enters, up to `reach`.
pub(super) fn line_entry(
    (radius, rounding): (f64, f64),
    origin: DVec3,
    direction: DVec3,
    reach: f64,
) -> Option<LineEntry> {
    if direction.z > 0.0 {
        let distance = -origin.z / direction.z;
        if (origin + distance * direction).xy().length() <= radius - rounding {
            return Some(LineEntry { distance, normal: DVec3::NEG_Z });
        }
    }
    // From outside of the ball around the punch.
    let centre = DVec3::Z * (0.5 * LENGTH * radius);
    let ball = (centre - origin).dot(direction) - LENGTH * radius;
    // Coming from in front, nothing is met before the plane of the face.
    let mut distance = if direction.z > 0.0 { ball.max(-origin.z / direction.z) } else { ball };
    let mut normal = DVec3::NEG_Z;
    for _ in 0..MAX_LINE_STEPS {
        let (value, gradient) = signed_distance(radius, rounding, origin + distance * direction);
        normal = gradient;
        if value < 1e-13 * radius {
            break;
        }
        let slope = gradient.dot(direction);
        if slope > -1e-6 {
            return None;
        }
        distance -= value / slope;
        // Every step ends before the entry.
        if distance > reach {
            return None;
        }
    }
    Some(LineEntry { distance, normal })
}
