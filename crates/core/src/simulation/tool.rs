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

/// Half the greatest width of the part of a shape that can touch a plane, m: contacts reach no farther from their middle.
pub fn contact_size(shape: &ToolShape) -> f64 {
    match *shape {
        // The face alone: a punch lying on its side is not considered.
        ToolShape::Punch { radius, .. } => radius,
        _ => shape.bounding_radius(),
    }
}
