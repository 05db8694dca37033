//! What meets in a local contact, and what comes of it.

use glam::DVec3;

use crate::contact::footprint::PressedSurface;
use crate::contact::local::effective_modulus;
use crate::contact::regular::{FanFields, PLANE_STRAIN, POISSON};
use crate::contact::shape::ToolShape;
use crate::contact::smooth::{Blended, DrawnSurface, SmoothSurface};

/// What a tool meets of a body.
#[derive(Clone, Copy)]
pub struct LocalBody<'a> {
    pub drawn: DrawnSurface<'a>,
    pub smooth: &'a SmoothSurface,
    /// What the tool meets at the fans.
    pub fields: &'a [FanFields],
    /// The same for a tool that is no sphere.
    pub pressed: Option<&'a PressedSurface>,
    /// Young's modulus over the Green's function's.
    pub scale: f64,
}

/// The tool, and what it rubs with.
#[derive(Clone, Copy)]
pub struct LocalTool<'a> {
    /// What it looks like.
    pub shape: &'a ToolShape,
    /// Size of the part that touches, m: of a sphere its radius.
    pub radius: f64,
    /// Young's modulus of its pad, Pa; a rigid one has none.
    pub pad: Option<f64>,
    /// Coulomb's coefficient.
    pub coefficient: f64,
}

/// What the tool meets at a foot.
pub type Fields = Blended<{ size_of::<FanFields>() / size_of::<f64>() }>;

/// The half-space below a tool.
pub struct HalfSpace {
    /// `E*`, Pa, and its gradient by the place of the foot's point.
    pub modulus: f64,
    pub slope: DVec3,
    /// Its derivative by the body's own `E/(1 - nu^2)`.
    pub by_own: f64,
    /// `k_t / k_n`.
    pub tangential: f64,
}

impl HalfSpace {
    /// Of the body's constants at the foot and the tool's pad; of it a contact has a `part`.
    pub fn new(body: LocalBody<'_>, tool: LocalTool<'_>, fields: &Fields, part: f64) -> Self {
        let own = body.scale * fields.values[PLANE_STRAIN];
        let whole = effective_modulus(own, 0.0, tool.pad);
        let modulus = part * whole;
        let by_own = part * body.scale * (whole / own).powi(2);
        let slope = fields.slope(PLANE_STRAIN) * by_own;
        let poisson = fields.values[POISSON];
        Self { modulus, slope, by_own, tangential: 2.0 * (1.0 - poisson) / (2.0 - poisson) }
    }
}

/// Energy of the local contact at a place and its gradient without friction.
#[derive(Clone, Copy, Debug, Default)]
pub struct Indentation {
    /// Normal force, N.
    pub force: f64,
    /// Contact radius, or that of the circle of the same stiffness, m.
    pub radius: f64,
    /// Normal stiffness, N/m.
    pub stiffness: f64,
    /// J.
    pub energy: f64,
    /// `dPhi/dp'`, N.
    pub gradient: DVec3,
    /// Torque on the tool about its tip, N m.
    pub torque: DVec3,
    /// From the tip to where friction acts, m.
    pub lever: DVec3,
    /// `k_t / k_n`.
    pub tangential: f64,
}
