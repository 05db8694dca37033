//! What meets in a local contact, and what comes of it.

use glam::{DMat3, DVec3};

use crate::contact::local::effective_modulus;
use crate::contact::shape::ToolShape;
use crate::contact::smooth::{FanWeights, SmoothSurface};
use crate::contact::{Moduli, SurfaceQuery};
use crate::mesh::Surface;

/// What a tool meets of a body.
#[derive(Clone, Copy)]
pub struct LocalBody<'a> {
    pub surface: &'a Surface,
    pub query: &'a SurfaceQuery,
    pub smooth: &'a SmoothSurface,
    pub moduli: &'a Moduli,
    /// `C_reg` at the fans, m/N.
    pub regular: &'a [DMat3],
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

/// The half-space below a tool.
pub struct HalfSpace {
    /// `E*`, Pa, and its gradient by the place of the foot's point.
    pub modulus: f64,
    pub slope: DVec3,
    /// `k_t / k_n`.
    pub tangential: f64,
}

impl HalfSpace {
    /// Of the body's constants at the foot and the tool's pad; of it a contact has a `part`.
    pub fn new(body: LocalBody<'_>, tool: LocalTool<'_>, weights: &FanWeights, part: f64) -> Self {
        let fans = body.smooth.fans();
        let (own, own_slope) = weights.field(|fan| body.scale * body.moduli.plane_strain(fans[fan].node));
        let (poisson, _) = weights.field(|fan| body.moduli.poissons[fans[fan].node as usize]);
        let whole = effective_modulus(own, 0.0, tool.pad);
        let (modulus, slope) = (part * whole, own_slope * (part * (whole / own).powi(2)));
        Self { modulus, slope, tangential: 2.0 * (1.0 - poisson) / (2.0 - poisson) }
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
