//! A rigid sphere on an elastic half-space, without friction, at any depth.
//!
//! Sneddon (The relation between load and penetration in the axisymmetric Boussinesq problem for a punch of arbitrary
//! profile, 1965, section 5): with the contact radius `a`, `x = a/R` and `t = artanh x`,
//!
//! ```text
//! d = R x t          F = E* R^2 [(1 + x^2) t - x]          dF/dd = 2 E* a
//! ```
//!
//! Hertz's parabola is the limit of small `x`. With `q = d/R` the energy is
//!
//! ```text
//! U = int F dd = E* R^3 [f q - x q^2 + int_0^x (s artanh s)^2 ds],    f = F/(E* R^2)
//! ```
//!
//! by parts twice, with `df = 2 x dq`. The equation for `t` and the differences in `U` cost time, and cancel where the contact
//! is shallow. There everything is a power series in `q`: `x = sqrt(q) X(q)`, and by integration term by term
//! `f = q^(3/2) F(q)`, `u = q^(5/2) U(q)`. From `dy/dq = 2 y (1 - y)/(q (1 - y) + y)` for `y = x^2` follow the coefficients;
//! the singularity closest to zero is where `sinh 2t = -2t`, at `|q| = 2.4`.
//!
//! Deeper, the parameter solved for is `t`, not `a`: `d = R t tanh t` keeps its relative precision at every depth, while
//! `1 - a/R` falls below round-off at `d = 18 R`.

use crate::math::{exp, tanh};
/// Depth over the sphere's radius below which power series are summed.
const SERIES_BELOW: f64 = 0.5;
/// Terms of the power series: `(0.5/2.4)^24` is below the precision of a double.
const TERMS: usize = 24;
/// Newton's steps for the contact radius. The start is within 4 %, so the fourth is already below round-off.
const MAX_NEWTON_STEPS: usize = 6;
/// Terms of the dilogarithm's series in `exp(-2 t)`, which is at most 1/4 there.
const DILOGARITHM_TERMS: usize = 34;

/// State of a sphere pressed into a half-space.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SphereContact {
    /// Normal force, N.
    pub force: f64,
    /// Contact radius `a`, m.
    pub radius: f64,
    /// `dF/dd = 2 E* a`, N/m.
    pub stiffness: f64,
    /// Stored energy `int F dd`, J.
    pub energy: f64,
    /// Derivative of the energy with respect to the sphere's radius at constant approach, J/m. With it the force along a
    /// surface of changing curvature follows from the same energy.
    pub energy_by_radius: f64,
}

/// A sphere of effective `radius` (m, positive) that approaches a half-space of modulus `E*` (Pa) by `approach` (m).
///
/// Nothing touches unless the approach is positive. Relative precision is 1e-13 at any depth.
pub fn indent_sphere(approach: f64, radius: f64, effective_modulus: f64) -> SphereContact {
    if approach.is_nan() || approach <= 0.0 {
        return SphereContact::default();
    }
    let depth = approach / radius;
    let (x, force, energy) = if depth < SERIES_BELOW { series(depth) } else { closed_form(depth) };
    let scale = effective_modulus * radius;
    let contact_radius = radius * x;
    SphereContact {
        force: scale * radius * force,
        radius: contact_radius,
        stiffness: 2.0 * effective_modulus * contact_radius,
        energy: scale * radius * radius * energy,
        // U = E* R^3 u(d/R) and u' = f.
        energy_by_radius: scale * radius * (3.0 * energy - depth * force),
    }
}

/// Solves `t tanh t = depth` for `t > 0`.
fn parameter(depth: f64) -> f64 {
    // t^2 = depth + depth^2/3 + .. where shallow, depth^2 where deep.
    let mut t = (depth * (1.0 + depth * (1.0 / 3.0 + depth) / (1.0 + depth))).sqrt();
    for _ in 0..MAX_NEWTON_STEPS {
        let x = tanh(t);
        let change = (t * x - depth) / (x + t * (1.0 - x * x));
        t -= change;
        if change.abs() <= 1e-16 * t {
            break;
        }
    }
    t
}

/// Coefficients of `X`, `F` and `U` by powers of the depth.
const COEFFICIENTS: [[f64; TERMS]; 3] = {
    // Of y/q, by (Y + q Y') (1 + Y - q Y) = 2 Y (1 - q Y).
    let mut y = [0.0; TERMS];
    y[0] = 1.0;
    let mut k = 1;
    while k < TERMS {
        // All that does not multiply Y_k; its own factor is (k + 1) 2 + 1 - 2.
        let (mut rest, mut i) = (0.0, 0);
        while i <= k {
            let slope = if i < k { (i + 1) as f64 * y[i] } else { 0.0 };
            let other = if i > 0 && i < k { y[k - i] } else { 0.0 };
            let before = if i < k { y[k - 1 - i] } else { 0.0 };
            rest += slope * (other - before) + if i < k { 2.0 * y[i] * before } else { 0.0 };
            i += 1;
        }
        y[k] = -rest / (2 * k + 1) as f64;
        k += 1;
    }
    let mut c = [[0.0; TERMS]; 3];
    let mut k = 0;
    while k < TERMS {
        // X^2 = Y.
        let (mut rest, mut i) = (y[k], 1);
        while i < k {
            rest -= c[0][i] * c[0][k - i];
            i += 1;
        }
        c[0][k] = if k == 0 { 1.0 } else { 0.5 * rest };
        c[1][k] = 2.0 * c[0][k] / (k as f64 + 1.5);
        c[2][k] = c[1][k] / (k as f64 + 2.5);
        k += 1;
    }
    c
};

/// `x`, `f` and `u` of a shallow contact.
fn series(depth: f64) -> (f64, f64, f64) {
    // Even and odd powers apart: the additions wait for each other half as long.
    let square = depth * depth;
    let (mut even, mut odd) = ([0.0; 3], [0.0; 3]);
    for k in (0..TERMS / 2).rev() {
        for of in 0..3 {
            even[of] = even[of] * square + COEFFICIENTS[of][2 * k];
            odd[of] = odd[of] * square + COEFFICIENTS[of][2 * k + 1];
        }
    }
    let [x, f, u] = std::array::from_fn(|of| even[of] + depth * odd[of]);
    let root = depth.sqrt();
    (root * x, depth * root * f, square * root * u)
}

/// `x`, `f` and `u` of a deep contact.
fn closed_form(depth: f64) -> (f64, f64, f64) {
    let t = parameter(depth);
    let x = tanh(t);
    let y = x * x;
    let force = (1.0 + y) * t - x;
    // int_0^x (s artanh s)^2 ds, by parts; the remaining integral is int_0^t s tanh s ds.
    let rest = y * x * t * t / 3.0 + (y * t - (t - x)) / 3.0 - 2.0 / 3.0 * integral_of_t_tanh_t(t);
    (x, force, force * depth - x * depth * depth + rest)
}

/// `int_0^t s tanh s ds`, from `tanh s = 1 - 2/(exp(2 s) + 1)` and `int_0^inf s/(exp(2 s) + 1) ds = pi^2/48`.
fn integral_of_t_tanh_t(t: f64) -> f64 {
    let factor = -exp(-2.0 * t);
    let (mut power, mut tail) = (-1.0, 0.0);
    for k in 1..=DILOGARITHM_TERMS {
        power *= factor;
        let k = k as f64;
        let term = power * (t / (2.0 * k) + 1.0 / (4.0 * k * k));
        tail += term;
        if term.abs() < 1e-18 {
            break;
        }
    }
    t * t / 2.0 - std::f64::consts::PI * std::f64::consts::PI / 24.0 + 2.0 * tail
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS: f64 = 0.01;
    const MODULUS: f64 = 12.5e3;

    /// Depths over the radius from a nanometre's to ten radii.
    fn depths() -> impl Iterator<Item = f64> {
        (0..=400).map(|k| RADIUS * 10f64.powf(-7.0 + 8.0 * k as f64 / 400.0))
    }

    #[test]
    fn shallow_contacts_are_hertz() {
        for d in [1e-9, 1e-8, 1e-7] {
            let contact = indent_sphere(d, RADIUS, MODULUS);
            let hertz = 4.0 / 3.0 * MODULUS * RADIUS.sqrt() * d.powf(1.5);
            // The next term of both series is 1/6 and 3/10 of d/R.
            assert!((contact.force / hertz - 1.0).abs() < 0.5 * d / RADIUS + 1e-14);
            assert!((contact.radius / (RADIUS * d).sqrt() - 1.0).abs() < 0.5 * d / RADIUS + 1e-14);
            assert!((contact.energy / (0.4 * hertz * d) - 1.0).abs() < 0.5 * d / RADIUS + 1e-14);
        }
    }

    /// Sneddon's equations as printed, in terms of the radius that was found.
    #[test]
    fn depth_and_force_are_sneddons() {
        for d in depths() {
            let contact = indent_sphere(d, RADIUS, MODULUS);
            let x = contact.radius / RADIUS;
            if x < 1.0 - 1e-3 {
                assert!((x * x.atanh() * RADIUS / d - 1.0).abs() < 1e-12);
            }
            if x > 0.1 && x < 1.0 - 1e-3 {
                let force = MODULUS * RADIUS * RADIUS * ((1.0 + x * x) * x.atanh() - x);
                assert!((contact.force / force - 1.0).abs() < 1e-12, "{d}: {}", contact.force / force - 1.0);
            }
            assert_eq!(contact.stiffness, 2.0 * MODULUS * contact.radius);
        }
    }

    /// Gauss quadrature of force and stiffness in steps of the root of the depth.
    #[test]
    fn energy_and_force_are_integrals_to_round_off() {
        const NODES: [(f64, f64); 5] = [
            (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
            (-0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
            (0.0, 0.568_888_888_888_888_9),
            (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
            (0.906_179_845_938_664, 0.236_926_885_056_189_08),
        ];
        let (mut energy, mut force) = (0.0, 0.0);
        let mut before = 0.0f64;
        for step in 1..=2000 {
            // With d = s^2 the integrands are smooth at zero.
            let after = (10.0 * RADIUS).sqrt() * step as f64 / 2000.0;
            for (x, w) in NODES {
                let s = 0.5 * (before + after) + 0.5 * (after - before) * x;
                let contact = indent_sphere(s * s, RADIUS, MODULUS);
                let weight = w * s * (after - before);
                energy += weight * contact.force;
                force += weight * contact.stiffness;
            }
            before = after;
            let contact = indent_sphere(after * after, RADIUS, MODULUS);
            assert!((contact.energy / energy - 1.0).abs() < 1e-12, "{step}: {}", contact.energy / energy - 1.0);
            assert!((contact.force / force - 1.0).abs() < 1e-12, "{step}: {}", contact.force / force - 1.0);
        }
    }

    #[test]
    fn force_grows_at_every_depth_and_so_does_the_radius() {
        let mut before = SphereContact::default();
        for d in depths() {
            let contact = indent_sphere(d, RADIUS, MODULUS);
            assert!(contact.force > before.force && contact.energy > before.energy && contact.radius > before.radius);
            assert!(contact.radius < RADIUS);
            before = contact;
        }
    }

    #[test]
    fn no_step_where_the_series_ends() {
        let d = RADIUS * SERIES_BELOW;
        let [below, above] = [d * (1.0 - 1e-14), d * (1.0 + 1e-14)].map(|d| indent_sphere(d, RADIUS, MODULUS));
        assert!((above.force / below.force - 1.0).abs() < 1e-13);
        assert!((above.energy / below.energy - 1.0).abs() < 1e-13);
    }

    #[test]
    fn energy_changes_with_the_radius_as_said() {
        for d in [1e-5, 1e-3, 4e-3, 3e-2] {
            let at = |radius| indent_sphere(d, radius, MODULUS);
            let h = 1e-4 * RADIUS;
            let difference = (at(RADIUS + h).energy - at(RADIUS - h).energy) / (2.0 * h);
            let computed = at(RADIUS).energy_by_radius;
            assert!((difference / computed - 1.0).abs() < 1e-7, "{d}: {difference} {computed}");
        }
    }

    #[test]
    fn nothing_touches_from_outside() {
        for d in [0.0, -1e-3, f64::NEG_INFINITY, f64::NAN] {
            assert_eq!(indent_sphere(d, RADIUS, MODULUS), SphereContact::default());
        }
    }
}
