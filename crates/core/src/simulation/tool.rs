//! The tip of a device, and how it touches.

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
#[derive(Clone, Copy, Debug)]
pub struct ToolModel {
    /// Radius of the sphere, m.
    pub radius: f64,
    /// How it touches.
    pub law: LawKind,
    /// Young's modulus of its pad, Pa; a rigid tool has none.
    pub pad_youngs_modulus: Option<f64>,
    /// Stiffest contact rendered, N/m: near a support the body alone would be rigid, which no device can render.
    pub max_stiffness: f64,
}
