//! What evolves: contacts in slots, what tools remember, bodies.

use glam::{DMat3, DVec3};

use super::limit::{Rebound, StrainWatch};
use super::motion::Motion;
use super::{MAX_BODIES, MAX_CONTACTS, MAX_TOOLS, Model};
use crate::contact::{Refusal, TouchPatch};

/// What a contact does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// The slot is empty.
    #[default]
    Free,
    /// Touching, unilateral: never pulls.
    Press,
    /// Holding on, bilateral.
    Grab,
}

/// A contact of one tool with one body; vectors are in the body's frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Contact {
    // Written when it begins.
    /// What it does; [`Mode::Free`] is an empty slot.
    pub mode: Mode,
    /// Index of the tool.
    pub tool: usize,
    /// Index of the body.
    pub body: usize,
    /// Counts the contacts since the start: tells one from another in the same slot.
    pub serial: u64,
    /// Contact point on the untouched surface, m.
    pub point: DVec3,
    /// Unit outward normal there.
    pub normal: DVec3,
    /// Tool position at which the contact carries no force, m.
    pub anchor: DVec3,

    // Written every tick.
    /// Displacement of the tool from the anchor, as far as the limit of strain lets it, m.
    pub displacement: DVec3,
    /// Which part that is of the whole displacement.
    pub share: f64,
    /// Bound on its length while the limit is not known yet, m.
    pub(super) bound: f64,
    /// Force on the body, N.
    pub force: DVec3,
}

/// Slots for contacts. The patches stand apart, so that looking through the slots touches little memory.
#[derive(Clone, Debug)]
pub struct Contacts {
    pub(super) slots: [Contact; MAX_CONTACTS],
    pub(super) patches: Vec<TouchPatch>,
    pub(super) begun: u64,
}

impl Default for Contacts {
    fn default() -> Self {
        Self { slots: Default::default(), patches: vec![TouchPatch::default(); MAX_CONTACTS], begun: 0 }
    }
}

impl Contacts {
    /// The contacts and their patches.
    pub fn iter(&self) -> impl Iterator<Item = (&Contact, &TouchPatch)> {
        self.slots.iter().zip(&self.patches).filter(|(contact, _)| contact.mode != Mode::Free)
    }

    /// Slots of the contacts of a body.
    pub(super) fn on(&self, body: usize) -> impl Iterator<Item = usize> + '_ {
        (0..MAX_CONTACTS).filter(move |&slot| self.slots[slot].mode != Mode::Free && self.slots[slot].body == body)
    }

    /// Slot of the contact of a tool with a body.
    pub(super) fn of(&self, tool: usize, body: usize) -> Option<usize> {
        self.on(body).find(|&slot| self.slots[slot].tool == tool)
    }

    /// An empty slot.
    pub(super) fn empty(&self) -> Option<usize> {
        (0..MAX_CONTACTS).find(|&slot| self.slots[slot].mode == Mode::Free)
    }

    /// Empties a slot.
    pub(super) fn clear(&mut self, slot: usize) {
        self.slots[slot] = Contact::default();
    }

    /// Copies the contacts that there are; nothing is allocated.
    pub(super) fn copy_from(&mut self, other: &Contacts) {
        self.begun = other.begun;
        for slot in 0..MAX_CONTACTS {
            self.slots[slot] = other.slots[slot];
            if other.slots[slot].mode != Mode::Free {
                self.patches[slot].copy_from(&other.patches[slot]);
            }
        }
    }
}

/// What a tool remembers of each body it does not touch.
#[derive(Clone, Copy, Debug, Default)]
pub struct ToolState {
    /// Penetration of the untouched surface at which the next contact begins, m: zero for a tool that came from outside, and
    /// the least reached since for one that was released inside, so that a force always starts from zero.
    pub entry_depth: [f64; MAX_BODIES],
    /// Where a limited tool was left by a body in motion.
    pub rebound: [Option<Rebound>; MAX_BODIES],
    /// Why no contact began where the tool reaches the body.
    pub refused: [Option<Refusal>; MAX_BODIES],
}

/// What evolves of one body.
#[derive(Clone, Debug)]
pub struct BodyState {
    /// Young's modulus over the Green's function's.
    pub stiffness_scale: f64,
    /// How the body moves, if it does.
    pub motion: Option<Motion>,
    /// Strain under the contacts, once it is prepared.
    pub strain: Option<Box<StrainWatch>>,
}

/// State of a simulation.
#[derive(Clone, Debug)]
pub struct State {
    /// One a body of the model.
    pub bodies: Vec<BodyState>,
    /// One a tool, used or not.
    pub tools: [ToolState; MAX_TOOLS],
    /// The contacts.
    pub contacts: Contacts,
    /// Static compliance between the contacts in two slots, at the Green's function's own Young's modulus, m/N.
    pub(super) compliance: Box<[[DMat3; MAX_CONTACTS]; MAX_CONTACTS]>,
}

impl State {
    pub(super) fn at_rest(model: &Model) -> Self {
        let body = |body: &super::BodyModel| BodyState {
            stiffness_scale: 1.0,
            motion: body.dynamics.as_ref().map(|dynamics| Motion::new(&dynamics.modes)),
            strain: None,
        };
        Self {
            bodies: model.bodies.iter().map(body).collect(),
            tools: Default::default(),
            contacts: model.contacts(),
            compliance: Box::new([[DMat3::ZERO; MAX_CONTACTS]; MAX_CONTACTS]),
        }
    }

    /// Takes up strain responses that were prepared; the one before is handed back, for its memory must not be freed in a
    /// tick.
    pub fn watch_strain(&mut self, body: usize, watch: Box<StrainWatch>) -> Option<Box<StrainWatch>> {
        match self.bodies.get_mut(body) {
            Some(state) => state.strain.replace(watch),
            None => Some(watch),
        }
    }

    /// Displacement of one surface node of a body, m, in the body's frame; never allocates.
    pub fn displacement_of(&mut self, model: &Model, body: usize, node: usize) -> DVec3 {
        let Self { bodies, contacts, .. } = self;
        let (Some(fixed), Some(state)) = (model.bodies.get(body), bodies.get_mut(body)) else { return DVec3::ZERO };
        let Some(free) = fixed.free.get(3 * node..3 * node + 3) else { return DVec3::ZERO };
        let mut sum = DVec3::from_slice(free);
        for slot in contacts.on(body) {
            let compliance = contacts.patches[slot].compliance_at(&fixed.green, node);
            sum += compliance * contacts.slots[slot].force / state.stiffness_scale;
        }
        if let (Some(motion), Some(dynamics)) = (&mut state.motion, &fixed.dynamics) {
            sum += motion.beyond_static(&dynamics.modes, contacts, body, node);
        }
        sum
    }
}
