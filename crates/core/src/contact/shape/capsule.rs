//! Capsule around the segment from the origin to `2 half_length` on the axis z.

use glam::{DVec2, DVec3, Vec3Swizzles};

use super::{LineEntry, PrincipalCurvatures, ellipsoid, umbilic};

/// Farthest point in a direction; for one perpendicular to the axis, that in the middle of the line of all farthest ones.
pub(super) fn support(radius: f64, half_length: f64, direction: DVec3) -> DVec3 {
    let end = if direction.z == 0.0 { half_length } else { (1.0 + direction.z.signum()) * half_length };
    DVec3::Z * end + radius * direction.normalize_or_zero()
}

/// Along the axis its side is straight; its ends are spheres.
pub(super) fn curvature_at(radius: f64, normal: DVec3) -> PrincipalCurvatures {
    if normal.z != 0.0 {
        return umbilic(normal, 1.0 / radius);
    }
    PrincipalCurvatures { curvatures: [0.0, 1.0 / radius], directions: [DVec3::Z, normal.cross(DVec3::Z)] }
}

/// Where a line enters: the first of its entries into both balls and into the cylinder between them.
pub(super) fn line_entry(radius: f64, half_length: f64, origin: DVec3, direction: DVec3) -> Option<LineEntry> {
    let ball = |z: f64| ellipsoid::line_entry(DVec3::splat(radius), origin - DVec3::Z * z, direction);
    let side = cylinder_entry(radius, origin, direction)
        .filter(|entry| (0.0..=2.0 * half_length).contains(&(origin.z + entry.distance * direction.z)));
    [side, ball(0.0), ball(2.0 * half_length)]
        .into_iter()
        .flatten()
        .reduce(|first, other| if other.distance < first.distance { other } else { first })
}

/// Where a line enters the cylinder around the whole axis.
fn cylinder_entry(radius: f64, origin: DVec3, direction: DVec3) -> Option<LineEntry> {
    let (from, along): (DVec2, DVec2) = (origin.xy(), direction.xy());
    let a = along.length_squared();
    if a < 1e-30 {
        return None;
    }
    let middle = -from.dot(along) / a;
    let discriminant = radius * radius - (from + middle * along).length_squared();
    if discriminant <= 0.0 {
        return None;
    }
    let distance = middle - (discriminant / a).sqrt();
    Some(LineEntry { distance, normal: ((from + distance * along) / radius).extend(0.0) })
}
