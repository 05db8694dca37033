//! Whether a contact can be what it is: the last look before its wrench leaves the tick.
//!
//! No tool presses a half-space harder than a flat punch as wide as itself does, `F <= 2 E* a d` (Boussinesq), at the largest modulus
//! of the body's surface. A contact lies on its body, and no farther from its tool than that reaches. Whatever breaks this is an
//! error of the method, not a force.

use super::contacts::Contact;
use super::law::depth_below;
use super::model::Model;
use super::tool::LawKind;
use crate::contact::shape::ToolShape;

/// What the inclination of the force by the body's compliance, materials that differ with depth, and the two friction directions
/// may add to the force of a punch.
const MARGIN: f64 = 4.0;
/// A contact may lie outside of the box around its body by this part of the tool's size, and this far beyond the tool's reach.
const BESIDE: f64 = 1.0;
/// A tool that barely touches is taken to be as deep as this part of its size.
const LEAST_DEPTH: f64 = 1e-2;

/// Whether the wrench of a contact may leave the tick.
pub fn is_sound(model: &Model, contact: &Contact, stiffness_scale: f64) -> bool {
    let local = &contact.local;
    if !(contact.force.is_finite() && local.torque.is_finite() && contact.point.is_finite()) {
        return false;
    }
    let (body, tool) = (&model.bodies[contact.body], &model.tools[contact.tool]);
    let (LawKind::Local, Some(own)) = (contact.law, &body.local) else { return true };
    let size = tool.shape.bounding_radius();
    let depth = match tool.shape {
        ToolShape::Sphere { radius } => radius - (local.relative - local.foot.position).dot(local.foot.normal),
        ref shape => {
            let pose = (local.relative, glam::DMat3::from_quat(local.orientation));
            depth_below(shape, pose, &local.foot).max(local.sunk)
        }
    }
    .max(0.0);
    let [low, high] = own.bounds.map(|corner| corner - contact.point);
    let on_body = low.max_element() <= BESIDE * size && high.min_element() >= -BESIDE * size;
    // One that fades stays where it was while its tool goes on.
    let at_tool = local.held || contact.point.distance(local.relative) <= (2.0 + BESIDE) * size + depth;
    let most = MARGIN * 2.0 * own.largest_modulus * stiffness_scale * size * (depth + LEAST_DEPTH * size);
    on_body && at_tool && contact.force.length() <= most
}
