//! Capsule around the segment from the origin to `2 half_length` on the axis z.

use glam::{DVec2, DVec3, Vec3Swizzles};

use super::{LineEntry, ellipsoid};

/// Square of the part of a direction across the axis below which the direction counts as axial.
const LEAST_ACROSS: f64 = 1e-30;

/// Farthest point in a direction; for one perpendicular to the axis, that in the middle of the line of all farthest ones.
pub(super) fn support(radius: f64, half_length: f64, direction: DVec3) -> DVec3 {
    let end = if direction.z == 0.0 { half_length } else { (1.0 + direction.z.signum()) * half_length };
    DVec3::Z * end + radius * direction.normalize_or_zero()
}

/// Where a line enters. The capsule lies within the cylinder around its whole axis: a line that enters that beside the segment
/// enters the capsule there, one that enters it beyond an end can only come in through the ball of that end.
pub(super) fn line_entry(radius: f64, half_length: f64, origin: DVec3, direction: DVec3) -> Option<LineEntry> {
    let ball = |z: f64| ellipsoid::line_entry(DVec3::splat(radius), origin - DVec3::Z * z, direction);
    if direction.xy().length_squared() < LEAST_ACROSS {
        return ball(if direction.z > 0.0 { 0.0 } else { 2.0 * half_length });
    }
    let side = cylinder_entry(radius, origin, direction)?;
    match origin.z + side.distance * direction.z {
        z if z < 0.0 => ball(0.0),
        z if z > 2.0 * half_length => ball(2.0 * half_length),
        _ => Some(side),
    }
}

/// Where a line enters the cylinder around the whole axis.
fn cylinder_entry(radius: f64, origin: DVec3, direction: DVec3) -> Option<LineEntry> {
    let (from, along): (DVec2, DVec2) = (origin.xy(), direction.xy());
    let a = along.length_squared();
    let middle = -from.dot(along) / a;
    let discriminant = radius * radius - (from + middle * along).length_squared();
    if discriminant <= 0.0 {
        return None;
    }
    let distance = middle - (discriminant / a).sqrt();
    Some(LineEntry { distance, normal: ((from + distance * along) / radius).extend(0.0) })
}
