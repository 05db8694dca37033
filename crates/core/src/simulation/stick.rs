//! The sticking contact law: the patch stays on the material it first touched until release.
//!
//! With a patch that does not move, `f = C^-1 d` is the gradient of `d^T C^-1 d / 2`: a closed path of the tool does no
//! net work. The anchor lies where the surface, sagged under the reference loads, was met: the way from it is the whole
//! `d - W^T u_free`. A press lets go where it would pull; its tangential energy is then lost, never gained.

use glam::DVec3;

use super::{Input, Mode, Model, Motion, Scratch, ToolContact, ToolInput};
use crate::contact::{SurfacePoint, patch_weights};

/// A grab reaches this many tool radii from the surface.
const GRAB_REACH: f64 = 2.0;
/// A tool farther than this many radii from the surface at rest meets it there: displacements are smaller than that.
const MOVING_REACH: f64 = 4.0;

/// Begins or ends a contact. Returns whether a new one began.
pub(super) fn advance(
    model: &Model,
    moving: Option<&Motion>,
    contact: &mut ToolContact,
    scratch: &mut Scratch,
    tool: &ToolInput,
    input: &Input,
) -> bool {
    contact.refused = false;
    contact.position = tool.position;
    if !tool.active || input.reset || !tool.position.is_finite() {
        contact.clear(tool.position);
        return false;
    }
    match contact.mode {
        Mode::Free => {
            let closest = meet(model, moving, tool.position);
            closest.is_some_and(|closest| begin(model, contact, scratch, tool, &closest, input.contact_radius))
        }
        Mode::Grab if !tool.grab => {
            release(model, moving, contact);
            false
        }
        Mode::Press if tool.grab => {
            contact.mode = Mode::Grab;
            false
        }
        Mode::Press | Mode::Grab => false,
    }
}

/// Closest point of the surface where it is now, as a point of the loaded surface at rest.
fn meet(model: &Model, moving: Option<&Motion>, position: DVec3) -> Option<SurfacePoint> {
    let closest = model.closest(position)?;
    match (moving, &model.dynamics) {
        (Some(motion), Some(dynamics)) if closest.signed_distance.abs() < MOVING_REACH * model.tool_radius => {
            model.closest(position - motion.displacement_at(model, &dynamics.modes, &closest))
        }
        _ => Some(closest),
    }
}

fn begin(
    model: &Model,
    contact: &mut ToolContact,
    scratch: &mut Scratch,
    tool: &ToolInput,
    closest: &SurfacePoint,
    radius: f64,
) -> bool {
    let depth = model.tool_radius - closest.signed_distance;
    contact.entry_depth = contact.entry_depth.min(depth.max(0.0));
    let reaches = if tool.grab {
        closest.signed_distance.abs() < GRAB_REACH * model.tool_radius
    } else {
        depth > contact.entry_depth
    };
    if !reaches || !cover(model, contact, scratch, &model.material_point(closest), radius) {
        return false;
    }
    contact.mode = if tool.grab { Mode::Grab } else { Mode::Press };
    contact.point = closest.position;
    contact.normal = closest.normal;
    let excess = if tool.grab { 0.0 } else { depth - contact.entry_depth };
    contact.anchor = tool.position + closest.normal * excess;
    true
}

/// Weighs the nodes under the contact; refuses one that leaves the touch region.
fn cover(model: &Model, contact: &mut ToolContact, scratch: &mut Scratch, centre: &SurfacePoint, radius: f64) -> bool {
    let surface = &model.green.surface;
    let covered = patch_weights(surface, centre, radius, &mut scratch.patch, &mut scratch.candidate);
    let patch = &scratch.candidate;
    let usable = covered == patch.count && patch.iter().all(|(node, _)| model.green.touchable(node).is_some());
    if usable {
        contact.patch.clone_from(patch);
    }
    contact.refused = !usable;
    usable
}

/// Ends a press whose force has come to pull on the tool.
pub(super) fn release_if_pulling(model: &Model, moving: Option<&Motion>, contact: &mut ToolContact) -> bool {
    let pulls = contact.mode == Mode::Press && contact.force.dot(contact.normal) >= 0.0;
    if pulls {
        release(model, moving, contact);
    }
    pulls
}

fn release(model: &Model, moving: Option<&Motion>, contact: &mut ToolContact) {
    let closest = meet(model, moving, contact.position);
    let depth = closest.map_or(0.0, |closest| model.tool_radius - closest.signed_distance);
    contact.entry_depth = depth.max(0.0);
    contact.mode = Mode::Free;
    contact.patch.count = 0;
    contact.force = DVec3::ZERO;
}
