//! The regular part of a body's compliance, at every touchable node.
//!
//! By Saint-Venant's principle a force spread over the radius `b` and the same force spread over a smaller contact differ
//! near the contact only, where the body is a half-space:
//!
//! ```text
//! C_reg(x) = W_b(x)^T Psi W_b(x) - c_half(b)
//! ```
//!
//! `c_half` is the mean displacement of a half-space under the pressure `phi = (1 - r^2/b^2)^2 / int phi`, both weighted by
//! `phi`. With `phi^(q) = 16 pi J_3(q b) / (q^3 b)` the normal one is
//!
//! ```text
//! c_n = (1 - nu^2)/E * (1/pi) int_0^inf phi^(q)^2 dq / (int phi)^2 = k (1 - nu^2) / (E b)
//! k = 2304/pi int_0^inf J_3(t)^2 / t^6 dt = 0.766544
//! ```
//!
//! and the tangential one `c_n (1 - nu/2) / (1 - nu)` by Cerruti's solution; normal and tangent do not couple.

use glam::DMat3;

use super::smooth::SmoothSurface;
use super::{PatchGeometry, PatchScratch, Refusal, SurfacePoint, TouchPatch, patch_weights, smallest_eigenvalue};
use crate::contact::Patch;
use crate::green::GreensFunction;
use crate::tensor::{outer, symmetric};

/// `k`.
const HALF_SPACE: f64 = 0.766_544;
/// `b` over the mean spacing of nodes around: at 2 the ripple of a sliding contact is 1 %, at 3 it is 0.03 %.
const SPACINGS: f64 = 3.0;
/// `b` over the tool's radius: a contact is smaller than its tool. A wider one would take a nodule at the depth of the tool's
/// radius for the half-space.
const RADII: f64 = 1.0;
/// Where more nodes than a patch takes lie within `b`, it is shortened by this factor until they fit.
const SHORTER: f64 = 0.9;
/// Stiffest regular part over `1 / (E* R)`: the local compliance of the largest contact, `1 / (2 E* R)`, outweighs it.
const STIFFEST: f64 = 0.45;

/// Elastic constants at the surface nodes.
#[derive(Clone, Debug)]
pub struct Moduli {
    /// Young's modulus, Pa.
    pub youngs: Vec<f64>,
    /// Poisson's ratio.
    pub poissons: Vec<f64>,
}

impl Moduli {
    /// `E / (1 - nu^2)` of a node, Pa.
    pub fn plane_strain(&self, node: u32) -> f64 {
        self.youngs[node as usize] / (1.0 - self.poissons[node as usize].powi(2))
    }
}

/// What a tool meets at a fan: mean and Gaussian curvature (1/m, 1/m^2), `E/(1 - nu^2)` (Pa) and `nu`, `C_reg` by
/// `xx, xy, xz, yy, yz, zz` (m/N; zero where nothing can be touched), and `b` (m); filled up to a whole number of vectors.
pub type FanFields = [f64; FIELDS];
const FIELDS: usize = 12;
/// Field of the mean curvature.
pub const MEAN: usize = 0;
/// Field of the Gaussian curvature.
pub const GAUSS: usize = 1;
/// Field of `E/(1 - nu^2)`.
pub const PLANE_STRAIN: usize = 2;
/// Field of Poisson's ratio.
pub const POISSON: usize = 3;
/// Fields of `C_reg`.
pub const COMPLIANCE: std::ops::Range<usize> = 4..10;
/// Field of `b`.
pub const WIDTH: usize = 10;

/// What a tool of one radius meets of a body.
pub struct RegularCompliance {
    /// One entry a fan of the smooth surface.
    pub fields: Vec<FanFields>,
}

/// A body as its regular compliance needs it.
#[derive(Clone, Copy)]
pub struct CompliantBody<'a> {
    /// Its compliance.
    pub green: &'a GreensFunction,
    /// Its faces at rest.
    pub geometry: &'a PatchGeometry,
    /// The surface that tools meet.
    pub smooth: &'a SmoothSurface,
    /// Its elastic constants.
    pub moduli: &'a Moduli,
}

impl RegularCompliance {
    /// For a tool of `radius`, m, on a device that holds contacts up to `max_stiffness`, N/m: near a support the patch's
    /// compliance is raised evenly to what the device can render.
    pub fn new(body: CompliantBody<'_>, radius: f64, max_stiffness: f64) -> Self {
        let count = body.smooth.fans().len();
        let block = |(scratch, patch): &mut (PatchScratch, Patch), fan: usize| {
            if body.smooth.touchable[fan] {
                at_fan(body, fan, radius, max_stiffness, scratch, patch)
            } else {
                (DMat3::ZERO, 0.0)
            }
        };
        let memory = || (PatchScratch::new(&body.green.surface), Patch::default());
        #[cfg(feature = "offline")]
        let found: Vec<_> = {
            use rayon::prelude::*;
            (0..count).into_par_iter().map_init(memory, block).collect()
        };
        #[cfg(not(feature = "offline"))]
        let found: Vec<_> = {
            let mut memory = memory();
            (0..count).map(|fan| block(&mut memory, fan)).collect()
        };
        let fields = found.into_iter().zip(body.smooth.fans()).map(|((c, width), fan)| {
            let (modulus, poisson) = (body.moduli.plane_strain(fan.node), body.moduli.poissons[fan.node as usize]);
            let [x, y, z] = [c.x_axis, c.y_axis, c.z_axis];
            [fan.mean, fan.gauss, modulus, poisson, x.x, x.y, x.z, y.y, y.z, z.z, width, 0.0]
        });
        Self { fields: fields.collect() }
    }
}

/// `C_reg` from blended fields.
pub fn compliance_of(fields: &FanFields) -> DMat3 {
    symmetric(std::array::from_fn(|k| fields[COMPLIANCE.start + k]))
}

fn at_fan(
    body: CompliantBody<'_>,
    rank: usize,
    radius: f64,
    max_stiffness: f64,
    scratch: &mut PatchScratch,
    patch: &mut Patch,
) -> (DMat3, f64) {
    let (surface, fan) = (&body.green.surface, &body.smooth.fans()[rank]);
    let corner = surface.triangles[fan.triangle as usize].iter().position(|&n| n == fan.node).unwrap_or(0);
    let mut barycentric = [0.0; 3];
    barycentric[corner] = 1.0;
    let centre = SurfacePoint {
        position: surface.positions[fan.node as usize],
        triangle: fan.triangle,
        barycentric,
        normal: fan.normal,
        signed_distance: 0.0,
    };
    let mut wide = (SPACINGS * body.smooth.spacing_around(fan)).max(RADII * radius);
    while patch_weights(surface, body.geometry, &centre, wide, scratch, patch) == Err(Refusal::TooManyNodes) {
        wide *= SHORTER;
    }
    let mut touched = TouchPatch::default();
    touched.admit_touchable(body.green, patch);
    let whole = touched.own_compliance(body.green);
    let modulus = body.moduli.plane_strain(fan.node);
    let poisson = body.moduli.poissons[fan.node as usize];
    let normal = HALF_SPACE / (modulus * wide);
    let tangential = normal * (1.0 - 0.5 * poisson) / (1.0 - poisson);
    let along = outer(fan.normal, fan.normal);
    let half_space = DMat3::IDENTITY * tangential + along * (normal - tangential);
    let rendered = (1.0 / max_stiffness - smallest_eigenvalue(&whole)).max(0.0);
    let regular = whole - half_space + DMat3::IDENTITY * rendered;
    let floor = -STIFFEST / (modulus * radius);
    (regular + DMat3::IDENTITY * (floor - smallest_eigenvalue(&regular)).max(0.0), wide)
}

#[cfg(test)]
mod tests {
    use super::HALF_SPACE;

    /// `J_3` by its integral, and the integral of `J_3^2 / t^6` by Simpson's rule; the tail beyond 60 is below 1e-10.
    #[test]
    fn the_constant_is_its_integral() {
        let simpson = |f: &dyn Fn(f64) -> f64, from: f64, to: f64, n: usize| {
            let h = (to - from) / n as f64;
            let term =
                |i: usize| f(from + h * i as f64) * if i == 0 || i == n { 1.0 } else { 2.0 + 2.0 * (i % 2) as f64 };
            (0..=n).map(term).sum::<f64>() * h / 3.0
        };
        let bessel = |t: f64| {
            simpson(&|a: f64| (3.0 * a - t * a.sin()).cos(), 0.0, std::f64::consts::PI, 200) / std::f64::consts::PI
        };
        let integrand = |t: f64| if t < 1e-3 { 1.0 / 2304.0 } else { (bessel(t) / (t * t * t)).powi(2) };
        let k = 2304.0 / std::f64::consts::PI * simpson(&integrand, 0.0, 60.0, 3000);
        assert!((k - HALF_SPACE).abs() < 2e-6, "{k}");
    }
}
