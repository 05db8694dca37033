//! What a force loop takes.

use std::sync::Arc;

use palpate_core::Result;
use palpate_core::simulation::Model;
use palpate_devices::DeviceLimits;
use palpate_servo::{SafetyLimits, Scheduling, Settings, StrainPreparer};

use crate::bare::require_precise;
use crate::graph::Scene;

/// A scene as a force loop takes it; bodies and tools by their ranks in the scene.
#[derive(Clone)]
pub struct Prepared {
    /// Bodies and tools.
    pub model: Arc<Model>,
    /// Settings of the start.
    pub settings: Settings,
    /// Limits kept by the safety stage.
    pub limits: SafetyLimits,
    /// How the loop's own thread runs.
    pub scheduling: Scheduling,
    /// What measures the strain of the bodies, as far as it is known.
    pub strain: StrainPreparer,
    /// What the device of each tool can render.
    pub devices: Vec<DeviceLimits>,
}

impl Scene {
    /// Prepares the surfaces for contact: seconds for large bodies whose regular compliance is not kept beside the store.
    ///
    /// # Errors
    /// No body or no tool; constants, modes or radii that a body cannot take; a store that is not precise enough.
    pub fn prepare(&self) -> Result<Prepared> {
        for (_, body) in self.bodies() {
            require_precise(&body.green, &body.name)?;
        }
        let mut settings = Settings { strain_limit: self.strain_limit, ..Settings::default() };
        let mut tools = Vec::new();
        for (rank, (_, tool)) in self.tools().enumerate() {
            let (model, contact_radius) = tool.model(self.bodies().map(|(_, body)| body))?;
            (settings.contact_radius[rank], settings.friction[rank]) = (contact_radius, tool.friction);
            tools.push(model);
        }
        let bodies = self.bodies().map(|(_, body)| body.model()).collect::<Result<Vec<_>>>()?;
        let model = Model::new(bodies, tools)?;
        settings.contact_radius[..model.tools.len()].iter().try_for_each(|&r| model.check_contact_radius(r))?;
        settings.check(&model)?;
        let model = Arc::new(model);
        let mut strain = StrainPreparer::new(&model);
        for (rank, (_, body)) in self.bodies().enumerate() {
            body.strain.iter().for_each(|measure| strain.set_measure(rank, measure.clone()));
        }
        let devices = self.tools().map(|(_, tool)| tool.device).collect();
        let (limits, scheduling) = (self.limits, self.scheduling.clone());
        Ok(Prepared { model, settings, limits, scheduling, strain, devices })
    }
}
