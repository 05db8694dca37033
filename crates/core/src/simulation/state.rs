//! State of a simulation: contacts, tools, bodies.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::body::BodyModel;
use super::contacts::Contacts;
use super::input::Pose;
use super::known_series::{KnownSeries, SeriesOfBody};
use super::model::Model;
use super::motion::Motion;
use super::passivity::PassivityObserver;
use super::strain_watch::{LimitShare, StrainWatch};
use super::{MAX_BODIES, MAX_CONTACTS, MAX_TOOLS};
use crate::contact::Refusal;
use crate::contact::local::cells::PressureState;

/// Depth of a tool in the untouched surface of a body that it has no contact with.
#[derive(Clone, Copy, Debug, Default)]
pub struct EntryDepth {
    /// Depth at which the next contact begins, m. Zero for a tool that came from outside; for one that was released inside the
    /// least depth since then. So a force always starts from zero.
    pub threshold: f64,
    /// Depth a tick ago, m, zero outside. A tool may be inside without a force where other contacts have displaced the surface.
    pub previous: f64,
}

impl EntryDepth {
    /// Of a tool that is inside at no known depth: the next depth that is known is where its force starts.
    pub const INSIDE: Self = Self { threshold: f64::INFINITY, previous: f64::INFINITY };
}

/// State of a tool.
#[derive(Clone, Copy, Debug, Default)]
pub struct ToolState {
    /// Depth in each body.
    pub entry: [EntryDepth; MAX_BODIES],
    /// Pose a tick ago, in the world; none if it was not in the scene.
    pub(super) previous_pose: Option<Pose>,
    /// Whether it has been in the scene before and left it.
    pub(super) has_left: bool,
    /// Energy that its fading contacts have released in this tick, J.
    pub(super) released_energy: f64,
    /// Why no contact began where the tool reaches the body.
    pub refused: [Option<Refusal>; MAX_BODIES],
}

/// State of a body.
#[derive(Clone, Debug)]
pub struct BodyState {
    /// Young's modulus over the Green's function's.
    pub stiffness_scale: f64,
    /// Motion of a body that moves.
    pub motion: Option<Motion>,
    /// Strain response of the contacts, once it is prepared.
    pub strain: Option<Box<StrainWatch>>,
    /// Share of the forces of sliding contacts within the strain limit.
    pub(super) limit_share: LimitShare,
    /// Higher orders of its displacement by the radius of spheres.
    pub(super) series: SeriesOfBody,
    /// Energy of the contacts of a body at rest and work of the tools.
    pub(super) passivity: PassivityObserver,
}

/// State of a simulation.
#[derive(Clone, Debug)]
pub struct State {
    /// One for each body of the model.
    pub bodies: Vec<BodyState>,
    /// One for each possible tool.
    pub tools: [ToolState; MAX_TOOLS],
    /// The contacts.
    pub contacts: Contacts,
    /// Pressures of each contact, for tools and corners without a closed form; empty if there are none.
    pub(super) pressures: Vec<PressureState>,
    /// Static compliance between the contacts in two slots, at the Green's function's own Young's modulus, m/N.
    pub(super) compliance: Box<[[DMat3; MAX_CONTACTS]; MAX_CONTACTS]>,
}

impl BodyState {
    /// Coefficients at the fans for a sphere of `radius`, m.
    pub fn series(&self, radius: f64) -> Option<&KnownSeries> {
        self.series.iter().flatten().find(|series| series.radius == radius).map(Arc::as_ref)
    }
}

impl State {
    /// At rest, without contacts.
    pub fn new(model: &Model) -> Self {
        let body = |body: &BodyModel| BodyState {
            stiffness_scale: 1.0,
            motion: body.dynamics.as_ref().map(|dynamics| Motion::new(&dynamics.modes)),
            strain: None,
            limit_share: LimitShare::default(),
            series: std::array::from_fn(|rank| body.series.get(rank).cloned()),
            passivity: PassivityObserver::default(),
        };
        Self {
            bodies: model.bodies.iter().map(body).collect(),
            tools: Default::default(),
            contacts: Contacts::default(),
            pressures: match model.needs_cells() {
                true => vec![PressureState::default(); MAX_CONTACTS],
                false => Vec::new(),
            },
            compliance: Box::new([[DMat3::ZERO; MAX_CONTACTS]; MAX_CONTACTS]),
        }
    }

    /// Whether another strike of a body may begin before those in progress end.
    pub fn has_room_for_strike(&self, body: usize) -> bool {
        let motion = self.bodies.get(body).and_then(|state| state.motion.as_ref());
        motion.is_none_or(Motion::has_room_for_strike)
    }

    /// Exchanges the strain response of a body. Returns the previous one, whose memory must not be freed in a tick.
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
