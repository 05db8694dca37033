//! Preparation of a scene for a force loop: model, limits, settings and devices.

use std::sync::Arc;

use palpate_core::Result;
use palpate_core::simulation::{BodyModel, Model, PreviousRanks, ToolModel};
use palpate_devices::{Device, DeviceLimits};
use palpate_servo::{SafetyLimits, SceneChange, Scheduling, Servo, Settings, StrainPreparer};

use crate::body::Body;
use crate::graph::{BodyId, Scene, ToolId};
use crate::store_defaults::require_precise;
use crate::tool::Tool;

/// A scene as a force loop takes it; bodies and tools by their ranks in the scene.
#[derive(Clone)]
pub struct PreparedScene {
    /// Bodies and tools.
    pub model: Arc<Model>,
    /// Handles of the bodies.
    pub bodies: Vec<BodyId>,
    /// Handles of the tools.
    pub tools: Vec<ToolId>,
    /// Settings: at first those of the scene.
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
    pub fn prepare(&self) -> Result<PreparedScene> {
        self.prepared_with(None)
    }

    /// The same for a loop that runs as `before` has it: bodies and tools of the same handles are those of that loop.
    ///
    /// # Errors
    /// As of [`Scene::prepare`].
    pub fn prepare_change(&self, before: &PreparedScene) -> Result<(PreparedScene, PreviousRanks)> {
        let prepared = self.prepared_with(Some(before))?;
        let mut previous_ranks = PreviousRanks::default();
        for (rank, id) in previous_ranks.bodies.iter_mut().zip(&prepared.bodies) {
            *rank = before.rank_of_body(*id);
        }
        for (rank, id) in previous_ranks.tools.iter_mut().zip(&prepared.tools) {
            *rank = before.rank_of_tool(*id);
        }
        Ok((prepared, previous_ranks))
    }

    fn prepared_with(&self, before: Option<&PreparedScene>) -> Result<PreparedScene> {
        for (_, body) in self.bodies() {
            require_precise(&body.green, &body.name)?;
        }
        let mut settings = Settings { strain_limit: self.strain_limit, ..Settings::default() };
        let mut tools = Vec::new();
        for (rank, (id, tool)) in self.tools().enumerate() {
            let (model, contact_radius) = self.tool_model(id, tool, before)?;
            tool.settings.iter().try_for_each(|(name, value)| settings.set(name, rank, *value))?;
            settings.contact_radius[rank] = contact_radius;
            tools.push(model);
        }
        let bodies = self.bodies().map(|(id, body)| body_model(id, body, before)).collect::<Result<Vec<_>>>()?;
        let model = match before {
            Some(before) if self.matches(before, &bodies, &tools) => before.model.clone(),
            Some(before) => Arc::new(before.model.changed(bodies, tools)?),
            None => Arc::new(Model::new(bodies, tools)?),
        };
        settings.contact_radius[..model.tools.len()].iter().try_for_each(|&r| model.check_contact_radius(r))?;
        settings.check(&model)?;
        let mut strain = StrainPreparer::new(&model);
        for (rank, (_, body)) in self.bodies().enumerate() {
            body.strain.iter().for_each(|measure| strain.set_measure(rank, measure.clone()));
        }
        Ok(PreparedScene {
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

    /// Whether bodies and tools are those of `before`, at the same places: devices and measures of strain may differ.
    fn matches(&self, before: &PreparedScene, bodies: &[BodyModel], tools: &[ToolModel]) -> bool {
        let same_body = |(one, other): (&BodyModel, &BodyModel)| one.is_same(other) && one.placement == other.placement;
        let same_tool = |(one, other): (&ToolModel, &ToolModel)| one.max_stiffness == other.max_stiffness;
        self.tools().map(|(id, _)| id).eq(before.tools.iter().copied())
            && bodies.len() == before.bodies.len()
            && bodies.iter().zip(&before.model.bodies).all(same_body)
            && tools.iter().zip(&before.model.tools).all(same_tool)
    }

    /// A tool that stays keeps its size, though the bodies that it followed may be gone.
    fn tool_model(&self, id: ToolId, tool: &Tool, before: Option<&PreparedScene>) -> Result<(ToolModel, f64)> {
        let period = 1.0 / before.map_or(&self.scheduling, |before| &before.scheduling).rate;
        match before.and_then(|before| Some((before, before.rank_of_tool(id)?))) {
            Some((before, rank)) => {
                let max_stiffness = tool.rendered_stiffness(period);
                let known = before.model.tools[rank].clone();
                Ok((ToolModel { max_stiffness, ..known }, before.settings.contact_radius[rank]))
            }
            None => tool.model(self.bodies().map(|(_, body)| body), period),
        }
    }
}

impl PreparedScene {
    /// Rank of a body.
    pub fn rank_of_body(&self, id: BodyId) -> Option<usize> {
        self.bodies.iter().position(|other| *other == id)
    }

    /// Rank of a tool.
    pub fn rank_of_tool(&self, id: ToolId) -> Option<usize> {
        self.tools.iter().position(|other| *other == id)
    }

    /// Goes on with what has been prepared for a change, under a running loop too, with devices for tools that are new or get
    /// another one. Settings of what stays are those of now; limits and scheduling are for loops that are made later.
    ///
    /// # Errors
    /// See [`Servo::change`]; everything stays as it was.
    pub fn continue_with(
        &mut self,
        next: PreparedScene,
        previous_ranks: PreviousRanks,
        servo: Option<&mut Servo>,
        devices: Vec<Option<Box<dyn Device>>>,
    ) -> Result<()> {
        let settings = self.settings.carried_over(&next.settings, &previous_ranks);
        if let Some(servo) = servo {
            let (model, strain) = (next.model.clone(), next.strain.clone());
            servo.change(SceneChange { model, previous_ranks, devices, settings, strain })?;
        }
        let (limits, scheduling) = (self.limits, self.scheduling.clone());
        *self = PreparedScene { settings, limits, scheduling, ..next };
        Ok(())
    }
}

/// What belongs to each tool after a change: `fresh` where there is one, else what it had.
pub fn carried_over<T>(before: Vec<T>, fresh: Vec<Option<T>>, previous_ranks: &PreviousRanks) -> Vec<T> {
    let mut before: Vec<_> = before.into_iter().map(Some).collect();
    let mut stays = |old: Option<usize>| before.get_mut(old?)?.take();
    fresh.into_iter().zip(previous_ranks.tools).filter_map(|(fresh, old)| fresh.or_else(|| stays(old))).collect()
}

/// A body of another store is made anew.
fn body_model(id: BodyId, body: &Body, before: Option<&PreparedScene>) -> Result<BodyModel> {
    let known = before.and_then(|before| before.model.bodies.get(before.rank_of_body(id)?));
    match known.filter(|known| std::ptr::eq(known.green(), &*body.green)) {
        Some(known) => Ok(known.placed(body.placement)),
        None => body.model(),
    }
}
