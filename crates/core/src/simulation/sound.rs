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
    // A contact that fades (`solve/handover.rs`) stays at its place while its tool moves on.
    let at_tool = local.held || contact.point.distance(local.relative) <= (2.0 + BESIDE) * size + depth;
    let most = MARGIN * 2.0 * own.largest_modulus * stiffness_scale * size * (depth + LEAST_DEPTH * size);
    on_body && at_tool && contact.force.length() <= most
}

#[cfg(test)]
#[path = "../../tests/common/mod.rs"]
mod bodies;

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{DQuat, DVec3};

    use super::*;
    use crate::contact::Moduli;
    use crate::green::{Precision, precompute};
    use crate::simulation::step::answer;
    use crate::simulation::{BodyModel, Input, Placement, Pose, Scratch, State, ToolInput, ToolModel, step};

    /// A tool of the local law on the top of a cube, 1 mm deep.
    fn pressed(shape: ToolShape) -> (Model, State) {
        let green = precompute(&bodies::cube(4), Precision::F32, &|_, _| true).expect("a solvable cube");
        let nodes = green.surface_count();
        let moduli = Moduli { youngs: vec![10e3; nodes], poissons: vec![0.4; nodes], homogeneous: true };
        let body = BodyModel::new(Arc::new(green), Placement::default()).expect("a body");
        let body = body.with_moduli(moduli).expect("constants that match");
        let tool =
            ToolModel { shape, radius: 0.005, law: LawKind::Local, pad_youngs_modulus: None, max_stiffness: 5000.0 };
        let model = Model::new(vec![body], vec![tool]).expect("a scene");
        let (mut state, mut scratch, mut input) = (State::new(&model), Scratch::new(&model), Input::default());
        for tick in 0..=30 {
            let height = 0.1 + 0.005 + 2e-3 - 1e-4 * f64::from(tick);
            let pose = Pose { position: DVec3::new(0.05, 0.05, height), orientation: DQuat::IDENTITY };
            input.tools[0] = ToolInput { pose, active: true, ..ToolInput::default() };
            let output = step(&model, &mut state, &mut scratch, &input);
            assert!(!output.unsound[0]);
        }
        (model, state)
    }

    #[test]
    fn a_contact_that_cannot_be_is_found_and_gives_no_force() {
        let shapes = [ToolShape::sphere(0.005), ToolShape::ellipsoid(DVec3::new(0.006, 0.007, 0.005))];
        for shape in shapes.map(|shape| shape.expect("a shape")) {
            let (model, mut state) = pressed(shape);
            let slot = state.contacts.of(0, 0).next().expect("a contact");
            let sound = state.contacts.slots[slot];
            assert!(sound.force.length() > 1e-3 && is_sound(&model, &sound, 1.0));
            let wrong: [fn(&mut Contact); 5] = [
                |contact| contact.force.x = f64::NAN,
                |contact| contact.local.torque.z = f64::INFINITY,
                |contact| contact.force *= 30.0,
                |contact| contact.point.x += 1.0,
                |contact| contact.local.relative.y += 0.1,
            ];
            for change in wrong {
                let mut contact = sound;
                change(&mut contact);
                assert!(!is_sound(&model, &contact, 1.0), "{:?} {:?}", contact.force, contact.point);
            }
            state.contacts.slots[slot].force *= 30.0;
            let output = answer(&model, &state);
            assert!(output.unsound[0] && output.in_contact[0]);
            assert_eq!((output.wrench_on_device[0], output.unlimited[0]), Default::default());
        }
    }
}
