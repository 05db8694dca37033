//! What is fixed while a simulation runs.

use std::sync::Arc;

use super::body::BodyModel;
use super::tool::{LawKind, ToolModel};
use super::{MAX_BODIES, MAX_TOOLS};
use crate::contact::{CompliantBody, Hollows, RegularCompliance};
use crate::{Error, Result};

/// Bodies and tools.
pub struct Model {
    /// The bodies.
    pub bodies: Vec<BodyModel>,
    /// The tools; one a device.
    pub tools: Vec<ToolModel>,
    /// For each tool under the local law and each body what the tool meets beyond the half-space.
    pub(super) regular: Vec<Vec<Option<Arc<RegularCompliance>>>>,
    /// For the same where the tool may touch at several places.
    pub(super) hollows: Vec<Vec<Hollows>>,
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
        let mut regular: Vec<Vec<Option<Arc<RegularCompliance>>>> = Vec::new();
        for (rank, tool) in tools.iter().enumerate() {
            let twin = |other: &ToolModel| {
                other.law == tool.law && other.radius == tool.radius && other.max_stiffness == tool.max_stiffness
            };
            let known = tools[..rank].iter().position(twin);
            let of_tool = match known {
                Some(known) => regular[known].clone(),
                None => bodies.iter().map(|body| regular_compliance(body, tool)).collect::<Result<_>>()?,
            };
            regular.push(of_tool);
        }
        let hollows_of = |tool: &ToolModel, body: &BodyModel| match (&body.local, tool.law) {
            (Some(local), LawKind::Local) => Hollows::new(&local.smooth, tool.shape.bounding_radius()),
            _ => Hollows::default(),
        };
        let hollows = tools.iter().map(|tool| bodies.iter().map(|body| hollows_of(tool, body)).collect()).collect();
        Ok(Self { bodies, tools, regular, hollows })
    }

    /// Refuses a contact radius that some body cannot take.
    ///
    /// # Errors
    /// See [`BodyModel::check_contact_radius`].
    pub fn check_contact_radius(&self, radius: f64) -> Result<()> {
        self.bodies.iter().try_for_each(|body| body.check_contact_radius(radius))
    }
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
