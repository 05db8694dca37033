//! Closest point of the rest surface, with a sign: parry's bounding volume hierarchy and pseudo-normals.

use glam::DVec3;
use parry3d_f64::partitioning::BvhNode;
use parry3d_f64::shape::{TriMesh, TriMeshFlags};

use crate::memory::Ranges;
use crate::mesh::Surface;
use crate::{Error, Result};

/// A point of the rest surface as it is drawn: on curved faces it lies off the face itself by the sagitta of a drawn
/// triangle, an eighth of its edge's length times the angle through which the face turns along it.
#[derive(Clone, Copy, Debug, Default)]
pub struct SurfacePoint {
    /// Position, m.
    pub position: DVec3,
    /// Triangle it lies on.
    pub triangle: u32,
    /// Barycentric coordinates in the triangle.
    pub barycentric: [f64; 3],
    /// Unit outward direction: towards the query point from outside, away from it from inside.
    pub normal: DVec3,
    /// Distance of the query point, m; negative inside.
    pub signed_distance: f64,
}

/// Closest-point queries on a surface; a query never allocates.
pub struct SurfaceQuery {
    mesh: TriMesh,
}

impl SurfaceQuery {
    /// Adds the memory that a tick reads.
    pub(crate) fn add_memory(&self, ranges: &mut Ranges) {
        ranges.add(self.mesh.vertices());
        ranges.add(self.mesh.indices());
        // The hierarchy is one array; its public interface gives only references to its nodes.
        let nodes = std::cell::Cell::new((usize::MAX, 0));
        let note = |node: &BvhNode| {
            let at = std::ptr::from_ref(node).addr();
            nodes.set((nodes.get().0.min(at), nodes.get().1.max(at + size_of::<BvhNode>())));
            true
        };
        self.mesh.bvh().leaves(note).for_each(drop);
        ranges.add_addresses(nodes.get().0..nodes.get().1);
    }

    /// Builds the hierarchy.
    ///
    /// # Errors
    /// A surface without triangles.
    pub fn new(surface: &Surface) -> Result<Self> {
        let mesh = TriMesh::with_flags(surface.positions.clone(), surface.triangles.clone(), TriMeshFlags::ORIENTED)
            .map_err(|e| Error::Invalid(format!("the surface cannot be searched: {e}")))?;
        Ok(Self { mesh })
    }

    /// Calls `visit` for every triangle whose box meets that between two corners.
    pub fn for_each_within(&self, low: DVec3, high: DVec3, visit: impl FnMut(u32)) {
        let around = parry3d_f64::bounding_volume::Aabb::new(low, high);
        self.mesh.bvh().intersect_aabb(&around).for_each(visit);
    }

    /// Distance from a point inside to where a line along a unit vector leaves the body, m; infinite if it does not.
    pub fn distance_along(&self, from: DVec3, direction: DVec3) -> f64 {
        use parry3d_f64::query::{Ray, RayCast};
        let ray = Ray::new(from, direction);
        self.mesh.cast_local_ray(&ray, f64::MAX, false).unwrap_or(f64::INFINITY)
    }

    /// The surface point closest to `point`; `None` if `point` is not finite.
    pub fn closest(&self, surface: &Surface, point: DVec3) -> Option<SurfacePoint> {
        if !point.is_finite() {
            return None;
        }
        use parry3d_f64::query::PointQueryWithLocation;
        let (projection, (triangle, _)) = self.mesh.project_local_point_and_get_location(point, false);
        let position = projection.point;
        let sign = if projection.is_inside { -1.0 } else { 1.0 };
        let offset = point - position;
        let distance = offset.length();
        // On the surface itself the direction is lost in round-off; the triangle's own normal serves.
        let normal = if distance > 1e-9 { sign * offset / distance } else { surface.normals[triangle as usize] };
        let barycentric = barycentric(surface.corners(triangle), position);
        Some(SurfacePoint { position, triangle, barycentric, normal, signed_distance: sign * distance })
    }
}

/// Barycentric coordinates of `p` in the plane of a triangle, by areas.
pub fn barycentric([a, b, c]: [DVec3; 3], p: DVec3) -> [f64; 3] {
    let n = (b - a).cross(c - a);
    let scale = 1.0 / n.length_squared();
    let wa = (c - b).cross(p - b).dot(n) * scale;
    let wb = (a - c).cross(p - c).dot(n) * scale;
    [wa, wb, 1.0 - wa - wb]
}
