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
//!
//! Elements follow the half-space below the patch only in part: their compliance lacks a share `e` of `c_half(b)`, and
//! `(1 - e) c_half(b)` is what is subtracted. With the mean spacing `h` of the nodes on the surface, blocks of 10-node elements have,
//! for `b = 3 h` and `nu = 0.3, 0.45, 0.49` (`python -m benches strain --elements`),
//!
//! ```text
//! cubes cut into six   e = 2.0, 2.6, 3.6 %        NETGEN   e = 1.7, 1.8, 2.4 %        e ~ (h/b)^3 for b/h from 2.5 to 4
//! ```
//!
//! so that the mean of both, which `lacking` returns, leaves a third of it. Without it forces on such elements are 2 to 4 % too large
//! at all depths. At edges and in thin parts, which yield more than a half-space, it was not measured, and nothing is taken off. What
//! 4-node elements lack, 8 to 21 %, is not local: they lock in all of the body, and nothing is taken off either.
//!
//! An inclusion no deeper than `b` is spread over the soft tissue beside it. As an integral over a smooth
//! field `C_reg` goes with the second moment of `phi`: `C_reg(b) = C_reg(0) + O(b^2)`. In a body of several materials it is
//! extrapolated from two radii to that of a contact of half the tool's radius, and its change with the square of the contact
//! radius is stored (`local::widening`). In a body of one material it changes only with the distance to edges
//! and supports, and extrapolating would mostly enlarge the error of the elements. A body that is hardly thicker than `b` is
//! an exception: under a patch of one and a half thicknesses a plate bends 10 to 15 % less than under a small contact, and a glued
//! layer is squeezed less. There the extrapolation counts in part, and fully where the body is as thin as `b`.

use glam::DMat3;

use super::local::StrainTerms;
use super::smooth::{Blended, Fan, FanWeights, SmoothSurface};
use super::{
    Patch, PatchGeometry, PatchScratch, Refusal, SurfacePoint, TouchPatch, map_with, patch_weights, raise_eigenvalues,
    smallest_eigenvalue,
};
use crate::green::GreensFunction;
use crate::memory::Ranges;
use crate::mesh::{Faces, Surface};
use crate::tensor::{outer, symmetric};

/// `k`.
pub(crate) const HALF_SPACE: f64 = 0.766_544;
/// `b` over the mean spacing of nodes around: at 2 the ripple of a sliding contact is 1 %, at 3 it is 0.03 %.
const SPACINGS: f64 = 3.0;
/// The least `b` over that spacing, if a patch is reduced because it would reach outside the touch region.
const LEAST_SPACINGS: f64 = 2.0;
/// Contact radius that `C_reg` is extrapolated to, over the tool's radius.
const CONTACT: f64 = 0.5;
/// A Hertzian contact of radius `a` has the second moment of `phi` for `b^2 = 8/5 a^2`.
const SAME_MOMENT: f64 = 1.6;
/// `b` over the thickness of a body of one material from which the regular part is extrapolated, and fully so.
const THIN: [f64; 2] = [0.5, 1.0];
/// Ratio of the two widths from which the regular part is extrapolated; and the least difference of their squares, over that
/// of the first.
const SECOND_WIDTH: f64 = 1.5;
const LEAST_APART: f64 = 0.4;
/// Least `b` over the tool's spreading radius in a body of one material. The error of the elements is a share of `c_half(b)`, so that
/// it would
/// grow as the mesh is refined if `b` followed the elements alone.
const EVEN_WIDTH: f64 = 1.1;
/// How fast the regular part may fall and rise with the square of the contact radius, over `1 / (E* R^3)` (see
/// [`super::local::Widening`]).
const WIDENING_RANGE: [f64; 2] = [-2.0, 7.0];
/// Share of `c_half(b)` that 10-node elements lack for a patch of `b` of [`SPACINGS`]: a constant, a part that goes with
/// `1/(1 - 2 nu)`, and the largest of these that counts.
const LACKING: [f64; 2] = [0.0193, 0.000_22];
const MOST_INCOMPRESSIBLE: f64 = 50.0;
/// Compliance over `c_half(b)` up to which that counts fully, and from which on not at all: at edges, and in thin parts that bend.
const COMPACT: [f64; 2] = [1.2, 1.5];
/// Factor by which `b` is reduced until its nodes fit into a patch.
const SHORTENING: f64 = 0.9;
/// Stiffest regular part over `1 / (E* R)`: the local compliance of the largest contact, `1 / (2 E* R)`, outweighs it.
const STIFFEST: f64 = 0.45;
/// Least radius of the patch on a body in motion, over the tool's. Within a step a body may be nearly rigid, and the remainder, the
/// local law less the half-space of the patch, is monotonic for contact radii up to `1/1.53` of the patch. The second is the radius
/// of the half-space by which the patch may be softer than the regular part.
const LEAST_MOTION_WIDTH: f64 = 1.6;
const LEAST_HALF_SPACE_WIDTH: f64 = 1.55;
/// A patch on a body in motion is widened by steps of this factor, and by no more than that one.
const WIDENING_STEP: f64 = 1.1;
const MOST_WIDENING: f64 = 3.0;

/// Elastic constants at the surface nodes.
#[derive(Clone, Debug)]
pub struct Moduli {
    /// Young's modulus, Pa.
    pub youngs: Vec<f64>,
    /// Poisson's ratio.
    pub poissons: Vec<f64>,
    /// Coefficients of the contact at finite strain; zero for a linear material.
    pub strain_terms: Vec<StrainTerms>,
    /// Whether all of the body, not only its surface, is of one material.
    pub homogeneous: bool,
}

impl Moduli {
    /// Of a linear material.
    pub fn linear(youngs: Vec<f64>, poissons: Vec<f64>, homogeneous: bool) -> Self {
        let strain_terms = vec![[0.0; 3]; youngs.len()];
        Self { youngs, poissons, strain_terms, homogeneous }
    }

    /// Adds the memory that a tick reads.
    pub(crate) fn add_memory(&self, ranges: &mut Ranges) {
        ranges.add(&self.youngs);
        ranges.add(&self.poissons);
        ranges.add(&self.strain_terms);
    }

    /// `E / (1 - nu^2)` of a node, Pa.
    pub fn plane_strain(&self, node: u32) -> f64 {
        self.youngs[node as usize] / (1.0 - self.poissons[node as usize].powi(2))
    }
}

/// Fields at a fan: mean and Gaussian curvature (1/m, 1/m^2), `(1 - nu^2)/E` (1/Pa) and `nu`, `C_reg` by
/// `xx, xy, xz, yy, yz, zz` (m/N; zero where the body is not touchable), `b` (m), how its normal part changes with the square
/// of the contact radius (1/(N m)), and the coefficients of finite strain.
pub type FanFields = [f64; FIELDS];
/// Numbers of an entry.
pub const FIELDS: usize = 15;
/// Field of the mean curvature.
pub const MEAN: usize = 0;
/// Field of the Gaussian curvature.
pub const GAUSS: usize = 1;
/// Field of `(1 - nu^2)/E`. It is blended rather than the modulus, as the half-spaces that are taken off `C_reg` are: what a tool
/// feels is the blend of the body's compliances beside a stiffer part too.
pub const INVERSE_MODULUS: usize = 2;
/// Field of Poisson's ratio.
pub const POISSON: usize = 3;
/// Fields of `C_reg`.
pub const COMPLIANCE: std::ops::Range<usize> = 4..10;
/// Field of the radius of the patch: `b`, or more on a body in motion.
pub const WIDTH: usize = 10;
/// Field of the change with the square of the contact radius.
pub const WIDENING: usize = 11;
/// Fields of the coefficients of finite strain.
pub const STRAIN_TERMS: std::ops::Range<usize> = 12..15;

/// Fields blended by the weights of fans. The coefficients of finite strain are read for a hyperelastic body only: all of them are
/// zero on a linear one. The others fill the processor's vector registers.
pub fn blend_fields(weights: &FanWeights, fields: &[FanFields], is_hyperelastic: bool) -> Blended<FIELDS> {
    const LINEAR: usize = STRAIN_TERMS.start;
    let mut blended = Blended::default();
    weights.blend_part::<FIELDS, LINEAR>(fields, 0, &mut blended);
    if is_hyperelastic {
        weights.blend_part::<FIELDS, { FIELDS - LINEAR }>(fields, LINEAR, &mut blended);
    }
    blended
}

/// Regular compliance of a body for tools of one radius.
pub struct RegularCompliance {
    /// One entry for each fan of the smooth surface.
    pub fields: Vec<FanFields>,
}

/// Data of a body for its regular compliance.
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
    /// One over the thickness of the body, and over its breadth, at each fan, 1/m; zero for a linear body.
    pub inverse_sizes: &'a [[f64; 2]],
    /// Whether it moves.
    pub moves: bool,
}

impl RegularCompliance {
    /// For a tool of a radius, and of that of the sphere whose largest contact spreads a force as far, m, on a device that renders up
    /// to `max_stiffness`, N/m: near a support the patch's compliance is raised evenly to what the device can render.
    pub fn new(body: CompliantBody<'_>, radii: [f64; 2], max_stiffness: f64) -> Self {
        let count = body.smooth.fans().len();
        let block = |(scratch, patch): &mut (PatchScratch, Patch), fan: usize| {
            if body.smooth.touchable[fan] {
                fan_compliance(body, fan, radii, max_stiffness, scratch, patch)
            } else {
                FanCompliance { regular: DMat3::ZERO, width: 0.0, widening: 0.0 }
            }
        };
        let memory = || (PatchScratch::new(&body.green.surface), Patch::default());
        let fields = map_with(count, memory, block).into_iter().zip(body.smooth.fans()).map(|(at, fan)| {
            let FanCompliance { regular: c, width, widening } = at;
            let (inverse, poisson) =
                (1.0 / body.moduli.plane_strain(fan.node), body.moduli.poissons[fan.node as usize]);
            let [x, y, z] = [c.x_axis, c.y_axis, c.z_axis];
            let body_fields = [fan.mean, fan.gauss, inverse, poisson, x.x, x.y, x.z, y.y, y.z, z.z, width, widening];
            let mut fields = [0.0; FIELDS];
            fields[..WIDENING + 1].copy_from_slice(&body_fields);
            fields[STRAIN_TERMS].copy_from_slice(&body.moduli.strain_terms[fan.node as usize]);
            fields
        });
        Self { fields: fields.collect() }
    }
}

/// `C_reg` from blended fields.
pub fn compliance_of(fields: &FanFields) -> DMat3 {
    symmetric(std::array::from_fn(|k| fields[COMPLIANCE.start + k]))
}

/// Regular compliance at one fan, width of its patch, and its change with the square of the contact radius.
struct FanCompliance {
    regular: DMat3,
    width: f64,
    widening: f64,
}

/// Measures a patch of some radius around one fan.
struct Probe<'a> {
    body: CompliantBody<'a>,
    centre: SurfacePoint,
    /// Mean spacing of the nodes around, m.
    spacing: f64,
    /// From 0 to 1 in a body of one material as thin as a patch is wide.
    thin: f64,
    /// Radius down to which a patch may be reduced: all nodes of the smallest are touchable.
    least: f64,
    scratch: &'a mut PatchScratch,
    patch: &'a mut Patch,
}

impl Probe<'_> {
    /// `W^T Psi W`, and the radius: `wide`, or less if the patch would have too many nodes or reach outside the touch region.
    fn compliance(&mut self, mut wide: f64) -> (DMat3, f64) {
        let CompliantBody { green, geometry, .. } = self.body;
        while patch_weights(&green.surface, geometry, &self.centre, wide, self.scratch, self.patch)
            == Err(Refusal::TooManyNodes)
            || (wide > self.least && !is_touchable(green, self.patch))
        {
            wide *= SHORTENING;
        }
        let mut touched = TouchPatch::default();
        touched.set_touchable_part(green, self.patch);
        (touched.own_compliance(green), wide)
    }

    /// `W^T Psi W - c_half(b)`, with both of the same elements, for a patch of radius `wide` whose compliance is known.
    fn regular(&self, compliance: &DMat3, fan: &Fan, wide: f64) -> DMat3 {
        let half_space = half_space(self.body.moduli, fan, wide);
        let along = |matrix: &DMat3| fan.normal.dot(*matrix * fan.normal);
        let share = match self.body.green.surface.faces {
            Faces::Quadratic(_) => {
                let poisson = self.body.moduli.poissons[fan.node as usize];
                let compact = compact(along(compliance) / along(&half_space));
                lacking(poisson, wide / self.spacing) * compact.max(self.thin)
            }
            Faces::Linear(_) => 0.0,
        };
        *compliance - half_space * (1.0 - share)
    }
}

fn fan_compliance(
    body: CompliantBody<'_>,
    rank: usize,
    [radius, spreading_radius]: [f64; 2],
    max_stiffness: f64,
    scratch: &mut PatchScratch,
    patch: &mut Patch,
) -> FanCompliance {
    let fan = &body.smooth.fans()[rank];
    let spacing = body.smooth.spacing_around(fan);
    let least = LEAST_SPACINGS * spacing;
    let mut probe =
        Probe { body, centre: centre_of(&body.green.surface, fan), spacing, thin: 0.0, least, scratch, patch };
    let floor = match body.moduli.homogeneous {
        true => EVEN_WIDTH * spreading_radius,
        false => (SAME_MOMENT * reference_area(radius)).sqrt(),
    };
    let (compliance, width) = probe.compliance((SPACINGS * spacing).max(floor));
    let share = extrapolated_share(body, rank, width);
    probe.thin = if body.moduli.homogeneous { share } else { 0.0 };
    let (mut regular, mut widening) = (probe.regular(&compliance, fan, width), 0.0);
    let unit = 1.0 / (body.moduli.plane_strain(fan.node) * radius);
    if share > 0.0 {
        // Of one material a narrower patch, which is closer to a contact.
        let ratio = if body.moduli.homogeneous { 1.0 / SECOND_WIDTH } else { SECOND_WIDTH };
        let (other, second) = probe.compliance(ratio * width);
        let apart = second * second - width * width;
        if apart.abs() > LEAST_APART * width * width {
            let rate = (probe.regular(&other, fan, second) - regular) * (share / apart);
            regular += rate * (SAME_MOMENT * reference_area(radius) - width * width);
            let [least, most] = WIDENING_RANGE.map(|bound| bound * unit / (radius * radius));
            widening = (SAME_MOMENT * fan.normal.dot(rate * fan.normal)).clamp(least, most);
        }
    }
    let rendered = (1.0 / max_stiffness - smallest_eigenvalue(&compliance)).max(0.0);
    regular += DMat3::IDENTITY * rendered;
    regular = raise_eigenvalues(&regular, -STIFFEST * unit);
    let (regular, width) = match body.moves {
        true => widen_for_motion(&mut probe, fan, (regular, width), radius),
        false => (regular, width),
    };
    FanCompliance { regular, width, widening }
}

/// Part of the extrapolation to the width of a contact that counts at a fan.
fn extrapolated_share(body: CompliantBody<'_>, rank: usize, width: f64) -> f64 {
    if !body.moduli.homogeneous {
        return 1.0;
    }
    let [inverse_thickness, _] = body.inverse_sizes[rank];
    let rise = ((width * inverse_thickness - THIN[0]) / (THIN[1] - THIN[0])).clamp(0.0, 1.0);
    rise * rise * (3.0 - 2.0 * rise)
}

/// Square of the contact radius that `C_reg` belongs to, m^2, for a tool of `radius`, m.
pub fn reference_area(radius: f64) -> f64 {
    (CONTACT * radius).powi(2)
}

/// Widens the patch until it is no softer than `regular` plus a half-space of the least radius. If it cannot be widened, raises
/// `regular` evenly.
fn widen_for_motion(probe: &mut Probe<'_>, fan: &Fan, (regular, wide): (DMat3, f64), radius: f64) -> (DMat3, f64) {
    let first = wide.max(LEAST_MOTION_WIDTH * radius);
    let least = half_space(probe.body.moduli, fan, LEAST_HALF_SPACE_WIDTH * radius);
    let mut wide = first;
    loop {
        let (compliance, width) = probe.compliance(wide);
        let missing = -smallest_eigenvalue(&(regular - compliance + least));
        if missing <= 0.0 {
            return (regular, width);
        }
        if width < wide || wide > MOST_WIDENING * first {
            return (regular + DMat3::IDENTITY * missing, width);
        }
        wide *= WIDENING_STEP;
    }
}

/// Whether all nodes of a patch are touchable.
fn is_touchable(green: &GreensFunction, patch: &Patch) -> bool {
    patch.iter().all(|(node, _)| green.touchable(node).is_some())
}

/// The fans at which the regular compliance is known: all nodes of the least patch around them are touchable. A patch cut off at
/// the border of the touch region is smaller and off its middle: its compliance would be wrong.
pub fn known_fans(green: &GreensFunction, geometry: &PatchGeometry, smooth: &SmoothSurface) -> Vec<bool> {
    if green.touch.len() == green.surface_count() {
        return vec![true; smooth.fans().len()];
    }
    let (mut scratch, mut patch) = (PatchScratch::new(&green.surface), Patch::default());
    let mut known = |fan: &Fan| {
        if green.touchable(fan.node as usize).is_none() {
            return false;
        }
        let (centre, mut wide) = (centre_of(&green.surface, fan), LEAST_SPACINGS * smooth.spacing_around(fan));
        while patch_weights(&green.surface, geometry, &centre, wide, &mut scratch, &mut patch).is_err() {
            wide *= SHORTENING;
        }
        is_touchable(green, &patch)
    };
    smooth.fans().iter().map(&mut known).collect()
}

/// The node of a fan, as a point of its triangle.
pub fn centre_of(surface: &Surface, fan: &Fan) -> SurfacePoint {
    let corner = surface.triangles[fan.triangle as usize].iter().position(|&n| n == fan.node).unwrap_or(0);
    let mut barycentric = [0.0; 3];
    barycentric[corner] = 1.0;
    SurfacePoint {
        position: surface.positions[fan.node as usize],
        triangle: fan.triangle,
        barycentric,
        normal: fan.normal,
        signed_distance: 0.0,
    }
}

/// Share of `c_half(b)` that 10-node elements lack, for `b` over the spacing of nodes.
fn lacking(poisson: f64, spacings: f64) -> f64 {
    let volumetric = (1.0 / (1.0 - 2.0 * poisson)).min(MOST_INCOMPRESSIBLE);
    (LACKING[0] + LACKING[1] * volumetric) * (SPACINGS / spacings).powi(3)
}

/// Part of it that counts where the body yields so many times as much as a half-space.
fn compact(ratio: f64) -> f64 {
    ((COMPACT[1] - ratio) / (COMPACT[1] - COMPACT[0])).clamp(0.0, 1.0)
}

/// `c_half(b)`.
fn half_space(moduli: &Moduli, fan: &Fan, wide: f64) -> DMat3 {
    let poisson = moduli.poissons[fan.node as usize];
    let tangential = (1.0 - 0.5 * poisson) / (1.0 - poisson);
    let shape = DMat3::IDENTITY * tangential + outer(fan.normal, fan.normal) * (1.0 - tangential);
    shape * (HALF_SPACE / (moduli.plane_strain(fan.node) * wide))
}

#[cfg(test)]
mod tests {
    use super::{HALF_SPACE, lacking};

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

    /// Measured on blocks of cubes and of NETGEN's elements (`python -m benches strain --elements`), the mean of both.
    #[test]
    fn elements_lack_what_was_measured() {
        for (poisson, spacings, share) in [(0.3, 2.5, 0.033), (0.3, 3.0, 0.019), (0.45, 3.0, 0.022), (0.49, 3.0, 0.030)]
        {
            assert!((lacking(poisson, spacings) / share - 1.0).abs() < 0.06, "{poisson} {spacings}");
        }
        // Neither grows without bound.
        assert!(lacking(0.4999, 3.0) < 0.031 && lacking(0.3, 9.0) < 1e-3);
    }
}
