//! Contacts that stick: a footprint stays on the material it first touched until release.
//!
//! With a footprint that does not move, `f = C^-1 d` is the gradient of `d^T C^-1 d / 2`: a closed path of the tool does no
//! net work. The anchor lies where the surface, sagged under the reference loads, was met: the tool's displacement from it
//! is the whole `d - W^T u_free`. A press lets go where it would pull. Before it does, its anchor slips (`slip`), so that its
//! tangential force ends with the pressing one; the energy of that is lost, never gained.

use glam::{DMat3, DVec3};

use super::{Approach, Law};
use crate::contact::{Refusal, SurfacePoint, smallest_eigenvalue};
use crate::simulation::body::BodyDynamics;
use crate::simulation::contacts::{Contact, Mode};
use crate::simulation::covering::Covering;
use crate::simulation::state::Entry;
use crate::simulation::tool::{LawKind, ToolModel};

/// A grab reaches this many tool radii from the surface.
const GRAB_REACH: f64 = 2.0;

/// A press carries no more tangential force than this many times its pressing force. Steep enough that a tool sticks however
/// it is used: a half-space is softer along its surface than into it, so that a drag must be more than five times as long as the
/// press is deep; far above any dry friction. Low enough that what is left for the last tick of a lift, five times
/// the pressing force that one tick takes away, is not felt.
const STEEPEST_CONE: f64 = 5.0;

/// Which nodes a contact takes, and with what weights.
pub trait Footprint: Sync {
    /// The law that it makes.
    fn kind(&self) -> LawKind;

    /// Weighs the nodes around `centre`, a point of the unloaded surface, into `covering.candidate`.
    ///
    /// # Errors
    /// More nodes than a tick can weigh.
    fn cover(&self, approach: &Approach<'_>, centre: &SurfacePoint, covering: &mut Covering) -> Result<(), Refusal>;
}

/// Compliance in series with the body's own at a contact that sticks, the same in all directions, m/N.
///
/// A body in motion is coupled by a spring. Near a support, where a body at rest is stiffer than any device can render, its
/// compliance is raised evenly so that no direction exceeds the tool's maximum stiffness.
pub fn series_compliance(tool: &ToolModel, dynamics: Option<&BodyDynamics>, own: &DMat3) -> f64 {
    match dynamics {
        Some(dynamics) => 1.0 / dynamics.coupling,
        None => (1.0 / tool.max_stiffness - smallest_eigenvalue(own)).max(0.0),
    }
}

/// The sticking law on a footprint.
pub struct Sticking<F>(pub F);

impl<F: Footprint> Law for Sticking<F> {
    fn begin(
        &self,
        approach: &Approach<'_>,
        entry: &mut Entry,
        covering: &mut Covering,
    ) -> Result<Option<Contact>, Refusal> {
        let Some(closest) = approach.closest() else { return Ok(None) };
        let depth = approach.reach(closest.normal) - closest.signed_distance;
        entry.depth = entry.depth.min(depth.max(0.0));
        let reaches = match approach.grab {
            true => closest.signed_distance.abs() < GRAB_REACH * approach.tool.radius,
            false => depth > entry.depth,
        };
        if !reaches {
            return Ok(None);
        }
        self.0.cover(approach, &approach.body.material_point(&closest), covering)?;
        let excess = if approach.grab { 0.0 } else { depth - entry.depth };
        let anchor = approach.position + closest.normal * excess;
        Ok(Some(Contact {
            law: self.0.kind(),
            mode: if approach.grab { Mode::Grab } else { Mode::Press },
            tool: approach.tool_index,
            body: approach.body_index,
            point: closest.position,
            normal: closest.normal,
            anchor,
            displacement: approach.position - anchor,
            wanted: approach.position - anchor,
            ..Contact::default()
        }))
    }

    fn update(&self, approach: &Approach<'_>, contact: &mut Contact) -> bool {
        contact.wanted = approach.position - contact.anchor;
        contact.displacement = contact.wanted;
        contact.slipped = DVec3::ZERO;
        match contact.mode {
            Mode::Grab if !approach.grab => return false,
            Mode::Press if approach.grab => contact.mode = Mode::Grab,
            _ => {}
        }
        true
    }

    fn end(&self, contact: &Contact) -> bool {
        contact.mode == Mode::Press && contact.force.dot(contact.normal) >= 0.0
    }

    /// A tool that holds on carries any force.
    fn cone(&self, contact: &Contact) -> Option<f64> {
        (contact.mode == Mode::Press).then_some(STEEPEST_CONE)
    }
}
