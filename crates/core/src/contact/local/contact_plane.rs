//! Pose of a tool and the plane of its contact.

use glam::{DMat3, DQuat, DVec3};

/// The plane of a contact.
#[derive(Clone, Copy, Debug)]
pub struct ContactPlane {
    /// A point of it, m.
    pub origin: DVec3,
    /// Two tangents and the outward normal as columns, right-handed and orthonormal.
    pub axes: DMat3,
}

/// Pose of a tool.
#[derive(Clone, Copy, Debug)]
pub struct ToolPose {
    /// Its origin, m.
    pub position: DVec3,
    /// World from tool.
    pub rotation: DQuat,
}

impl ContactPlane {
    /// Through a point, with a unit normal.
    pub fn new(origin: DVec3, normal: DVec3) -> Self {
        let along = normal.any_orthonormal_vector();
        Self { origin, axes: DMat3::from_cols(along, normal.cross(along), normal) }
    }
}
