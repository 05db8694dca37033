//! What is fixed while a simulation runs.

use std::sync::Arc;

use super::body::BodyModel;
use super::law::takes_cells;
use super::tool::{LawKind, ToolModel};
use super::{MAX_BODIES, MAX_TOOLS};
use crate::contact::footprint::PressedSurface;
use crate::contact::shape::ToolShape;
use crate::contact::{CompliantBody, Hollows, RegularCompliance};
use crate::memory::Ranges;
use crate::{Error, Result};

/// Bodies and tools.
pub struct Model {
    /// The bodies.
    pub bodies: Vec<BodyModel>,
    /// The tools; one a device.
    pub tools: Vec<ToolModel>,
    /// For each tool under the local law and each body what the tool meets beyond the half-space.
    pub(super) regular: Vec<Vec<Option<Arc<RegularCompliance>>>>,
    /// For each such tool that is no sphere the surface that it is pressed on.
    pub(super) pressed: Vec<Vec<Option<Arc<PressedSurface>>>>,
    /// For each that is one where it may touch at several places.
    pub(super) hollows: Vec<Vec<Hollows>>,
}

impl Model {
    /// The memory that a tick reads of it. What a tick writes is not in it: pages written a thousand times a second stay.
    pub fn memory(&self) -> Ranges {
        let mut ranges = Ranges::default();
        self.bodies.iter().for_each(|body| body.add_memory(&mut ranges));
        for regular in self.regular.iter().flatten().flatten() {
            ranges.add(&regular.fields);
        }
        self.pressed.iter().flatten().flatten().for_each(|pressed| pressed.add_memory(&mut ranges));
        self.hollows.iter().flatten().for_each(|hollows| hollows.add_memory(&mut ranges));
        ranges
    }

    /// Puts bodies and tools together.
    ///
    /// # Errors
    /// Too many of either, or none; a radius or stiffness that is not positive and finite.
    pub fn new(bodies: Vec<BodyModel>, tools: Vec<ToolModel>) -> Result<Self> {
        Self::assembled(None, bodies, tools)
    }

    /// Other bodies and tools; what is known here of those that stay is taken over.
    ///
    /// # Errors
    /// As of [`Model::new`].
    pub fn changed(&self, bodies: Vec<BodyModel>, tools: Vec<ToolModel>) -> Result<Self> {
        Self::assembled(Some(self), bodies, tools)
    }

    fn assembled(known: Option<&Self>, bodies: Vec<BodyModel>, tools: Vec<ToolModel>) -> Result<Self> {
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
        let mut regular: Vec<Vec<Option<Arc<RegularCompliance>>>> = Vec::new();
        for (rank, tool) in tools.iter().enumerate() {
            let of_tool = match tools[..rank].iter().position(|other| meets_the_same(other, tool)) {
                Some(twin) => regular[twin].clone(),
                None => {
                    let of_body = |body: &BodyModel| match known.and_then(|known| known.regular_of(body, tool)) {
                        Some(known) => Ok(Some(known)),
                        None => regular_compliance(body, tool),
                    };
                    bodies.iter().map(of_body).collect::<Result<_>>()?
                }
            };
            regular.push(of_tool);
        }
        let hollows_of = |tool: &ToolModel, body: &BodyModel| match (&body.local, &tool.shape, tool.law) {
            (Some(local), &ToolShape::Sphere { radius }, LawKind::Local) => Hollows::new(&local.smooth, radius),
            _ => Hollows::default(),
        };
        let hollows = tools.iter().map(|tool| bodies.iter().map(|body| hollows_of(tool, body)).collect()).collect();
        let pressed_of = |(rank, tool): (usize, &ToolModel)| {
            let of_body = |(regular, body)| pressed_surface(body, tool, regular);
            regular[rank].iter().map(Option::as_deref).zip(&bodies).map(of_body).collect()
        };
        let pressed = tools.iter().enumerate().map(pressed_of).collect();
        Ok(Self { bodies, tools, regular, pressed, hollows })
    }

    /// What such a tool meets of a body, if some tool here does.
    fn regular_of(&self, body: &BodyModel, tool: &ToolModel) -> Option<Arc<RegularCompliance>> {
        let body = self.bodies.iter().position(|known| known.is_same(body))?;
        let tool = self.tools.iter().position(|known| meets_the_same(known, tool))?;
        self.regular[tool][body].clone()
    }

    /// Refuses a contact radius that some body cannot take.
    ///
    /// # Errors
    /// See [`PreparedBody::check_contact_radius`](super::PreparedBody::check_contact_radius).
    pub fn check_contact_radius(&self, radius: f64) -> Result<()> {
        self.bodies.iter().try_for_each(|body| body.check_contact_radius(radius))
    }
}

/// Whether two tools meet the same regular compliance.
fn meets_the_same(one: &ToolModel, other: &ToolModel) -> bool {
    other.law == one.law && other.radius == one.radius && other.max_stiffness == one.max_stiffness
}

fn pressed_surface(
    body: &BodyModel,
    tool: &ToolModel,
    regular: Option<&RegularCompliance>,
) -> Option<Arc<PressedSurface>> {
    let (local, regular) = (body.local.as_ref()?, regular?);
    if !takes_cells(&tool.shape) {
        return None;
    }
    let thickness = tool.shape.thickness();
    Some(Arc::new(PressedSurface::new(&body.loaded, &body.query, &local.smooth, &regular.fields, thickness)))
}

fn regular_compliance(body: &BodyModel, tool: &ToolModel) -> Result<Option<Arc<RegularCompliance>>> {
    if tool.law != LawKind::Local {
        return Ok(None);
    }
    let local = body.local.as_ref().ok_or_else(|| {
        Error::Invalid("the local contact law needs the elastic constants of the body at its surface".into())
    })?;
    let (green, geometry) = (&*body.green, &body.geometry);
    let (smooth, moduli, moves) = (&local.smooth, &local.moduli, body.moves());
    let compliant = CompliantBody { green, geometry, smooth, moduli, moves };
    Ok(Some(Arc::new(RegularCompliance::kept(compliant, tool.radius, tool.max_stiffness))))
}
