//! Settings that may be changed while the loop runs: one record, from the scene to the tick and the frame.

use std::slice::{from_mut, from_ref};

use palpate_core::simulation::{Controls, MAX_BODIES, MAX_TOOLS, Model, PreviousRanks};
use palpate_core::{Error, Result};

/// What may be changed while the loop runs.
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
            time_scale: 1.0,
            watch: None,
        }
    }
}

/// What a setting has a value for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Per {
    /// Each tool.
    Tool,
    /// Each body.
    Body,
    /// The scene as a whole.
    Scene,
}

/// A number of the settings, or one for each tool or body.
pub struct Setting {
    /// Name of its field.
    pub name: &'static str,
    /// What it has a value for.
    pub per: Per,
    /// Whether zero is refused as negative numbers are.
    positive: bool,
    values: fn(&Settings) -> &[f64],
    values_mut: fn(&mut Settings) -> &mut [f64],
}

const fn setting(
    (name, per, positive): (&'static str, Per, bool),
    values: fn(&Settings) -> &[f64],
    values_mut: fn(&mut Settings) -> &mut [f64],
) -> Setting {
    Setting { name, per, positive, values, values_mut }
}

impl Setting {
    /// All of them.
    pub const ALL: [Self; 5] = [
        setting(("contact_radius", Per::Tool, false), |s| &s.contact_radius, |s| &mut s.contact_radius),
        setting(("friction", Per::Tool, false), |s| &s.friction, |s| &mut s.friction),
        setting(("stiffness_scale", Per::Body, true), |s| &s.stiffness_scale, |s| &mut s.stiffness_scale),
        setting(("strain_limit", Per::Scene, false), |s| from_ref(&s.strain_limit), |s| from_mut(&mut s.strain_limit)),
        setting(("time_scale", Per::Scene, false), |s| from_ref(&s.time_scale), |s| from_mut(&mut s.time_scale)),
    ];

    /// Its values: one, or one for each tool or body that there may be.
    pub fn values<'a>(&self, settings: &'a Settings) -> &'a [f64] {
        (self.values)(settings)
    }

    fn check(&self, settings: &Settings) -> Result<()> {
        for (rank, &value) in self.values(settings).iter().enumerate() {
            refuse_unless(value.is_finite() && if self.positive { value > 0.0 } else { value >= 0.0 }, || {
                let (name, must) =
                    (self.name.replace('_', " "), if self.positive { "be positive" } else { "not be negative" });
                let of = match self.per {
                    Per::Tool => format!(" of tool {rank}"),
                    Per::Body => format!(" of body {rank}"),
                    Per::Scene => String::new(),
                };
                format!("the {name}{of} must {must}, got {value}")
            })?;
        }
        Ok(())
    }
}

impl Settings {
    /// Changes the value of a setting for a tool or body, or for the scene (0). A rank beyond all there may be changes nothing.
    ///
    /// # Errors
    /// A name that no setting has.
    pub fn set(&mut self, name: &str, rank: usize, value: f64) -> Result<()> {
        let unknown = || Error::Invalid(format!("there is no setting '{name}'"));
        let setting = Setting::ALL.iter().find(|setting| setting.name == name).ok_or_else(unknown)?;
        (setting.values_mut)(self).get_mut(rank).into_iter().for_each(|to| *to = value);
        Ok(())
    }

    /// Refuses what does not belong to a model. Whether contacts of the radius can be weighed everywhere takes long to find
    /// out: see [`Model::check_contact_radius`].
    ///
    /// # Errors
    /// A number out of its range, or a body or node that the model does not have.
    pub fn check(&self, model: &Model) -> Result<()> {
        Setting::ALL.iter().try_for_each(|setting| setting.check(self))?;
        self.watch.map_or(Ok(()), |(body, node)| check_node(model, body, node))
    }

    /// What goes on where a scene changes: of bodies and tools that stay what they have, of new ones that of `fresh`.
    pub fn carried_over(&self, fresh: &Settings, previous_ranks: &PreviousRanks) -> Settings {
        let mut now = *self;
        for setting in &Setting::ALL {
            let ranks: &[Option<usize>] = match setting.per {
                Per::Tool => &previous_ranks.tools,
                Per::Body => &previous_ranks.bodies,
                Per::Scene => continue,
            };
            for (rank, (to, old)) in (setting.values_mut)(&mut now).iter_mut().zip(ranks).enumerate() {
                *to = old.map_or(setting.values(fresh)[rank], |old| setting.values(self)[old]);
            }
        }
        let new_rank = |old: usize| previous_ranks.bodies.iter().position(|&rank| rank == Some(old));
        now.watch = self.watch.and_then(|(body, node)| Some((new_rank(body)?, node)));
        now
    }

    /// What a tick makes of them, without a strike; the strain of some bodies cannot be limited.
    pub(crate) fn controls(&self, reset: bool, period: f64, limited: &[bool; MAX_BODIES]) -> Controls {
        Controls {
            contact_radius: self.contact_radius,
            friction: self.friction,
            stiffness_scale: self.stiffness_scale,
            strain_limit: limited.map(|limited| if limited { self.strain_limit } else { 0.0 }),
            reset,
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
