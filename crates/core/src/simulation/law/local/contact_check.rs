//! Last check of a contact under the local law.
//!
//! No tool presses a half-space harder than a flat punch as wide as itself does, `F <= 2 E* a d` (Boussinesq), at the largest
//! modulus of the body's surface. A contact lies on its body, and no farther from its tool than that reaches. A contact that
//! violates this is an error of the method.

use super::foot_jumps::contact_depth;
use crate::simulation::contacts::Contact;
use crate::simulation::model::Model;

/// Factor over the force of a punch, for the inclination of the force by the body's compliance, materials that change with depth,
/// and both directions of friction.
const MARGIN: f64 = 4.0;
/// Distance over the tool's size by which a contact may lie outside of its body's bounding box, and beyond the tool's reach.
const MARGIN_OUTSIDE: f64 = 1.0;
/// Least depth that the bound is computed with, over the tool's size.
const LEAST_DEPTH: f64 = 1e-2;

/// Whether a finite wrench of a contact is physically possible.
pub fn is_sound(model: &Model, contact: &Contact, stiffness_scale: f64) -> bool {
    let local = &contact.local;
    let (body, tool) = (&model.bodies[contact.body], &model.tools[contact.tool]);
    let Some(own) = &body.local else { return true };
    let size = tool.shape.bounding_radius();
    let depth = contact_depth(tool, contact, local.relative_position).max(local.penetration).max(0.0);
    let [low, high] = own.bounds.map(|corner| corner - contact.point);
    let on_body = low.max_element() <= MARGIN_OUTSIDE * size && high.min_element() >= -MARGIN_OUTSIDE * size;
    // A contact that fades (`foot_jumps`) stays at its place while its tool moves on.
    let at_tool =
        local.is_fading || contact.point.distance(local.relative_position) <= (2.0 + MARGIN_OUTSIDE) * size + depth;
    let most = MARGIN * 2.0 * own.largest_modulus * stiffness_scale * size * (depth + LEAST_DEPTH * size);
    on_body && at_tool && contact.force.length() <= most
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{DQuat, DVec3};

    use super::*;
    use crate::contact::Moduli;
    use crate::contact::shape::ToolShape;
    use crate::green::{Precision, precompute};
    use crate::simulation::law::{bodies, is_sound};
    use crate::simulation::step::output_wrenches;
    use crate::simulation::tool::LawKind;
    use crate::simulation::{BodyModel, Input, Placement, Pose, Scratch, State, ToolInput, ToolModel, step};

    /// A tool of the local law on the top of a cube, 1 mm deep.
    fn pressed(shape: ToolShape) -> (Model, State) {
        let green = precompute(&bodies::cube(4), Precision::F32, &|_, _| true).expect("a solvable cube");
        let nodes = green.surface_count();
        let moduli = Moduli::linear(vec![10e3; nodes], vec![0.4; nodes], true);
        let body = BodyModel::new(Arc::new(green), Placement::default()).expect("a body");
        let body = body.with_moduli(moduli).expect("constants that match");
        let tool =
            ToolModel { shape, radius: 0.005, law: LawKind::LOCAL, pad_youngs_modulus: None, max_stiffness: 5000.0 };
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
                |contact| contact.torque.z = f64::INFINITY,
                |contact| contact.force *= 30.0,
                |contact| contact.point.x += 1.0,
                |contact| contact.local.relative_position.y += 0.1,
            ];
            for change in wrong {
                let mut contact = sound;
                change(&mut contact);
                assert!(!is_sound(&model, &contact, 1.0), "{:?} {:?}", contact.force, contact.point);
            }
            state.contacts.slots[slot].force *= 30.0;
            let output = output_wrenches(&model, &state);
            assert!(output.unsound[0] && output.in_contact[0]);
            assert_eq!((output.wrench_on_device[0], output.unlimited[0]), Default::default());
        }
    }
}
