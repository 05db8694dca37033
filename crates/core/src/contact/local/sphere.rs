//! A rigid sphere on an elastic body with a curved surface, without friction, at any depth.
//!
//! Sneddon (The relation between load and penetration in the axisymmetric Boussinesq problem for a punch of arbitrary
//! profile, 1965): of the gap before loading only `g` counts,
//!
//! ```text
//! d = g(a)      F = 2 E* int_0^a (d - g) ds      dF/dd = 2 E* a      U = int F dd = E* int_0^a (d - g)^2 ds
//! ```
//!
//! The gap is that of the sphere's exact shape and of a surface with the curvature `kappa`. With `x = s/R`, `k = kappa R`:
//!
//! ```text
//! g = R (x artanh x + k x^2)        F = E* R^2 [(1 + x^2) artanh x - x + 4/3 k x^3]        at x = a/R
//! ```
//!
//! A sphere of the effective radius `1/(1/R + kappa)` has the same `x^2` in `g`, as in Hertz's theory, but not the others: one
//! radius deep in a dome of four radii it has 6 % less force, and more in a hollow.
//!
//! `U` is quadratic in `k`: `u = u_0(x) + k u_1(x) + 8/15 k^2 x^5` over `E* R^3`. Up to `x = 3/5` all are power series in
//! `y = x^2`: the closed forms cancel where the contact is shallow. Deeper, the parameter solved for is `t = artanh x`, not `a`:
//! `1 - a/R` falls below round-off at `d = 18 R`.

use crate::math::{atanh, exp, tanh};

/// `y` up to which power series are summed.
const SERIES_UP_TO: f64 = 0.36;
/// Terms of the power series, `0.36^34` is below the precision of a double; and those that suffice up to a smaller `y`.
const TERMS: usize = 34;
const FEW_TERMS: usize = 16;
const FEW_UP_TO: f64 = 0.1;
/// Relative length of the last step for the contact radius, whose square is the error that is left by Newton's method, and whose cube
/// that by Halley's; and most steps.
const SETTLED: f64 = 1e-8;
const SETTLED_BY_HALLEY: f64 = 1e-5;
const MOST_STEPS: usize = 12;
/// Terms of the dilogarithm's series in `exp(-2 t)`, which is at most 1/4 there.
const DILOGARITHM_TERMS: usize = 34;
/// Largest `y` from which a deep contact is solved.
const LARGEST_START: f64 = 0.97;

/// A sphere and the surface below it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereOnSurface {
    /// Radius of the sphere, m.
    pub radius: f64,
    /// Curvature of the surface, 1/m: positive where it is convex, above `-1/radius`.
    pub curvature: f64,
}

impl SphereOnSurface {
    /// A sphere of `radius`, m, on a plane.
    #[cfg(test)]
    pub fn on_plane(radius: f64) -> Self {
        Self { radius, curvature: 0.0 }
    }

    /// Radius of the sphere on a plane that has the same gap near the contact, m.
    pub fn effective_radius(&self) -> f64 {
        1.0 / (1.0 / self.radius + self.curvature)
    }
}

/// State of a sphere pressed into a body.
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
    /// Derivative of the energy by the curvature of the surface at constant approach, J m. With it the force along a surface of
    /// changing curvature follows from the same energy.
    pub energy_by_curvature: f64,
}

/// A sphere that approaches a body of modulus `E*`, Pa, by `approach`, m.
///
/// Nothing touches unless the approach is positive. Relative precision is 1e-12 at any depth.
pub fn indent_sphere(approach: f64, pair: SphereOnSurface, effective_modulus: f64) -> SphereContact {
    if approach.is_nan() || approach <= 0.0 {
        return SphereContact::default();
    }
    let SphereOnSurface { radius, curvature } = pair;
    let (depth, k) = (approach / radius, curvature * radius);
    let Unit { x, force, energy, by_curvature } = match start(depth, k) {
        y if y < SERIES_UP_TO => shallow(depth, k, y),
        y => deep(depth, k, y),
    };
    let scale = effective_modulus * radius;
    let contact_radius = radius * x;
    SphereContact {
        force: scale * radius * force,
        radius: contact_radius,
        stiffness: 2.0 * effective_modulus * contact_radius,
        energy: scale * radius * radius * energy,
        energy_by_curvature: scale * radius.powi(3) * by_curvature,
    }
}

/// The contact of a sphere of radius 1 on a body of modulus 1: `x`, `f`, `u` and `du/dk` at constant depth.
struct Unit {
    x: f64,
    force: f64,
    energy: f64,
    by_curvature: f64,
}

/// `y` from the first two terms of `depth = (1 + k) y + y^2/3 + ..`: too large.
fn start(depth: f64, k: f64) -> f64 {
    let first = 1.0 + k;
    2.0 * depth / (first + (first * first + 4.0 / 3.0 * depth).sqrt())
}

/// Coefficients by powers of `y` of `f/x` for `k = 0`, of `u_0/x`, of `u_1/x`, and of `du/dk / (-4/3 x^3)` for `k = 0`.
const COEFFICIENTS: [[f64; TERMS]; 4] = {
    let mut c = [[0.0; TERMS]; 4];
    // g = sum y^n / (2 n - 1), n from 1.
    let mut p = 1;
    while p < TERMS {
        let n = p as f64;
        c[0][p] = 4.0 * n / ((2.0 * n + 1.0) * (2.0 * n - 1.0));
        // u = int f dg.
        let (mut sum, mut i) = (0.0, 1);
        while i < p {
            let m = (p - i) as f64;
            sum += c[0][i] * 2.0 * m / (2.0 * m - 1.0);
            i += 1;
        }
        c[1][p] = sum / (2.0 * n + 1.0);
        if p > 1 {
            c[2][p] = (8.0 / 3.0 * (n - 1.0) / (2.0 * n - 3.0) + 2.0 * c[0][p - 1]) / (2.0 * n + 1.0);
        }
        c[3][p] = n / ((2.0 * n - 1.0) * (2.0 * n + 3.0));
        p += 1;
    }
    c
};

/// Terms of the gap from `y^3` to `y^8`, over `y^3`, and of its derivative, over `y^2`.
const GAP: [[f64; 2]; 6] = {
    let mut terms = [[0.0; 2]; 6];
    let mut i = 0;
    while i < terms.len() {
        let n = (i + 3) as f64;
        terms[i] = [1.0 / (2.0 * n - 1.0), n / (2.0 * n - 1.0)];
        i += 1;
    }
    terms
};

/// A contact of `x < 3/5`, from a larger `y`: a step of Newton's method with the next terms of the gap, then Halley's method.
fn shallow(depth: f64, k: f64, start: f64) -> Unit {
    let y = start;
    let (mut rest, mut slope) = (0.0, 0.0);
    for [term, by_y] in GAP.iter().rev() {
        (rest, slope) = (rest * y + term, slope * y + by_y);
    }
    let mut x = (y - rest * y * y * y / (1.0 + k + y * (2.0 / 3.0 + slope * y))).sqrt();
    for _ in 0..MOST_STEPS {
        let (t, inverse) = (atanh(x), 1.0 / (1.0 - x * x));
        let residual = x * (t + k * x) - depth;
        let slope = t + x * inverse + 2.0 * k * x;
        let bend = inverse * inverse + k;
        let change = residual / (slope - residual * bend / slope);
        x -= change;
        if change.abs() <= SETTLED_BY_HALLEY * x {
            break;
        }
    }
    let y = x * x;
    // Even and odd powers apart: the additions wait for each other half as long.
    let square = y * y;
    let (mut even, mut odd) = ([0.0; 4], [0.0; 4]);
    let terms = if y < FEW_UP_TO { FEW_TERMS } else { TERMS };
    for p in (0..terms / 2).rev() {
        for of in 0..4 {
            even[of] = even[of] * square + COEFFICIENTS[of][2 * p];
            odd[of] = odd[of] * square + COEFFICIENTS[of][2 * p + 1];
        }
    }
    let [f, u_0, u_1, by_curvature] = std::array::from_fn(|of| even[of] + y * odd[of]);
    Unit {
        x,
        force: x * (f + 4.0 / 3.0 * k * y),
        energy: x * (u_0 + k * (u_1 + 8.0 / 15.0 * k * square)),
        by_curvature: -4.0 / 3.0 * x * y * (by_curvature + 0.2 * k * y),
    }
}

/// A deeper contact, from `y`.
fn deep(depth: f64, k: f64, start: f64) -> Unit {
    // x is nearly 1 where t is large.
    let mut t = atanh(start.min(LARGEST_START).sqrt()).max(depth - k);
    let mut x = tanh(t);
    for _ in 0..MOST_STEPS {
        let slope = 1.0 - x * x;
        let change = (x * (t + k * x) - depth) / (x + (t + 2.0 * k * x) * slope);
        t -= change;
        x = tanh(t);
        if change.abs() <= SETTLED * t {
            break;
        }
    }
    let y = x * x;
    let (force, own) = ((1.0 + y) * t - x, t * x);
    // int_0^x (s artanh s)^2 ds, by parts; the remaining integral is int_0^t s tanh s ds.
    let squares = y * x * t * t / 3.0 + (y * t - (t - x)) / 3.0 - 2.0 / 3.0 * integral_of_t_tanh_t(t);
    // int_0^x s^3 artanh s ds and int_0^x s artanh s ds.
    let (third, first) = (0.25 * ((y * y - 1.0) * t + x + x * y / 3.0), 0.5 * ((y - 1.0) * t + x));
    let [u_0, u_1] =
        [force * own - x * own * own + squares, 4.0 / 3.0 * y * y * t - 2.0 * third + 2.0 * first - 2.0 / 3.0 * x * y];
    let fifth = x * y * y;
    Unit {
        x,
        force: force + 4.0 / 3.0 * k * x * y,
        energy: u_0 + k * (u_1 + 8.0 / 15.0 * k * fifth),
        by_curvature: -2.0 * (depth * x * y / 3.0 - third - 0.2 * k * fifth),
    }
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
    const PLANE: SphereOnSurface = SphereOnSurface { radius: RADIUS, curvature: 0.0 };
    const MODULUS: f64 = 12.5e3;

    /// Hollows that nearly fit the sphere, a plane, and convex surfaces, down to those of a third of its radius.
    fn pairs() -> impl Iterator<Item = SphereOnSurface> {
        [-0.68, -0.2, 0.0, 0.25, 3.0].into_iter().map(|k| SphereOnSurface { curvature: k / RADIUS, ..PLANE })
    }

    /// Depths over the radius from a nanometre's to ten radii.
    fn depths() -> impl Iterator<Item = f64> {
        (0..=400).map(|k| RADIUS * 10f64.powf(-7.0 + 8.0 * k as f64 / 400.0))
    }

    #[test]
    fn shallow_contacts_are_hertz() {
        for d in [1e-9, 1e-8, 1e-7] {
            let contact = indent_sphere(d, PLANE, MODULUS);
            let hertz = 4.0 / 3.0 * MODULUS * RADIUS.sqrt() * d.powf(1.5);
            // The next term of both series is 1/6 and 3/10 of d/R.
            assert!((contact.force / hertz - 1.0).abs() < 0.5 * d / RADIUS + 1e-14);
            assert!((contact.radius / (RADIUS * d).sqrt() - 1.0).abs() < 0.5 * d / RADIUS + 1e-14);
            assert!((contact.energy / (0.4 * hertz * d) - 1.0).abs() < 0.5 * d / RADIUS + 1e-14);
        }
    }

    /// Sneddon's equations, in terms of the radius that was found.
    #[test]
    fn depth_and_force_are_sneddons() {
        for (pair, d) in pairs().flat_map(|pair| depths().map(move |d| (pair, d))) {
            let contact = indent_sphere(d, pair, MODULUS);
            let (x, k) = (contact.radius / RADIUS, pair.curvature * RADIUS);
            if x < 1.0 - 1e-3 {
                assert!(((x * x.atanh() + k * x * x) * RADIUS / d - 1.0).abs() < 1e-12);
            }
            if x > 0.1 && x < 1.0 - 1e-3 {
                let force = MODULUS * RADIUS * RADIUS * ((1.0 + x * x) * x.atanh() - x + 4.0 / 3.0 * k * x.powi(3));
                assert!((contact.force / force - 1.0).abs() < 1e-12, "{d}: {}", contact.force / force - 1.0);
            }
            assert_eq!(contact.stiffness, 2.0 * MODULUS * contact.radius);
        }
    }

    /// Where shallow, a sphere of the effective radius; one radius deep on a dome of four radii that has 6 % less force.
    #[test]
    fn a_curved_surface_counts_by_its_shape_not_by_the_effective_radius() {
        for pair in pairs() {
            let effective = SphereOnSurface { radius: pair.effective_radius(), curvature: 0.0 };
            let ratio = |d| indent_sphere(d, effective, MODULUS).force / indent_sphere(d, pair, MODULUS).force;
            assert!((ratio(1e-7) - 1.0).abs() < 1e-3, "{pair:?}");
            let change = ratio(RADIUS) - 1.0;
            assert!(change * pair.curvature <= 0.0, "{pair:?}");
            if pair.curvature == 25.0 {
                assert!((change + 0.066).abs() < 0.03, "{change}");
            }
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
        for pair in pairs() {
            let (mut energy, mut force, mut before) = (0.0, 0.0, 0.0f64);
            for step in 1..=2000 {
                // With d = s^2 the integrands are smooth at zero.
                let after = (10.0 * RADIUS).sqrt() * step as f64 / 2000.0;
                for (x, w) in NODES {
                    let s = 0.5 * (before + after) + 0.5 * (after - before) * x;
                    let contact = indent_sphere(s * s, pair, MODULUS);
                    let weight = w * s * (after - before);
                    energy += weight * contact.force;
                    force += weight * contact.stiffness;
                }
                before = after;
                let contact = indent_sphere(after * after, pair, MODULUS);
                assert!((contact.energy / energy - 1.0).abs() < 1e-12, "{step}: {}", contact.energy / energy - 1.0);
                assert!((contact.force / force - 1.0).abs() < 1e-12, "{step}: {}", contact.force / force - 1.0);
            }
        }
    }

    #[test]
    fn force_grows_at_every_depth_and_so_does_the_radius() {
        let mut before = SphereContact::default();
        for d in depths() {
            let contact = indent_sphere(d, PLANE, MODULUS);
            assert!(contact.force > before.force && contact.energy > before.energy && contact.radius > before.radius);
            assert!(contact.radius < RADIUS);
            before = contact;
        }
    }

    #[test]
    fn no_step_where_the_series_ends() {
        for pair in pairs() {
            let d = RADIUS * SERIES_UP_TO * (1.0 + pair.curvature * RADIUS + SERIES_UP_TO / 3.0);
            let [below, above] = [d * (1.0 - 1e-14), d * (1.0 + 1e-14)].map(|d| indent_sphere(d, pair, MODULUS));
            for ratio in [
                above.force / below.force,
                above.energy / below.energy,
                above.energy_by_curvature / below.energy_by_curvature,
            ] {
                assert!((ratio - 1.0).abs() < 1e-13, "{ratio}");
            }
        }
    }

    #[test]
    fn energy_changes_with_the_curvature() {
        for (pair, d) in pairs().flat_map(|pair| [1e-5, 1e-3, 4e-3, 3e-2].map(|d| (pair, d))) {
            let at = |curvature| indent_sphere(d, SphereOnSurface { curvature, ..pair }, MODULUS);
            let h = 1e-2;
            let difference = (at(pair.curvature + h).energy - at(pair.curvature - h).energy) / (2.0 * h);
            let computed = at(pair.curvature).energy_by_curvature;
            assert!((difference / computed - 1.0).abs() < 1e-6, "{d}: {difference} {computed}");
        }
    }

    #[test]
    fn nothing_touches_from_outside() {
        for d in [0.0, -1e-3, f64::NEG_INFINITY, f64::NAN] {
            assert_eq!(indent_sphere(d, PLANE, MODULUS), SphereContact::default());
        }
    }
}
