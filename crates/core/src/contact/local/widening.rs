//! A sphere on a body with an inclusion not much deeper than the contact is wide.
//!
//! The regular part of the compliance is the mean of a smooth field over the pressure, so that it goes with the pressure's
//! second moment: `C(a) = C(a_0) + kappa (A - a_0^2)` with the square `A` of the contact radius. `C(a_0)` is the body's; the
//! rest is that of the local law. As Hertz has it, `A = (3 R F / 4 E*)^(2/3)`, and with the complementary energy
//!
//! ```text
//! W(F) = kappa F^2 (A - a_0^2) / 2        d = d_sphere(F) + dW/dF,   dW/dF = kappa F (4/3 A - a_0^2)
//! U(d) = U_sphere + F dW/dF - W           dU/d(theta) at constant d = dU_sphere/d(theta) - dW/d(theta) at constant F
//! ```
//!
//! so that force, stiffness and the forces along a surface on which anything changes follow from one energy. A negative `kappa` is that
//! of a body that bends around the tool: it flattens the gap, and the contact grows. It counts up to the force `F_1 = 0.147/(R |kappa|)`,
//! and beyond that `dW/dF` stays what it is there: the approach grows with the force by more than half of what it does without it.

use super::finite_strain::{StrainCorrection, StrainTerms, correct_sphere};
use super::sphere::{SphereContact, SphereOnSurface, indent_sphere};
use crate::math::cbrt;

/// Newton's steps for the approach of the sphere alone. Three are usual.
const MOST_STEPS: usize = 12;
/// Relative error of a converged approach.
const SETTLED: f64 = 1e-13;
/// `R |kappa| F_1` of a body that bends around the tool.
const MOST_BENDING: f64 = 0.147;
/// `R/a_0` of the reference of a tool.
const REFERENCE: f64 = 2.0;

/// How the regular compliance changes with the contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Widening {
    /// `kappa`, 1/(N m).
    pub rate: f64,
    /// `a_0^2`, m^2.
    pub reference: f64,
}

/// State of the sphere, and derivatives of its energy at constant approach.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WidenedContact {
    /// The sphere; its stiffness, energy and derivative by the radius are those of the whole.
    pub sphere: SphereContact,
    /// By `E*`, J/Pa.
    pub energy_by_modulus: f64,
    /// By `kappa`, J N m.
    pub energy_by_rate: f64,
    /// By the coefficients of finite strain, J.
    pub energy_by_terms: StrainTerms,
}

impl Widening {
    /// A sphere that approaches a body of modulus `E*` (Pa) and of coefficients of finite strain by `approach` (m); a linear body has
    /// none.
    pub fn indent(
        self,
        approach: f64,
        pair: SphereOnSurface,
        effective_modulus: f64,
        terms: Option<&StrainTerms>,
    ) -> WidenedContact {
        let indent = |approach: f64| {
            let sphere = indent_sphere(approach, pair, effective_modulus);
            let Some(terms) = terms else { return (sphere, StrainCorrection::default()) };
            let correction = correct_sphere(approach, pair.radius, effective_modulus, terms);
            (sphere.corrected(&correction), correction)
        };
        let whole = approach.max(0.0);
        let mut own = whole;
        let (mut sphere, mut correction) = indent(own);
        if self.rate == 0.0 {
            // A body of one material.
            let energy_by_modulus = sphere.energy / effective_modulus;
            let energy_by_terms = correction.energy_by_terms;
            return WidenedContact { sphere, energy_by_modulus, energy_by_rate: 0.0, energy_by_terms };
        }
        let (mut growth, radius) = (1.0, pair.effective_radius());
        for _ in 0..MOST_STEPS {
            let change = self.change(sphere.force, radius, effective_modulus);
            let residual = own + change.displacement - whole;
            growth = 1.0 + sphere.stiffness * change.slope;
            if residual.abs() <= SETTLED * whole || sphere.force == 0.0 {
                break;
            }
            own = (own - residual / growth).max(0.1 * own);
            (sphere, correction) = indent(own);
        }
        self.whole((sphere, correction), growth, radius, effective_modulus)
    }

    /// State of the whole from that of the sphere; `growth` is the derivative of the approach by the sphere's own.
    fn whole(
        self,
        (sphere, correction): (SphereContact, StrainCorrection),
        growth: f64,
        radius: f64,
        effective_modulus: f64,
    ) -> WidenedContact {
        let change = self.change(sphere.force, radius, effective_modulus);
        WidenedContact {
            sphere: SphereContact {
                stiffness: sphere.stiffness / growth,
                energy: sphere.energy + sphere.force * change.displacement - change.energy,
                energy_by_curvature: sphere.energy_by_curvature + change.by_radius * radius,
                ..sphere
            },
            energy_by_modulus: (sphere.energy + change.by_radius) / effective_modulus,
            energy_by_rate: -change.by_rate,
            energy_by_terms: correction.energy_by_terms,
        }
    }

    /// `W` at a force, N, of a sphere of an effective radius, m.
    fn change(self, force: f64, radius: f64, effective_modulus: f64) -> Change {
        let Self { rate, reference } = self;
        let most = if rate < 0.0 { MOST_BENDING / (-rate * REFERENCE * reference.sqrt()) } else { f64::INFINITY };
        let within = force.min(most);
        let beyond = force - within;
        let area = hertz_area(within, radius, effective_modulus);
        let energy = 0.5 * within * within * (area - reference);
        let displacement = within * (4.0 / 3.0 * area - reference);
        let slope = 20.0 / 9.0 * area - reference;
        Change {
            displacement: rate * displacement,
            slope: if beyond > 0.0 { 0.0 } else { rate * slope },
            energy: rate * (energy + displacement * beyond),
            by_radius: rate * within * area * (within / 3.0 + 8.0 / 9.0 * beyond),
            // F_1 goes with 1/kappa.
            by_rate: energy + (displacement - slope * within) * beyond,
        }
    }
}

/// `W`, J, and its derivatives: the first and second by the force, by the logarithm of the radius, and by `kappa`.
struct Change {
    displacement: f64,
    slope: f64,
    energy: f64,
    by_radius: f64,
    by_rate: f64,
}

/// Square of the radius of a Hertzian contact, m^2.
fn hertz_area(force: f64, radius: f64, effective_modulus: f64) -> f64 {
    cbrt(0.75 * radius * force / effective_modulus).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MODULUS: f64 = 6e3;
    const RADIUS: f64 = 5e-3;
    const PAIR: SphereOnSurface = SphereOnSurface { radius: RADIUS, curvature: 40.0 };
    const TERMS: StrainTerms = [-0.05, -0.04, -0.05];

    fn widenings() -> impl Iterator<Item = Widening> {
        let unit = 1.0 / (MODULUS * RADIUS.powi(3));
        [-2.0, -0.6, -0.11, 0.0, 0.3, 7.0]
            .into_iter()
            .map(move |rate| Widening { rate: rate * unit, reference: RADIUS * RADIUS / 4.0 })
    }

    /// `f'` by central differences.
    fn slope(f: impl Fn(f64) -> f64, at: f64) -> f64 {
        let step = 1e-5 * at.abs();
        (f(at + step) - f(at - step)) / (2.0 * step)
    }

    #[test]
    fn force_and_stiffness_are_derivatives_of_the_energy() {
        for widening in widenings() {
            for depth in [0.02, 0.1, 0.3, 0.8].map(|d| d * RADIUS) {
                let at = |d: f64| widening.indent(d, PAIR, MODULUS, Some(&TERMS)).sphere;
                let contact = at(depth);
                assert!((slope(|d| at(d).energy, depth) / contact.force - 1.0).abs() < 1e-6, "{widening:?} {depth}");
                assert!((slope(|d| at(d).force, depth) / contact.stiffness - 1.0).abs() < 1e-6, "{widening:?} {depth}");
            }
        }
    }

    #[test]
    fn derivatives_by_curvature_modulus_and_rate_are_those_of_the_energy() {
        for widening in widenings() {
            let depth = 0.8 * RADIUS;
            let energy = |rate, curvature, modulus| {
                let pair = SphereOnSurface { curvature, ..PAIR };
                Widening { rate, ..widening }.indent(depth, pair, modulus, Some(&TERMS)).sphere.energy
            };
            let contact = widening.indent(depth, PAIR, MODULUS, Some(&TERMS));
            let close = |a: f64, b: f64| (a - b).abs() < 1e-6 * b.abs().max(1e-3 * contact.sphere.energy);
            assert!(close(
                slope(|k| energy(widening.rate, k, MODULUS), PAIR.curvature),
                contact.sphere.energy_by_curvature
            ));
            assert!(close(slope(|e| energy(widening.rate, PAIR.curvature, e), MODULUS), contact.energy_by_modulus));
            if widening.rate != 0.0 {
                assert!(close(slope(|k| energy(k, PAIR.curvature, MODULUS), widening.rate), contact.energy_by_rate));
            }
        }
    }

    /// The displacement of a sphere's centre is that of the half-space and `C(a) F`, as long as the radius is the reference's.
    #[test]
    fn at_the_reference_the_regular_part_is_that_of_the_body() {
        let alone = indent_sphere(0.25 * RADIUS, PAIR, MODULUS);
        let area = hertz_area(alone.force, PAIR.effective_radius(), MODULUS);
        let widening = Widening { rate: 0.5 / (MODULUS * RADIUS.powi(3)), reference: area };
        let approach = 0.25 * RADIUS + widening.rate * alone.force * area / 3.0;
        assert!((widening.indent(approach, PAIR, MODULUS, None).sphere.force / alone.force - 1.0).abs() < 1e-12);
    }
}
