//! The trait of contact laws.

use super::{Approach, TickMemory};
use crate::contact::Refusal;
use crate::simulation::contacts::Contact;
use crate::simulation::input::Controls;
use crate::simulation::model::Model;
use crate::simulation::solve::add_contact;
use crate::simulation::state::{EntryDepth, State};
use crate::simulation::tool::LawKind;
use crate::simulation::weight_scratch::WeightScratch;

/// A contact law, its methods in the order of a tick. It stores nothing: its state is in contacts, its memory in [`TickMemory`].
///
/// A law whose forces are linear in the displacements of the tools from their anchors leaves them to the tick, which solves for all
/// such contacts of a body together. The contacts of another law are marked as `nonlinear`; it finds their forces itself.
pub trait Law: Sync {
    /// Its kind.
    fn kind(&self) -> LawKind;

    /// The law of its tools while they grab.
    fn grab_law(&self) -> LawKind {
        self.kind()
    }

    /// For a tool without a contact: begins one where it reaches the body, with its patch in `weight_scratch`. `entry` is the
    /// tool's depth in this body.
    ///
    /// # Errors
    /// Why the body cannot be touched there.
    fn begin(
        &self,
        approach: &Approach<'_>,
        entry: &mut EntryDepth,
        weight_scratch: &mut WeightScratch,
    ) -> Result<Option<Contact>, Refusal>;

    /// Puts a new contact into a slot. `None` if no slot is empty, or if the body cannot be touched there.
    fn add(
        &self,
        model: &Model,
        state: &mut State,
        new_contact: Contact,
        weight_scratch: &WeightScratch,
    ) -> Option<usize> {
        add_contact(model, state, new_contact, weight_scratch)
    }

    /// Follows the tool; false ends the contact.
    fn update(&self, approach: &Approach<'_>, contact: &mut Contact) -> bool;

    /// Whether a contact persists; beside a fading one its tool may begin another.
    fn persists(&self, _contact: &Contact) -> bool {
        true
    }

    /// Adds contacts of a tool beside those that it has.
    fn find_additional(&self, _model: &Model, _state: &mut State, _memory: TickMemory<'_>, _pair: (usize, usize)) {}

    /// Finds the forces of its contacts with a body, given those of all others.
    fn find_forces(
        &self,
        _model: &Model,
        _state: &mut State,
        _memory: TickMemory<'_>,
        _body: usize,
        _controls: &Controls,
    ) {
    }

    /// Displacement of the body below the tool by a contact, m: the strain limit bounds it.
    fn body_displacement(&self, contact: &Contact) -> f64 {
        contact.displacement.length()
    }

    /// Largest tangential force of a linear contact, over its pressing force: beyond it the anchor slips. `None` for no bound.
    fn cone(&self, _contact: &Contact) -> Option<f64> {
        None
    }

    /// Whether the contact ends by its force.
    fn ends(&self, contact: &Contact) -> bool;

    /// Stores the depth of the tool when a contact has ended by its force, so that the force of the next one starts from zero. On a
    /// body at rest a contact that has never pressed is ignored: other contacts have displaced the surface, and the tool tries
    /// again until it reaches it.
    fn store_entry_depth(&self, model: &Model, state: &mut State, contact: &Contact) {
        let (tool, body) = (contact.tool, contact.body);
        if !model.bodies[body].moves() && !contact.has_pressed {
            return;
        }
        let position = contact.anchor + contact.tool_displacement;
        let motion = state.bodies[body].motion.as_ref();
        state.tools[tool].entry[body].threshold = Approach::at(model, motion, tool, body, position).depth();
    }

    /// Adds contacts beside those of a body whose forces have been found.
    fn find_additional_by_force(&self, _model: &Model, _state: &mut State, _memory: TickMemory<'_>, _body: usize) {}

    /// Whether a finite wrench of a contact is physically possible: the last check before it leaves the tick.
    fn is_sound(&self, _model: &Model, _contact: &Contact, _stiffness_scale: f64) -> bool {
        true
    }
}
