//! Contacts that stick: a footprint stays on the material it first touched until release.
//!
//! With a footprint that does not move, `f = C^-1 d` is the gradient of `d^T C^-1 d / 2`: a closed path of the tool does no
//! net work. The anchor lies where the surface, sagged under the reference loads, was met: the tool's displacement from it
//! is the whole `d - W^T u_free`. A press ends where it would pull. Before that its anchor slips (`slip`), so that its
//! tangential force ends with the pressing one; the energy of that is lost, never gained.

use glam::DVec3;

use super::{Approach, Law};
use crate::contact::{Refusal, SurfacePoint};
use crate::simulation::contacts::{Contact, Mode};
use crate::simulation::state::EntryDepth;
use crate::simulation::tool::LawKind;
use crate::simulation::weight_scratch::WeightScratch;

/// A grab reaches this many tool radii from the surface.
const GRAB_REACH: f64 = 2.0;

/// Largest tangential force of a press, over its pressing force. Large enough that a tool sticks in any use: a half-space is softer
/// along its surface than into it, so that a drag must be more than five times as long as the press is deep; far above any dry
/// friction. Small enough that the jump in the last tick of a lift, five times the pressing force that one tick removes, is not
/// felt.
const STEEPEST_CONE: f64 = 5.0;

/// Nodes of a contact and their weights.
pub trait Footprint: Sync {
    /// The law with this footprint.
    fn kind(&self) -> LawKind;

    /// Sets `weight_scratch.candidate` to the nodes around `centre`, a point of the unloaded surface, with their weights.
    ///
    /// # Errors
    /// More nodes than a patch may have.
    fn weigh(
        &self,
        approach: &Approach<'_>,
        centre: &SurfacePoint,
        weight_scratch: &mut WeightScratch,
    ) -> Result<(), Refusal>;
}

/// The sticking law on a footprint.
pub struct Sticking<F>(pub F);

impl<F: Footprint> Law for Sticking<F> {
    fn kind(&self) -> LawKind {
        self.0.kind()
    }

    fn begin(
        &self,
        approach: &Approach<'_>,
        entry: &mut EntryDepth,
        weight_scratch: &mut WeightScratch,
    ) -> Result<Option<Contact>, Refusal> {
        let Some(closest) = approach.closest() else { return Ok(None) };
        let depth = approach.reach(closest.normal) - closest.signed_distance;
        entry.threshold = entry.threshold.min(depth.max(0.0));
        let reaches = match approach.grab {
            true => closest.signed_distance.abs() < GRAB_REACH * approach.tool.radius,
            false => depth > entry.threshold,
        };
        if !reaches {
            return Ok(None);
        }
        self.0.weigh(approach, &approach.body.material_point(&closest), weight_scratch)?;
        let excess = if approach.grab { 0.0 } else { depth - entry.threshold };
        let anchor = approach.position + closest.normal * excess;
        Ok(Some(Contact {
            mode: if approach.grab { Mode::Grab } else { Mode::Press },
            point: closest.position,
            normal: closest.normal,
            anchor,
            displacement: approach.position - anchor,
            tool_displacement: approach.position - anchor,
            ..Contact::new(self.kind(), (approach.tool_index, approach.body_index))
        }))
    }

    fn update(&self, approach: &Approach<'_>, contact: &mut Contact) -> bool {
        contact.tool_displacement = approach.position - contact.anchor;
        contact.displacement = contact.tool_displacement;
        contact.slipped = DVec3::ZERO;
        match contact.mode {
            Mode::Grab if !approach.grab => return false,
            Mode::Press if approach.grab => contact.mode = Mode::Grab,
            _ => {}
        }
        true
    }

    fn ends(&self, contact: &Contact) -> bool {
        contact.mode == Mode::Press && contact.force.dot(contact.normal) >= 0.0
    }

    /// A grab carries any force.
    fn cone(&self, contact: &Contact) -> Option<f64> {
        (contact.mode == Mode::Press).then_some(STEEPEST_CONE)
    }
}
