//! Displacement of the drawn surface below a tool that indents a hyperelastic body.
//!
//! `Psi W f` is the displacement by a force on a patch of nodes, which is larger than the contact. By the law the tool has
//! approached by `d = d_local(F) + C_reg F + ..`; the patch moves less. The difference is that of the surface of a half-space
//! under one force on two areas. By Saint-Venant's principle it is confined to the surroundings of the contact. It is drawn as
//!
//! ```text
//! -n c (1 + r^2 / rho^2)^-3        rho^2 = 3/2 max(a^2, sum_i w_i r_i^2)
//! ```
//!
//! with the `c` at which the drawn triangle below the contact has moved by `d` along the inward normal `-n`. Nodes that are then
//! inside the tool are moved to its surface. The forces do not depend on this.

use glam::{DMat3, DVec3};

use super::body::BodyModel;
use super::contacts::Contact;
use super::model::Model;
use super::tool::{LawKind, ToolModel};
use crate::contact::TouchPatch;
use crate::contact::shape::ToolShape;

/// Distance up to which nodes are moved out of the tool, over its radius and over `rho`.
const REACH: f64 = 3.0;
/// Steps by which a node is moved out of the tool: the gradient of the distance changes along the way.
const STEPS: usize = 2;

/// Correction of the displacements around one contact; vectors are in the body's frame.
pub struct Indentation<'a> {
    point: DVec3,
    normal: DVec3,
    /// `c`, m.
    amplitude: f64,
    /// `rho`, m.
    width: f64,
    shape: &'a ToolShape,
    /// Position and rotation of the tool, withdrawn as far as the law holds its force back.
    position: DVec3,
    rotation: DMat3,
    reach: f64,
}

/// Corrections of the contacts of a body whose displacements without them are `displacement(node)`, m.
pub fn indentations<'a>(
    model: &'a Model,
    body: usize,
    contacts: impl Iterator<Item = (&'a Contact, &'a TouchPatch)>,
    displacement: impl Fn(u32) -> DVec3,
) -> Vec<Indentation<'a>> {
    let fixed = &model.bodies[body];
    let mut found: Vec<Indentation<'a>> = Vec::new();
    if !fixed.local.as_ref().is_some_and(|local| local.is_hyperelastic) {
        return found;
    }
    for (contact, patch) in contacts.filter(|(contact, _)| contact.law == LawKind::LOCAL && contact.body == body) {
        let corrected = |node: u32| apply(&found, fixed, node, displacement(node));
        if let Some(indentation) = Indentation::new(fixed, &model.tools[contact.tool], contact, patch, corrected) {
            found.push(indentation);
        }
    }
    found
}

/// Displacement of a surface node after all corrections, m; supported dofs stay.
pub fn apply(indentations: &[Indentation], body: &BodyModel, node: u32, displacement: DVec3) -> DVec3 {
    if indentations.is_empty() {
        return displacement;
    }
    let rest = body.green.surface.positions[node as usize];
    let corrected = indentations.iter().fold(displacement, |moved, indentation| indentation.apply(rest, moved));
    displacement + body.green.free_axes(node as usize) * (corrected - displacement)
}

impl<'a> Indentation<'a> {
    /// `None` for a contact that does not press.
    fn new(
        body: &BodyModel,
        tool: &'a ToolModel,
        contact: &Contact,
        patch: &TouchPatch,
        displacement: impl Fn(u32) -> DVec3,
    ) -> Option<Self> {
        let approach = (contact.depth - contact.local.entry_depth).max(0.0) * contact.share * contact.held;
        if contact.force == DVec3::ZERO || approach <= 0.0 {
            return None;
        }
        let (point, normal) = (contact.point, contact.normal);
        let below = body.query.closest(&body.loaded, point)?;
        let corners = body.loaded.triangles[below.triangle as usize].into_iter().zip(below.barycentric);
        let positions = &body.loaded.positions;
        let second_moment: f64 =
            patch.patch().iter().map(|(node, w)| w * positions[node].distance_squared(point)).sum();
        let width = (1.5 * second_moment.max(contact.radius.powi(2))).sqrt();
        let (mut moved, mut share) = (0.0, 0.0);
        for (node, weight) in corners {
            let distance = positions[node as usize].distance(point);
            moved -= weight * (displacement(node) - body.load_displacement(node as usize)).dot(normal);
            share += weight * profile(distance / width) * (body.green.free_axes(node as usize) * normal).dot(normal);
        }
        // Nothing is added to a triangle that supports hold almost wholly.
        let amplitude = if share > 0.1 { (approach - moved) / share } else { 0.0 };
        Some(Self {
            point,
            normal,
            amplitude,
            width,
            shape: &tool.shape,
            position: contact.local.tool_position + normal * (contact.depth - approach),
            rotation: DMat3::from_quat(contact.local.orientation),
            reach: REACH * tool.radius.max(width),
        })
    }

    /// Displacement `moved` of a node at `rest`, corrected, m.
    fn apply(&self, rest: DVec3, moved: DVec3) -> DVec3 {
        let distance = rest.distance(self.point);
        let mut place = rest + moved - self.normal * (self.amplitude * profile(distance / self.width));
        for _ in 0..if distance < self.reach { STEPS } else { 0 } {
            let (outside, away) = self.shape.signed_distance(self.rotation.transpose() * (place - self.position));
            place += self.rotation * away * (-outside).max(0.0);
        }
        place - rest
    }
}

/// `(1 + r^2)^-3`.
fn profile(r: f64) -> f64 {
    1.0 / (1.0 + r * r).powi(3)
}
