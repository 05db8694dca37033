//! What evolves: contacts, what tools remember, bodies.

use glam::{DMat3, DVec3};

use super::body::BodyModel;
use super::contacts::Contacts;
use super::input::Pose;
use super::law::takes_cells;
use super::model::Model;
use super::motion::Motion;
use super::passivity::Passivity;
use super::strain_watch::{LimitShare, StrainWatch};
use super::{MAX_BODIES, MAX_CONTACTS, MAX_TOOLS};
use crate::contact::Refusal;
use crate::contact::local::cells::PressureState;

/// How deep a tool is in the untouched surface of a body without a contact.
#[derive(Clone, Copy, Debug, Default)]
pub struct Entry {
    /// Depth at which the next contact begins, m: zero for a tool that came from outside, and the least reached since for one
    /// that was released inside, so that a force always starts from zero.
    pub depth: f64,
    /// Depth a tick ago, m, zero outside: a tool may be there without a force, in a dent that others have made.
    pub reached: f64,
}

/// What a tool remembers of each body it does not touch.
#[derive(Clone, Copy, Debug, Default)]
pub struct ToolState {
    /// How deep it is in each.
    pub entry: [Entry; MAX_BODIES],
    /// Where it was a tick ago, in the world; none where it was not in the scene.
    pub(super) before: Option<Pose>,
    /// Whether it has been in the scene before and left it.
    pub(super) has_left: bool,
    /// Energy that contacts which fade have lost in this tick, J.
    pub(super) freed: f64,
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
    /// What the limit of strain let through of contacts that slide.
    pub(super) limit_share: LimitShare,
    /// What contacts of a body at rest hold, and what tools have put into it.
    pub(super) passivity: Passivity,
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
    /// Under tools without a closed form, the pressures of each contact; empty if there is no such tool.
    pub(super) pressures: Vec<PressureState>,
    /// Static compliance between the contacts in two slots, at the Green's function's own Young's modulus, m/N.
    pub(super) compliance: Box<[[DMat3; MAX_CONTACTS]; MAX_CONTACTS]>,
}

impl State {
    /// At rest, nothing touched.
    pub fn new(model: &Model) -> Self {
        let body = |body: &BodyModel| BodyState {
            stiffness_scale: 1.0,
            motion: body.dynamics.as_ref().map(|dynamics| Motion::new(&dynamics.modes)),
            strain: None,
            limit_share: LimitShare::default(),
            passivity: Passivity::default(),
        };
        Self {
            bodies: model.bodies.iter().map(body).collect(),
            tools: Default::default(),
            contacts: Contacts::default(),
            pressures: match model.tools.iter().any(|tool| takes_cells(&tool.shape)) {
                true => vec![PressureState::default(); MAX_CONTACTS],
                false => Vec::new(),
            },
            compliance: Box::new([[DMat3::ZERO; MAX_CONTACTS]; MAX_CONTACTS]),
        }
    }

    /// Whether a body could take another strike now, before those under way are over.
    pub fn has_room_for_strike(&self, body: usize) -> bool {
        let motion = self.bodies.get(body).and_then(|state| state.motion.as_ref());
        motion.is_none_or(Motion::has_room_for_strike)
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
