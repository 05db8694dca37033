//! What is fixed while a simulation runs.

use super::body::BodyModel;
use super::tool::ToolModel;
use super::{MAX_BODIES, MAX_TOOLS};
use crate::{Error, Result};

/// Bodies and tools.
pub struct Model {
    /// The bodies.
    pub bodies: Vec<BodyModel>,
    /// The tools; one a device.
    pub tools: Vec<ToolModel>,
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

    /// Refuses a contact radius that some body cannot take.
    ///
    /// # Errors
    /// See [`BodyModel::check_contact_radius`].
    pub fn check_contact_radius(&self, radius: f64) -> Result<()> {
        self.bodies.iter().try_for_each(|body| body.check_contact_radius(radius))
    }
}
