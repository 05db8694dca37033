//! State of a contact under the local law from tick to tick.

use glam::{DQuat, DVec3};

use crate::contact::footprint::Plane;
use crate::contact::local::Friction;
use crate::contact::smooth::FootPoint;

/// State of a contact under the local law; vectors are in the body's frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct LocalContact {
    /// Position of the tool, m.
    pub tool_position: DVec3,
    /// Orientation of the tool.
    pub orientation: DQuat,
    /// Position of the tool over the surface at rest, `p' = p - u`, without the displacement `u` of the body below it, m.
    pub relative_position: DVec3,
    /// Way of the tool in this tick, m.
    pub way: DVec3,
    /// Displacement of that position in the last tick, m.
    pub last_step: DVec3,
    /// Change of the force, N, and of the offset, m, in that step, where the body's displacement has higher orders.
    pub last_changes: [DVec3; 2],
    /// Orientation a tick ago.
    pub previous_orientation: DQuat,
    /// Approach at which the contact began, m: the force of a tool that appears inside starts from zero.
    pub entry_depth: f64,
    /// The closest point of the surface at rest; for a tool that is not a sphere, the middle of its footprint.
    pub foot: FootPoint,
    /// Offset of the tool along the surface from above its contact, m: the surface is inclined where the body bends.
    pub offset: DVec3,
    /// Depth of the tool in the surface, m.
    pub penetration: f64,
    /// Whether it has begun in this tick beside another contact of the tool; its approach then counts from the present depth.
    pub is_new: bool,
    /// Largest depth that the tool can have reached since the last search for additional contacts, m.
    pub reachable_depth: f64,
    /// Whether its foot is fixed on its plane, because the surface has no closest point there any more or Newton's method has
    /// diverged: it fades by its rate, or if that is zero with the way of the tool along the plane.
    pub is_fading: bool,
    /// Normal of that plane, towards the tool: the direction of the force when it was fixed.
    pub plane_normal: DVec3,
    /// Its part of the half-space's stiffness, and the change of that part in a tick.
    pub part: f64,
    pub part_rate: f64,
    /// Friction at the end of the last tick.
    pub friction: Friction,
    /// Force on the body before the strain limit, N.
    pub force: DVec3,
}

impl LocalContact {
    /// Normal of the surface at the foot, or of the plane on which it is fixed.
    pub fn normal(&self) -> DVec3 {
        if self.is_fading { self.plane_normal } else { self.foot.normal }
    }

    /// Plane of the contact a tick ago, for a tool that is not a sphere.
    pub fn plane(&self) -> Plane {
        Plane { point: self.foot.position, normal: self.foot.normal }
    }
}
