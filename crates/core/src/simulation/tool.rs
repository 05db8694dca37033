//! The tip of a device, and how it touches.

use crate::contact::shape::ToolShape;

/// The laws there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LawKind {
    /// Contact with a half-space in series with the finite element body: slides, rubs, rolls off.
    Local,
    /// A smooth patch of a physical radius that sticks to the material it first touched.
    #[default]
    Patch,
    /// The contact of Jun, Choi and Cho: the node closest to where the tool first touched.
    Node,
}

impl LawKind {
    /// `"patch"` or `"node"`.
    pub fn name(self) -> &'static str {
        match self {
            LawKind::Local => "local",
            LawKind::Patch => "patch",
            LawKind::Node => "node",
        }
    }

    /// The law called `name`.
    pub fn parse(name: &str) -> Option<Self> {
        [LawKind::Local, LawKind::Patch, LawKind::Node].into_iter().find(|kind| kind.name() == name)
    }
}

/// The tip of one device.
#[derive(Clone, Debug)]
pub struct ToolModel {
    /// What it looks like. Laws other than the local one touch where the closest point of its origin is.
    pub shape: ToolShape,
    /// Size of the part that touches, m: the radius of a sphere, else as [`contact_size`] has it. The regular compliance, what
    /// counts as a jump and where the tool is near a body are measured by it.
    pub radius: f64,
    /// How it touches.
    pub law: LawKind,
    /// Young's modulus of its pad, Pa; a rigid tool has none.
    pub pad_youngs_modulus: Option<f64>,
    /// Stiffest contact rendered, N/m: near a support the body alone would be rigid, which no device can render.
    pub max_stiffness: f64,
}

/// Half the greatest width of what a shape can touch a plane with, m: contacts reach no farther from their middle.
pub fn contact_size(shape: &ToolShape) -> f64 {
    match *shape {
        // Its long side, as far as it may lie on a body, is no part of its face.
        ToolShape::Punch { radius, .. } => radius,
        _ => shape.bounding_radius(),
    }
}
