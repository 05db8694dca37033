//! A spring between tool and body, for tests: the smallest contact law.

use glam::DVec3;

use super::patch::Patch;
use super::stick::Footprint;
use super::{Approach, Law, TickMemory};
use crate::contact::Refusal;
use crate::simulation::contacts::{Contact, Mode};
use crate::simulation::input::Controls;
use crate::simulation::model::Model;
use crate::simulation::state::{EntryDepth, State};
use crate::simulation::tool::LawKind;
use crate::simulation::weight_scratch::WeightScratch;

/// Force over depth, N/m.
const STIFFNESS: f64 = 200.0;

impl LawKind {
    /// A spring along the normal.
    pub const SPRING: Self = Self { name: "spring", needs_moduli: false };
}

/// A force along the normal of the place first touched, proportional to the depth of the tool below it.
pub struct Spring;

impl Law for Spring {
    fn kind(&self) -> LawKind {
        LawKind::SPRING
    }

    fn begin(
        &self,
        approach: &Approach<'_>,
        _entry: &mut EntryDepth,
        weight_scratch: &mut WeightScratch,
    ) -> Result<Option<Contact>, Refusal> {
        let Some(closest) = approach.closest() else { return Ok(None) };
        let depth = approach.reach(closest.normal) - closest.signed_distance;
        if depth <= 0.0 {
            return Ok(None);
        }
        Patch.weigh(approach, &approach.body.material_point(&closest), weight_scratch)?;
        let pressed = -closest.normal * depth;
        Ok(Some(Contact {
            nonlinear: true,
            point: closest.position,
            normal: closest.normal,
            anchor: approach.position - pressed,
            displacement: pressed,
            tool_displacement: pressed,
            ..Contact::new(self.kind(), (approach.tool_index, approach.body_index))
        }))
    }

    fn update(&self, approach: &Approach<'_>, contact: &mut Contact) -> bool {
        contact.tool_displacement = approach.position - contact.anchor;
        contact.displacement = contact.tool_displacement;
        true
    }

    fn find_forces(
        &self,
        _model: &Model,
        state: &mut State,
        _memory: TickMemory<'_>,
        body: usize,
        _controls: &Controls,
    ) {
        for contact in &mut state.contacts.slots {
            if contact.mode == Mode::Press && contact.law == self.kind() && contact.body == body {
                contact.depth = -contact.displacement.dot(contact.normal);
                contact.force = -contact.normal * (STIFFNESS * contact.depth).max(0.0);
            }
        }
    }

    fn ends(&self, contact: &Contact) -> bool {
        contact.force == DVec3::ZERO
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::contact::shape::ToolShape;
    use crate::green::{Precision, precompute};
    use crate::simulation::law::bodies;
    use crate::simulation::{BodyModel, Input, MAX_TOOLS, Placement, Pose, Scratch, ToolInput, ToolModel, step};

    const RADIUS: f64 = 0.01;
    /// The top of the cube, m.
    const TOP: f64 = 0.1;

    fn scene() -> Model {
        let green = precompute(&bodies::cube(4), Precision::F64, &|_, _| true).expect("a solvable cube");
        let body = BodyModel::new(Arc::new(green), Placement::default()).expect("a body");
        let law = LawKind::parse("spring").expect("a law");
        let shape = ToolShape::sphere(RADIUS).expect("a sphere");
        let spring = ToolModel { shape, radius: RADIUS, law, pad_youngs_modulus: None, max_stiffness: 5000.0 };
        let patch = ToolModel { law: LawKind::PATCH, ..spring.clone() };
        Model::new(vec![body], vec![spring, patch]).expect("a scene")
    }

    fn tool_at(x: f64, depth: f64) -> ToolInput {
        let pose = Pose::at(DVec3::new(x, 0.05, TOP + RADIUS - depth));
        ToolInput { pose, active: true, ..ToolInput::default() }
    }

    /// Over a whole press the force is that of the spring, and the release ends the contact.
    #[test]
    fn a_press_gives_the_force_of_the_spring() {
        let model = scene();
        let (mut state, mut scratch, mut input) = (State::new(&model), Scratch::new(&model), Input::default());
        input.controls.contact_radius = [0.02; MAX_TOOLS];
        for tick in 0..=200 {
            let depth = 3e-3 * (f64::from(tick) / 200.0 * std::f64::consts::PI).sin() - 1e-4;
            input.tools[0] = tool_at(0.05 + 1e-5 * f64::from(tick), depth);
            let output = step(&model, &mut state, &mut scratch, &input);
            let force = output.wrench_on_device[0].force;
            assert!((force - DVec3::Z * 200.0 * depth.max(0.0)).length() < 1e-9, "{tick}: {force}");
            assert_eq!(output.in_contact[0], depth > 0.0);
        }
    }

    /// A linear contact beside it touches the surface that the spring has displaced: the deeper its patch lies, the smaller its
    /// force.
    #[test]
    fn a_patch_feels_the_dent_of_the_spring() {
        let model = scene();
        let press = |depth: f64| {
            let (mut state, mut scratch, mut input) = (State::new(&model), Scratch::new(&model), Input::default());
            input.controls.contact_radius = [0.02; MAX_TOOLS];
            for tick in 0..20 {
                let part = f64::from(tick) / 19.0;
                input.tools[1] = tool_at(0.07, 2e-3 * part - 1e-6);
                input.tools[0] = tool_at(0.03, depth * part - 1e-6);
                step(&model, &mut state, &mut scratch, &input);
            }
            let contact = |tool: usize| state.contacts.slots[state.contacts.of(tool, 0).next().expect("a contact")];
            let patches = [0, 1].map(|tool| state.contacts.of(tool, 0).next().expect("a contact"));
            let [spring, patch] = patches.map(|slot| &state.contacts.patches[slot]);
            let dent = patch.compliance_with(&model.bodies[0].green, spring) * contact(0).force;
            (contact(1).force, dent, patch.own_compliance(&model.bodies[0].green))
        };
        let (beside, dent, compliance) = press(2e-3);
        let (alone, none, _) = press(2e-6);
        // The force of the patch is smaller by its own stiffness times the displacement by the spring.
        let expected = compliance.inverse() * (dent - none);
        assert!(dent.z < -1e-6 && ((alone - beside) - expected).length() < 1e-3 * expected.length());
    }
}
