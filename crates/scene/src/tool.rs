//! A tool of a scene: what it looks like and how it touches.

use palpate_core::Result;
use palpate_core::contact::shape::ToolShape;
use palpate_core::simulation::{LawKind, ToolModel, contact_size};
use palpate_devices::DeviceLimits;

use crate::bare::{largest_contact_radius, suiting_radius};
use crate::body::Body;

/// Coulomb's coefficient where none is given.
pub const DEFAULT_FRICTION: f64 = 0.3;
/// Stiffest contact where nothing is said, N/m.
pub const DEFAULT_MAX_STIFFNESS: f64 = 5000.0;

/// A tool of a scene. What is `None` follows the bodies.
#[derive(Clone, Debug)]
pub struct Tool {
    /// What it looks like; a sphere of a sixteenth of the smallest body.
    pub shape: Option<ToolShape>,
    /// How it touches; by the local law where the elastic constants of every body are known, else by a patch.
    pub law: Option<LawKind>,
    /// Radius of patches, and of what a grab holds, m; that of a sphere that suits the bodies, as far as they take it.
    pub contact_radius: Option<f64>,
    /// Coulomb's coefficient of friction.
    pub friction: f64,
    /// Young's modulus of its pad, Pa; a rigid tool has none.
    pub pad_youngs_modulus: Option<f64>,
    /// Stiffest contact rendered, N/m.
    pub max_stiffness: f64,
    /// What its device can render.
    pub device: DeviceLimits,
}

impl Default for Tool {
    fn default() -> Self {
        Self {
            shape: None,
            law: None,
            contact_radius: None,
            friction: DEFAULT_FRICTION,
            pad_youngs_modulus: None,
            max_stiffness: DEFAULT_MAX_STIFFNESS,
            device: DeviceLimits::UNLIMITED,
        }
    }
}

impl Tool {
    /// The tool as a tick sees it, and its contact radius, m.
    ///
    /// # Errors
    /// Bodies so small that no tool suits them.
    pub fn model<'a>(&self, bodies: impl Iterator<Item = &'a Body> + Clone) -> Result<(ToolModel, f64)> {
        let smallest = |radius: fn(&Body) -> f64| bodies.clone().map(radius).fold(f64::INFINITY, f64::min);
        let shape = match &self.shape {
            Some(shape) => shape.clone(),
            None => ToolShape::sphere(smallest(|body| suiting_radius(&body.green)))?,
        };
        let known = bodies.clone().all(|body| body.moduli.is_some());
        let law = self.law.unwrap_or(if known { LawKind::Local } else { LawKind::Patch });
        let contact_radius = self
            .contact_radius
            .unwrap_or_else(|| smallest(|body| largest_contact_radius(&body.green, suiting_radius(&body.green))));
        let radius = contact_size(&shape);
        let (pad_youngs_modulus, max_stiffness) = (self.pad_youngs_modulus, self.max_stiffness);
        Ok((ToolModel { shape, radius, law, pad_youngs_modulus, max_stiffness }, contact_radius))
    }
}
