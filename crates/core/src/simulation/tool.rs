//! Tool of a device: its shape and its contact law.

use crate::contact::shape::ToolShape;

/// Which contact law a tool or a contact has. Each law defines its own constant (`law/`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LawKind {
    pub(super) name: &'static str,
    /// Whether it needs the elastic constants at the surface and the data prepared from them.
    pub(super) needs_moduli: bool,
}

impl LawKind {
    /// The name that scenes use.
    pub fn name(self) -> &'static str {
        self.name
    }
}

/// The tool of one device.
#[derive(Clone, Debug)]
pub struct ToolModel {
    /// Its shape. Laws other than the local one touch at the surface point closest to its origin.
    pub shape: ToolShape,
    /// Size of the part that touches, m: the radius of a sphere, otherwise [`contact_size`]. The regular compliance, jumps and
    /// distances from a body are measured by it.
    pub radius: f64,
    /// Its contact law.
    pub law: LawKind,
    /// Young's modulus of its pad, Pa; a rigid tool has none.
    pub pad_youngs_modulus: Option<f64>,
    /// Stiffest contact rendered, N/m: near a support the body alone would be rigid, which no device can render.
    pub max_stiffness: f64,
}

/// Radius of the sphere whose largest contact spreads a force as far as a flat punch, over that of the punch. The pressure of a punch
/// has the second moment `2 R^2/3`. That of the sphere is `2 a^2/5` with `a = 0.87 R`, for which its patch is made.
const FLAT: f64 = 1.48;

impl ToolModel {
    /// Radius of the sphere whose largest contact spreads a force as far as that of the tool, m.
    pub fn spreading_radius(&self) -> f64 {
        match self.shape {
            ToolShape::Punch { .. } => FLAT * self.radius,
            _ => self.radius,
        }
    }
}

/// Half the greatest width of the part of a shape that can touch a plane, m: contacts reach no farther from their middle.
pub fn contact_size(shape: &ToolShape) -> f64 {
    match *shape {
        // The face alone: a punch lying on its side is not considered.
        ToolShape::Punch { radius, .. } => radius,
        _ => shape.bounding_radius(),
    }
}
