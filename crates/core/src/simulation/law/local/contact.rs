//! What a local contact remembers from tick to tick.

use glam::{DQuat, DVec3};

use super::friction::Friction;
use crate::contact::footprint::Plane;
use crate::contact::smooth::FootPoint;

/// How many requests for strain are remembered: more than are under way.
pub(in crate::simulation) const ASKED: usize = 8;

/// State of a contact under the local law; vectors are in the body's frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct LocalContact {
    /// Where the tool is, less what the device has not yet been let into, m, and how it is turned.
    pub tool: DVec3,
    /// How the tool is turned.
    pub orientation: DQuat,
    /// Where it is over the surface at rest, `p' = p - u`: what moves with the body below it does not count, m.
    pub relative: DVec3,
    /// How far it went there in the last tick, m.
    pub(in crate::simulation) advance: DVec3,
    /// How it was turned a tick ago.
    pub(in crate::simulation) turned: DQuat,
    /// Approach at which it began, m: a tool that appears inside starts from no force.
    pub entry: f64,
    /// The closest point of the surface at rest; of a tool that is no sphere the middle of its footprint.
    pub foot: FootPoint,
    /// How deep a tool that is no sphere lies below the plane of its footprint, m.
    pub(in crate::simulation) sunk: f64,
    /// Whether it is a place beside another one of the same tool: it may wait there without a force.
    pub(in crate::simulation) further: bool,
    /// Whether it has just been found, and counts from where it is then.
    pub(in crate::simulation) found: bool,
    /// Depth that it may have come to since it was looked for last, m.
    pub(in crate::simulation) came: f64,
    /// Whether its foot stays on the plane where it was: the surface there has no closest point any more.
    pub(in crate::simulation) held: bool,
    /// Part of the half-space's stiffness that it has, and how that changes in a tick.
    pub(in crate::simulation) part: f64,
    pub(in crate::simulation) change: f64,
    /// Friction at the end of the last tick.
    pub(in crate::simulation) friction: Friction,
    /// Torque on the tool about its tip, N m.
    pub torque: DVec3,
    /// Contact radius, m.
    pub radius: f64,
    /// Approach of the tool and the surface at rest, m.
    pub depth: f64,
    /// Felt stiffness along the normal, N/m.
    pub stiffness: f64,
    /// Whether it slips.
    pub slipping: bool,
    /// Force on the body before the limit of strain, N.
    pub(in crate::simulation) force: DVec3,
    /// Energy of the indentation and of the springs, J.
    pub(in crate::simulation) energy: f64,
    /// What friction took out in the last tick, J.
    pub(in crate::simulation) dissipated: f64,
    /// Share of its force that the limit of strain lets through.
    pub(in crate::simulation) share: f64,
    /// Places at which its strain was asked for, m, by the lowest digits of its serial then.
    pub(in crate::simulation) asked: [DVec3; ASKED],
}

impl LocalContact {
    /// The plane of the contact of a tool that is no sphere, as it was a tick ago.
    pub fn plane(&self) -> Plane {
        Plane { point: self.foot.position, normal: self.foot.normal }
    }
}
