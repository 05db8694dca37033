//! What is fixed while a simulation runs, and its reusable memory.

use super::law::LawKind;
use super::solve::System;
use super::state::{Contacts, State};
use super::{BodyModel, MAX_BODIES, MAX_TOOLS};
use crate::contact::{Patch, PatchScratch};
use crate::{Error, Result};

/// The tip of one device.
#[derive(Clone, Copy, Debug)]
pub struct ToolModel {
    /// Radius of the sphere, m.
    pub radius: f64,
    /// How it touches.
    pub law: LawKind,
    /// Stiffest contact rendered, N/m: near a support the body alone would be rigid, which no device can render.
    pub max_stiffness: f64,
}

/// Bodies and tools.
pub struct Model {
    /// The bodies.
    pub bodies: Vec<BodyModel>,
    /// The tools; one a device.
    pub tools: Vec<ToolModel>,
}

/// Memory a tick needs, sized once.
pub struct Scratch {
    /// One a body.
    pub(super) patches: Vec<PatchScratch>,
    pub(super) candidate: Patch,
    pub(super) system: Box<System>,
}

impl Model {
    /// Puts bodies and tools together.
    ///
    /// # Errors
    /// Too many of either, or none; a radius or stiffness that is not positive and finite.
    pub fn new(bodies: Vec<BodyModel>, tools: Vec<ToolModel>) -> Result<Self> {
        for (what, count, most) in [("bodies", bodies.len(), MAX_BODIES), ("tools", tools.len(), MAX_TOOLS)] {
            if !(1..=most).contains(&count) {
                return Err(Error::Invalid(format!("a simulation takes 1 to {most} {what}, got {count}")));
            }
        }
        for tool in &tools {
            for (name, value) in [("tool radius", tool.radius), ("maximum stiffness", tool.max_stiffness)] {
                if !(value > 0.0 && value.is_finite()) {
                    return Err(Error::Invalid(format!("the {name} must be positive, got {value}")));
                }
            }
        }
        Ok(Self { bodies, tools })
    }

    /// A state at rest, nothing touched.
    pub fn state(&self) -> State {
        State::at_rest(self)
    }

    /// Memory for [`super::step`].
    pub fn scratch(&self) -> Scratch {
        let patches = self.bodies.iter().map(|body| PatchScratch::new(&body.green.surface)).collect();
        Scratch { patches, candidate: Patch::default(), system: Box::default() }
    }

    /// Refuses a contact radius that some body cannot take.
    ///
    /// # Errors
    /// See [`BodyModel::check_contact_radius`].
    pub fn check_contact_radius(&self, radius: f64) -> Result<()> {
        self.bodies.iter().try_for_each(|body| body.check_contact_radius(radius))
    }

    /// Empty slots.
    pub(super) fn contacts(&self) -> Contacts {
        Contacts::default()
    }
}
