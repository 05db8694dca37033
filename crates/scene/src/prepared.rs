//! What a force loop takes.

use std::sync::Arc;

use palpate_core::Result;
use palpate_core::simulation::{BodyModel, Kept, Model, ToolModel};
use palpate_devices::DeviceLimits;
use palpate_servo::{SafetyLimits, Scheduling, Settings, StrainPreparer};

use crate::bare::require_precise;
use crate::body::Body;
use crate::graph::{BodyId, Scene, ToolId};
use crate::tool::Tool;

/// A scene as a force loop takes it; bodies and tools by their ranks in the scene.
#[derive(Clone)]
pub struct Prepared {
    /// Bodies and tools.
    pub model: Arc<Model>,
    /// Handles of the bodies.
    pub bodies: Vec<BodyId>,
    /// Handles of the tools.
    pub tools: Vec<ToolId>,
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
        self.prepared_with(None)
    }

    /// The same for a loop that runs as `before` has it: bodies and tools of the same handles are those of that loop.
    ///
    /// # Errors
    /// As of [`Scene::prepare`].
    pub fn prepare_change(&self, before: &Prepared) -> Result<(Prepared, Kept)> {
        let prepared = self.prepared_with(Some(before))?;
        let mut kept = Kept::default();
        for (kept, id) in kept.bodies.iter_mut().zip(&prepared.bodies) {
            *kept = before.rank_of_body(*id);
        }
        for (kept, id) in kept.tools.iter_mut().zip(&prepared.tools) {
            *kept = before.rank_of_tool(*id);
        }
        Ok((prepared, kept))
    }

    fn prepared_with(&self, before: Option<&Prepared>) -> Result<Prepared> {
        for (_, body) in self.bodies() {
            require_precise(&body.green, &body.name)?;
        }
        let mut settings = Settings { strain_limit: self.strain_limit, ..Settings::default() };
        let mut tools = Vec::new();
        for (rank, (id, tool)) in self.tools().enumerate() {
            let (model, contact_radius) = self.tool_model(id, tool, before)?;
            (settings.contact_radius[rank], settings.friction[rank]) = (contact_radius, tool.friction);
            tools.push(model);
        }
        let bodies = self.bodies().map(|(id, body)| body_model(id, body, before)).collect::<Result<Vec<_>>>()?;
        let model = match before {
            Some(before) => before.model.changed(bodies, tools)?,
            None => Model::new(bodies, tools)?,
        };
        settings.contact_radius[..model.tools.len()].iter().try_for_each(|&r| model.check_contact_radius(r))?;
        settings.check(&model)?;
        let model = Arc::new(model);
        let mut strain = StrainPreparer::new(&model);
        for (rank, (_, body)) in self.bodies().enumerate() {
            body.strain.iter().for_each(|measure| strain.set_measure(rank, measure.clone()));
        }
        Ok(Prepared {
            bodies: self.bodies().map(|(id, _)| id).collect(),
            tools: self.tools().map(|(id, _)| id).collect(),
            devices: self.tools().map(|(_, tool)| tool.device).collect(),
            limits: self.limits,
            scheduling: self.scheduling.clone(),
            model,
            settings,
            strain,
        })
    }

    /// A tool that stays keeps its size, though the bodies that it followed may be gone.
    fn tool_model(&self, id: ToolId, tool: &Tool, before: Option<&Prepared>) -> Result<(ToolModel, f64)> {
        match before.and_then(|before| Some((before, before.rank_of_tool(id)?))) {
            Some((before, rank)) => Ok((before.model.tools[rank].clone(), before.settings.contact_radius[rank])),
            None => tool.model(self.bodies().map(|(_, body)| body)),
        }
    }
}

impl Prepared {
    /// Rank of a body.
    pub fn rank_of_body(&self, id: BodyId) -> Option<usize> {
        self.bodies.iter().position(|other| *other == id)
    }

    /// Rank of a tool.
    pub fn rank_of_tool(&self, id: ToolId) -> Option<usize> {
        self.tools.iter().position(|other| *other == id)
    }
}

fn body_model(id: BodyId, body: &Body, before: Option<&Prepared>) -> Result<BodyModel> {
    match before.and_then(|before| Some(before.model.bodies[before.rank_of_body(id)?].clone())) {
        Some(mut known) => {
            known.placement = body.placement;
            Ok(known)
        }
        None => body.model(),
    }
}
