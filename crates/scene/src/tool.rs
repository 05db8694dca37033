//! A tool of a scene: its shape and its contact law.

use std::collections::BTreeMap;

use palpate_core::Result;
use palpate_core::contact::shape::ToolShape;
use palpate_core::simulation::{LawKind, ToolModel, contact_size};
use palpate_devices::DeviceLimits;

use crate::body::Body;
use crate::store_defaults::{default_tool_radius, largest_contact_radius};

/// Coulomb's coefficient where none is given.
pub const DEFAULT_FRICTION: f64 = 0.3;
/// Stiffest contact by default, N/m.
pub const DEFAULT_MAX_STIFFNESS: f64 = 5000.0;

/// A tool of a scene. What is `None` follows the bodies.
#[derive(Clone, Debug)]
pub struct Tool {
    /// What it looks like; a sphere of a sixteenth of the smallest body.
    pub shape: Option<ToolShape>,
    /// How it touches; by the local law where the elastic constants of every body are known, else by a patch.
    pub law: Option<LawKind>,
    /// What its settings are at the start, by their names in [`Settings`](palpate_servo::Settings). A contact radius that is not
    /// given is that of a sphere that suits the bodies, as far as they take it.
    pub settings: BTreeMap<String, f64>,
    /// Young's modulus of its pad, Pa; a rigid tool has none.
    pub pad_youngs_modulus: Option<f64>,
    /// Stiffest contact rendered, N/m.
    pub max_stiffness: f64,
    /// What its device can render.
    pub device: DeviceLimits,
    /// Whether contacts that are stiffer than its device holds are rendered softer; else such a tool is refused.
    pub softened: bool,
}

impl Default for Tool {
    fn default() -> Self {
        Self {
            shape: None,
            law: None,
            settings: BTreeMap::from([("friction".into(), DEFAULT_FRICTION)]),
            pad_youngs_modulus: None,
            max_stiffness: DEFAULT_MAX_STIFFNESS,
            device: DeviceLimits::UNLIMITED,
            softened: false,
        }
    }
}

impl Tool {
    /// Stiffest contact that it renders in a loop with a time `period` between two ticks, s; N/m.
    pub fn rendered_stiffness(&self, period: f64) -> f64 {
        let held = if self.softened { self.device.largest_stiffness(period) } else { f64::INFINITY };
        self.max_stiffness.min(held)
    }

    /// The tool as a tick of a loop with such a `period` sees it, and its contact radius, m.
    ///
    /// # Errors
    /// Bodies so small that no tool suits them.
    pub fn model<'a>(&self, bodies: impl Iterator<Item = &'a Body> + Clone, period: f64) -> Result<(ToolModel, f64)> {
        let smallest = |radius: fn(&Body) -> f64| bodies.clone().map(radius).fold(f64::INFINITY, f64::min);
        let shape = match &self.shape {
            Some(shape) => shape.clone(),
            None => ToolShape::sphere(smallest(|body| default_tool_radius(&body.green)))?,
        };
        let known = bodies.clone().all(|body| body.moduli.is_some());
        let law = self.law.unwrap_or(if known { LawKind::LOCAL } else { LawKind::PATCH });
        let suiting = || smallest(|body| largest_contact_radius(&body.green, default_tool_radius(&body.green)));
        let contact_radius = self.settings.get("contact_radius").copied().unwrap_or_else(suiting);
        let radius = contact_size(&shape);
        let (pad_youngs_modulus, max_stiffness) = (self.pad_youngs_modulus, self.rendered_stiffness(period));
        Ok((ToolModel { shape, radius, law, pad_youngs_modulus, max_stiffness }, contact_radius))
    }
}
