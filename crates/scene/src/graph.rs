//! Bodies and tools as nodes that are added, found and removed by their handles.

use std::sync::Arc;

use palpate_core::simulation::{KnownSeries, MAX_BODIES, MAX_TOOLS, Placement};
use palpate_core::strain::StrainMeasure;
use palpate_core::{Error, Result};
use palpate_devices::DeviceLimits;
use palpate_servo::{SafetyLimits, Scheduling};

use crate::body::Body;
use crate::tool::Tool;

/// Ticks a second by default, Hz.
const DEFAULT_RATE: f64 = 1000.0;
/// Strain of the finite element field at which a tool is held by default.
const DEFAULT_STRAIN_LIMIT: f64 = 0.3;

/// Handle of a body: never given to another one of the same scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BodyId(pub u32);

/// Handle of a tool: never given to another one of the same scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ToolId(pub u32);

/// What to touch, and with what.
#[derive(Clone)]
pub struct Scene {
    bodies: Vec<(BodyId, Body)>,
    tools: Vec<(ToolId, Tool)>,
    next_body: u32,
    next_tool: u32,
    /// Limits kept by the safety stage.
    pub limits: SafetyLimits,
    /// How the loop's own thread runs.
    pub scheduling: Scheduling,
    /// Largest strain to which tools may take a body; zero for any.
    pub strain_limit: f64,
}

impl Default for Scene {
    /// Without bodies and tools.
    fn default() -> Self {
        Self {
            bodies: Vec::new(),
            tools: Vec::new(),
            next_body: 0,
            next_tool: 0,
            limits: SafetyLimits::default(),
            scheduling: Scheduling::at(DEFAULT_RATE),
            strain_limit: DEFAULT_STRAIN_LIMIT,
        }
    }
}

impl Scene {
    /// Adds a body.
    ///
    /// # Errors
    /// More bodies than a loop takes.
    pub fn add_body(&mut self, body: Body) -> Result<BodyId> {
        require_room("bodies", self.bodies.len(), MAX_BODIES)?;
        let id = BodyId(self.next_body);
        self.next_body += 1;
        self.bodies.push((id, body));
        Ok(id)
    }

    /// Adds a tool.
    ///
    /// # Errors
    /// More tools than a loop takes.
    pub fn add_tool(&mut self, tool: Tool) -> Result<ToolId> {
        require_room("tools", self.tools.len(), MAX_TOOLS)?;
        let id = ToolId(self.next_tool);
        self.next_tool += 1;
        self.tools.push((id, tool));
        Ok(id)
    }

    /// Takes a body out; `None` if there is none of that handle.
    pub fn remove_body(&mut self, id: BodyId) -> Option<Body> {
        let rank = self.bodies.iter().position(|(other, _)| *other == id)?;
        Some(self.bodies.remove(rank).1)
    }

    /// Takes a tool out; `None` if there is none of that handle.
    pub fn remove_tool(&mut self, id: ToolId) -> Option<Tool> {
        let rank = self.tools.iter().position(|(other, _)| *other == id)?;
        Some(self.tools.remove(rank).1)
    }

    /// Exchanges a tool for another one at the same rank, which gets a handle of its own; `None` if there is none of that handle.
    pub fn replace_tool(&mut self, id: ToolId, tool: Tool) -> Option<ToolId> {
        let rank = self.tools.iter().position(|(other, _)| *other == id)?;
        let fresh = ToolId(self.next_tool);
        self.next_tool += 1;
        self.tools[rank] = (fresh, tool);
        Some(fresh)
    }

    /// The bodies, in the order in which they were added.
    pub fn bodies(&self) -> impl Iterator<Item = (BodyId, &Body)> + Clone {
        self.bodies.iter().map(|(id, body)| (*id, body))
    }

    /// The tools, in the order in which they were added.
    pub fn tools(&self) -> impl Iterator<Item = (ToolId, &Tool)> + Clone {
        self.tools.iter().map(|(id, tool)| (*id, tool))
    }

    fn body_mut(&mut self, id: BodyId) -> Option<&mut Body> {
        self.bodies.iter_mut().find(|(other, _)| *other == id).map(|(_, body)| body)
    }

    /// Exchanges a body for one with another store of the same surface. The measure of strain stays if the new one has none.
    ///
    /// # Errors
    /// No body of that handle, or a store of another surface.
    pub fn replace_body(&mut self, id: BodyId, body: Body) -> Result<()> {
        let missing = || Error::Invalid(format!("the scene has no body {}", id.0));
        let before = self.body_mut(id).ok_or_else(missing)?;
        let (one, other) = (&before.green, &body.green);
        if one.surface_nodes != other.surface_nodes || one.surface.positions != other.surface.positions {
            return Err(Error::Invalid("the other store is not of the same body: its surface differs".into()));
        }
        let strain = body.strain.clone().or_else(|| before.strain.take());
        *before = Body { strain, ..body };
        Ok(())
    }

    /// Gives a body a measure of its strain; false if there is none of that handle.
    pub fn set_strain_measure(&mut self, id: BodyId, measure: Arc<StrainMeasure>) -> bool {
        self.body_mut(id).map(|body| body.strain = Some(measure)).is_some()
    }

    /// Gives a body higher orders of its displacement; false if there is none of that handle.
    pub fn set_series(&mut self, id: BodyId, series: Arc<KnownSeries>) -> bool {
        self.body_mut(id)
            .map(|body| {
                body.series.retain(|known| known.radius != series.radius);
                body.series.push(series);
            })
            .is_some()
    }

    /// Moves a body; false if there is none of that handle.
    pub fn place_body(&mut self, id: BodyId, placement: Placement) -> bool {
        self.body_mut(id).map(|body| body.placement = placement).is_some()
    }

    /// States what the device of a tool can render; false if there is none of that handle. Nothing else of a tool changes as
    /// long as it has its handle.
    pub fn set_device(&mut self, id: ToolId, limits: DeviceLimits) -> bool {
        let found = self.tools.iter_mut().find(|(other, _)| *other == id);
        found.map(|(_, tool)| tool.device = limits).is_some()
    }
}

fn require_room(what: &str, count: usize, most: usize) -> Result<()> {
    if count < most { Ok(()) } else { Err(Error::Invalid(format!("a scene takes at most {most} {what}"))) }
}
