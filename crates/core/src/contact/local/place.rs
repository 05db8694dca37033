//! Where a tool is, and the surface it touches there.

use glam::{DMat3, DQuat, DVec3};

/// A body's surface around a point, of second order.
#[derive(Clone, Copy, Debug)]
pub struct OsculatingSurface {
    /// The point, m.
    pub origin: DVec3,
    /// Two tangents and the outward normal as columns, right-handed and orthonormal.
    pub axes: DMat3,
    /// Curvatures `[k_xx, k_xy, k_yy]` along the tangents, 1/m, positive where the surface falls away from its tangent
    /// plane: its height is `-(k_xx x^2 + 2 k_xy x y + k_yy y^2)/2`.
    pub curvature: [f64; 3],
}

/// Where a tool is.
#[derive(Clone, Copy, Debug)]
pub struct ToolPose {
    /// Its origin, m.
    pub position: DVec3,
    /// World from tool.
    pub rotation: DQuat,
}

impl OsculatingSurface {
    /// Height over the tangent plane, in the frame of the surface.
    pub(super) fn height(&self, at: DVec3) -> f64 {
        let [xx, xy, yy] = self.curvature;
        -0.5 * (xx * at.x * at.x + 2.0 * xy * at.x * at.y + yy * at.y * at.y)
    }

    /// Slope of the height.
    pub(super) fn slope(&self, at: DVec3) -> DVec3 {
        let [xx, xy, yy] = self.curvature;
        -DVec3::new(xx * at.x + xy * at.y, xy * at.x + yy * at.y, 0.0)
    }
}
