//! Correction of a sphere's force for finite strain below it.
//!
//! A hyperelastic half-space under a sphere differs from the linear one from small depths on, by a few percent at `d = R/5` and a
//! tenth at `d = R`. The difference of the forces is fitted, for each material, by
//!
//! ```text
//! dF = 4/3 E* R^2 s^3 (q_1 s + q_2 s^2 + q_3 s^3),    s = sqrt(d/R) <= s_max,    E* = E/(1 - nu^2) at small strain
//! dU = int dF dd = 4/3 E* R^3 s^5 (q_1 s/3 + q_2 s^2/3.5 + q_3 s^3/4)
//! ```
//!
//! and continued by its tangent beyond the depths that were computed. A linear material has `q = 0`. Added to Sneddon's law it keeps
//! one energy, and its coefficients blend over a surface of several materials. On a curved surface it is the same: with the effective
//! radius in place of `R` forces on domes and in hollows of four to six radii are farther from full solutions.
//!
//! A pad on the tool takes a share of the approach. With `E*` of both and `w = E*/E_body*` the body's own depth over its effective
//! radius is `w^2 d/R`, and a change of its force by `delta` at its own depth changes the whole by `w delta`: `q_k` of the contact is
//! `w^(k+1)` times that of the body.

use super::sphere::SphereContact;

/// Coefficients `q_1 .. q_3`.
pub type StrainTerms = [f64; 3];

/// Largest `d/R` of the fitted forces.
pub const DEEPEST_FIT: f64 = 1.5;

/// Difference of a sphere's contact from the linear one, to be added to it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StrainCorrection {
    /// N.
    pub force: f64,
    /// N/m.
    pub stiffness: f64,
    /// J.
    pub energy: f64,
    /// The same by each coefficient, J.
    pub energy_by_terms: StrainTerms,
}

/// The correction for a sphere of `radius`, m, that approaches a body of modulus `E*`, Pa, by `approach`, m.
pub fn correct_sphere(approach: f64, radius: f64, effective_modulus: f64, terms: &StrainTerms) -> StrainCorrection {
    if approach.is_nan() || approach <= 0.0 {
        return StrainCorrection::default();
    }
    let depth = approach / radius;
    let within = depth.min(DEEPEST_FIT);
    let beyond = depth - within;
    let s = within.sqrt();
    let (mut force, mut slope, mut energy, mut by_terms) = (0.0, 0.0, 0.0, [0.0; 3]);
    // Of k = 1, 2, 3: `4/3 s^(3+k)` by powers of the depth `s^2`.
    let mut power = 4.0 / 3.0 * within * within;
    for (k, (term, by_term)) in terms.iter().zip(&mut by_terms).enumerate() {
        let exponent = 2.0 + 0.5 * k as f64;
        let by_depth = exponent * power / within;
        *by_term = power * within / (exponent + 1.0) + beyond * (power + 0.5 * beyond * by_depth);
        force += term * (power + beyond * by_depth);
        slope += term * by_depth;
        energy += term * *by_term;
        power *= s;
    }
    let scale = effective_modulus * radius;
    let joules = scale * radius * radius;
    StrainCorrection {
        force: scale * radius * force,
        stiffness: scale * slope,
        energy: joules * energy,
        energy_by_terms: by_terms.map(|by_term| joules * by_term),
    }
}

impl SphereContact {
    /// The contact with a correction.
    pub fn corrected(self, by: &StrainCorrection) -> Self {
        Self {
            force: self.force + by.force,
            stiffness: self.stiffness + by.stiffness,
            energy: self.energy + by.energy,
            ..self
        }
    }
}

/// Coefficients of a contact whose pad takes a part of the approach, and their derivatives by the body's `E/(1 - nu^2)`, 1/Pa;
/// `share` is `w`.
pub fn terms_with_pad(terms: &StrainTerms, share: f64, body_modulus: f64) -> (StrainTerms, StrainTerms) {
    // w = E*/E_b and dE*/dE_b = w^2.
    let share_by_modulus = (share * share - share) / body_modulus;
    let (mut own, mut by_modulus, mut power) = (*terms, [0.0; 3], share);
    for (k, (term, slope)) in own.iter_mut().zip(&mut by_modulus).enumerate() {
        *slope = *term * (k as f64 + 2.0) * power * share_by_modulus;
        power *= share;
        *term *= power;
    }
    (own, by_modulus)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::local::{SphereOnSurface, indent_sphere};

    const TERMS: StrainTerms = [-0.0458, -0.0446, -0.0546];
    const RADIUS: f64 = 0.01;
    const MODULUS: f64 = 12.5e3;

    /// Forces of a neo-Hookean half-space (E = 10 kPa, nu = 0.45) under a sphere of 10 mm, N, by full Newton's method on 9-node
    /// elements (`benches/strain`).
    #[test]
    fn a_neo_hookean_half_space() {
        let terms = crate::contact::local::strain_terms(&crate::contact::local::StrainLaw::NeoHookean, 0.45);
        let modulus = 10e3 / (1.0 - 0.45 * 0.45);
        for (millimetres, newtons) in [(1.0, 0.05193), (2.0, 0.14469), (5.0, 0.54750), (10.0, 1.43029), (15.0, 2.38812)]
        {
            let d: f64 = 1e-3 * millimetres;
            let linear = indent_sphere(d, SphereOnSurface::on_plane(RADIUS), modulus);
            let force = linear.corrected(&correct_sphere(d, RADIUS, modulus, &terms)).force;
            assert!((force / newtons - 1.0).abs() < 4e-3, "{millimetres} mm: {force} N");
            assert!(d < 3e-3 || (linear.force / newtons - 1.0).abs() > 2e-2, "the linear law at {millimetres} mm");
        }
    }

    /// The same at `nu = 0.3` (E = 1 Pa, a sphere of 1 m). The bound is close enough that 5 % of `q_1` shows.
    #[test]
    fn a_compressible_half_space_and_an_error_of_its_first_coefficient() {
        let terms = crate::contact::local::strain_terms(&crate::contact::local::StrainLaw::NeoHookean, 0.3);
        let off = |terms: &StrainTerms| {
            let error = |(d, newtons): (f64, f64)| {
                let modulus = 1.0 / (1.0 - 0.3 * 0.3);
                let force = indent_sphere(d, SphereOnSurface::on_plane(1.0), modulus)
                    .corrected(&correct_sphere(d, 1.0, modulus, terms))
                    .force;
                (force / newtons - 1.0).abs()
            };
            [(0.2, 0.132877), (0.5, 0.514701), (0.8, 1.012844), (1.0, 1.383851)]
                .map(error)
                .into_iter()
                .fold(0.0, f64::max)
        };
        assert!(off(&terms) < 2e-3, "{}", off(&terms));
        for factor in [0.95, 1.05] {
            assert!(off(&[factor * terms[0], terms[1], terms[2]]) > 2.5e-3);
        }
    }

    /// The same of materials between those of the table (E = 1 Pa, nu = 0.4, a sphere of 1 m), which the fit has not seen.
    #[test]
    fn materials_between_those_of_the_table() {
        use crate::contact::local::{StrainLaw, strain_terms};
        let mooney_rivlin = StrainLaw::MooneyRivlin { share: 0.25 };
        let yeoh = StrainLaw::Yeoh { quadratic: 1.0, cubic: 0.5 };
        for (law, forces) in [(mooney_rivlin, [0.26097, 1.30709, 2.67812]), (yeoh, [0.26816, 1.45739, 3.28359])] {
            let terms = strain_terms(&law, 0.4);
            for (d, newtons) in [0.3, 0.9, 1.5].into_iter().zip(forces) {
                let modulus = 1.0 / (1.0 - 0.4 * 0.4);
                let linear = indent_sphere(d, SphereOnSurface::on_plane(1.0), modulus);
                let force = linear.corrected(&correct_sphere(d, 1.0, modulus, &terms)).force;
                assert!((force / newtons - 1.0).abs() < 1.5e-2, "{law:?} {d}: {force} N for {newtons} N");
            }
        }
    }

    #[test]
    fn force_and_stiffness_are_derivatives_of_the_energy() {
        for depth in [1e-4, 2e-3, 1.2e-2, 1.8e-2, 5e-2] {
            let at = |d| correct_sphere(d, RADIUS, MODULUS, &TERMS);
            let (h, here) = (1e-5 * depth, at(depth));
            let [low, high] = [at(depth - h), at(depth + h)];
            assert!(((high.energy - low.energy) / (2.0 * h) / here.force - 1.0).abs() < 1e-7, "{depth}");
            assert!(((high.force - low.force) / (2.0 * h) / here.stiffness - 1.0).abs() < 1e-7, "{depth}");
        }
    }

    #[test]
    fn energy_by_terms_is_what_each_adds() {
        for depth in [2e-3, 1.2e-2, 4e-2] {
            let all = correct_sphere(depth, RADIUS, MODULUS, &TERMS);
            let sum: f64 = all.energy_by_terms.iter().zip(&TERMS).map(|(by_term, term)| by_term * term).sum();
            assert!((sum / all.energy - 1.0).abs() < 1e-14);
        }
    }

    /// The force grows at every depth: a sphere that is pressed deeper never lets go.
    #[test]
    fn the_whole_is_monotonic() {
        let mut before = 0.0;
        for depth in (1..=2000).map(|k| RADIUS * 0.005 * f64::from(k)) {
            let whole = indent_sphere(depth, SphereOnSurface::on_plane(RADIUS), MODULUS)
                .corrected(&correct_sphere(depth, RADIUS, MODULUS, &TERMS));
            assert!(whole.force > before && whole.stiffness > 0.0, "{depth}");
            before = whole.force;
        }
    }

    #[test]
    fn a_soft_pad_takes_the_strain() {
        let (none, by_modulus) = terms_with_pad(&TERMS, 1.0, MODULUS);
        assert_eq!((none, by_modulus), (TERMS, [0.0; 3]));
        let of = |modulus: f64| terms_with_pad(&TERMS, 5e3 / (modulus + 5e3), modulus).0;
        let (half, by_modulus) = terms_with_pad(&TERMS, 0.5, 5e3);
        assert_eq!(half, [0.25 * TERMS[0], 0.125 * TERMS[1], 0.0625 * TERMS[2]]);
        for k in 0..3 {
            let difference = (of(5e3 + 0.1)[k] - of(5e3 - 0.1)[k]) / 0.2;
            assert!((difference / by_modulus[k] - 1.0).abs() < 1e-6);
        }
    }
}
