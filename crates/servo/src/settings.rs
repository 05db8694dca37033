//! What may be changed while the loop runs.

use palpate_core::simulation::{Controls, Kept, MAX_BODIES, MAX_TOOLS, Model};
use palpate_core::{Error, Result};

/// What the frame side may change while the loop runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Contact radius of each tool's contacts that begin from now on, m.
    pub contact_radius: [f64; MAX_TOOLS],
    /// Coulomb's coefficient of friction of each tool.
    pub friction: [f64; MAX_TOOLS],
    /// Young's modulus of each body over that of its Green's function.
    pub stiffness_scale: [f64; MAX_BODIES],
    /// Largest strain to which tools may take a body; zero for any.
    pub strain_limit: f64,
    /// Each new value lets go of everything, brings moving bodies to rest and clears faults.
    pub resets: u32,
    /// Seconds that a body in motion advances in a second: below one is slow motion.
    pub time_scale: f64,
    /// A body and the rank of one of its surface nodes, whose displacement is logged.
    pub watch: Option<(usize, u32)>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            contact_radius: [0.0; MAX_TOOLS],
            friction: [0.0; MAX_TOOLS],
            stiffness_scale: [1.0; MAX_BODIES],
            strain_limit: 0.0,
            resets: 0,
            time_scale: 1.0,
            watch: None,
        }
    }
}

impl Settings {
    /// Refuses what does not belong to a model. Whether contacts of the radius can be weighed everywhere takes long to find
    /// out: see [`Model::check_contact_radius`].
    ///
    /// # Errors
    /// A number out of its range, or a body or node that the model does not have.
    pub fn check(&self, model: &Model) -> Result<()> {
        let not_negative = |x: f64| x >= 0.0 && x.is_finite();
        for (tool, &radius) in self.contact_radius.iter().enumerate() {
            refuse_unless(not_negative(radius), || {
                format!("the contact radius of tool {tool} must not be negative, got {radius} m")
            })?;
        }
        for (tool, &friction) in self.friction.iter().enumerate() {
            refuse_unless(not_negative(friction), || {
                format!("the friction of tool {tool} must not be negative, got {friction}")
            })?;
        }
        for (body, &scale) in self.stiffness_scale.iter().enumerate() {
            refuse_unless(scale > 0.0 && scale.is_finite(), || {
                format!("the stiffness scale of body {body} must be positive, got {scale}")
            })?;
        }
        for (name, value) in [("strain limit", self.strain_limit), ("time scale", self.time_scale)] {
            refuse_unless(not_negative(value), || format!("the {name} must not be negative, got {value}"))?;
        }
        self.watch.map_or(Ok(()), |(body, node)| check_node(model, body, node))
    }

    /// What goes on where a scene changes: of bodies and tools that stay what they have, of new ones that of `fresh`.
    pub fn carried_over(&self, fresh: &Settings, kept: &Kept) -> Settings {
        let mut now = *self;
        for (rank, old) in kept.tools.iter().enumerate() {
            let (of, old) = old.map_or((fresh, rank), |old| (self, old));
            (now.contact_radius[rank], now.friction[rank]) = (of.contact_radius[old], of.friction[old]);
        }
        for (rank, old) in kept.bodies.iter().enumerate() {
            let (of, old) = old.map_or((fresh, rank), |old| (self, old));
            now.stiffness_scale[rank] = of.stiffness_scale[old];
        }
        let new_rank = |old: usize| kept.bodies.iter().position(|&rank| rank == Some(old));
        now.watch = self.watch.and_then(|(body, node)| Some((new_rank(body)?, node)));
        now
    }

    /// What a tick makes of them, given those of the tick before, without a strike; the strain of some bodies cannot be
    /// limited.
    pub(crate) fn controls(&self, before: &Settings, period: f64, limited: &[bool; MAX_BODIES]) -> Controls {
        Controls {
            contact_radius: self.contact_radius,
            friction: self.friction,
            stiffness_scale: self.stiffness_scale,
            strain_limit: limited.map(|limited| if limited { self.strain_limit } else { 0.0 }),
            reset: self.resets != before.resets,
            advance: self.time_scale * period,
            strike: None,
        }
    }
}

/// Refuses a body that the model does not have.
pub(crate) fn check_body(model: &Model, body: usize, what: &str) -> Result<()> {
    let bodies = model.bodies.len();
    refuse_unless(body < bodies, || format!("{what}: there is no body {body}, the scene has {bodies}"))
}

/// Refuses a surface node that the model does not have.
pub(crate) fn check_node(model: &Model, body: usize, node: u32) -> Result<()> {
    check_body(model, body, "watch")?;
    let nodes = model.bodies[body].green().surface_count();
    refuse_unless((node as usize) < nodes, || {
        format!("watch: there is no surface node {node}, body {body} has {nodes}")
    })
}

pub(crate) fn refuse_unless(holds: bool, message: impl FnOnce() -> String) -> Result<()> {
    if holds { Ok(()) } else { Err(Error::Invalid(message())) }
}
