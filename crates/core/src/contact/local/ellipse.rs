//! A smooth tool on a smooth body, without friction: Hertz's ellipse, with Sneddon's sphere in place of the parabola.
//!
//! The gap of the undeformed surfaces is `(A x^2 + B y^2)/2`. Hertz (Johnson, Contact Mechanics, 1985, section 4.2): with the
//! semi-axes `a >= b`, `g = b/a`, the complete elliptic integrals `K` and `E` of modulus `e = sqrt(1 - g^2)`, and
//! `D = (K - E)/e^2`,
//!
//! ```text
//! B/A = g^2 D/(K - D)          b^2 = 2 d (K - D)/(K A)          F = (2 pi/3) E* a d/K          for A >= B
//! ```
//!
//! `F` is that of a paraboloid of revolution of radius `R = (pi/(2 K))^2 a^2/d`, which does not depend on the depth. The
//! law here is Sneddon's sphere of that radius: Hertz's ellipse where shallow, the sphere's law for `A = B`. Pressure
//! minimises an energy, so `dU/dA = - int p x^2/2 = - F b^2/10` in Hertz's law, from which `dR/dA = - R b^2/(2 d)`, and
//! likewise for `B`.

use std::f64::consts::{FRAC_PI_2, PI};

use super::sphere::indent_sphere;

/// Smallest ratio of the curvatures that is told apart: below twice it the smaller one is bent away from zero, for the
/// contact of a cylinder with a plane has no end. The ellipse is then 350 times longer than wide.
const LEAST_RATIO: f64 = 1e-4;
/// Newton's steps for the ratio of the semi-axes; the start `(B/A)^(2/3)` is within 40 % of the logarithm's change.
const MAX_NEWTON_STEPS: usize = 8;
/// Steps of the arithmetic-geometric mean: its precision doubles with each, from any ratio above [`LEAST_RATIO`].
const MEAN_STEPS: usize = 7;

/// State of a smooth tool pressed into a smooth half-space.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EllipseContact {
    /// Normal force, N.
    pub force: f64,
    /// Radius of the circle of the same stiffness, m: the contact radius of a sphere.
    pub radius: f64,
    /// `dF/dd = 2 E* radius`, N/m.
    pub stiffness: f64,
    /// Stored energy `int F dd`, J.
    pub energy: f64,
    /// Half the length of the contact along the direction of each curvature, m.
    pub semi_axes: [f64; 2],
    /// Derivative of the energy with respect to each curvature at constant approach, J m.
    pub energy_by_curvature: [f64; 2],
}

/// A tool that approaches a half-space of modulus `E*` (Pa) by `approach` (m), where the principal curvatures of tool and
/// body relative to each other are `curvatures` (1/m, in any order; positive where the surfaces part).
///
/// Nothing touches unless the approach is positive, and the larger curvature: a place that is hollower than the tool in
/// both directions is none that a single ellipse describes.
pub fn indent_ellipse(approach: f64, curvatures: [f64; 2], effective_modulus: f64) -> EllipseContact {
    let (large, small) = if curvatures[0] >= curvatures[1] { (0, 1) } else { (1, 0) };
    if !(approach > 0.0 && curvatures[large] > 0.0) {
        return EllipseContact::default();
    }
    let (ratio, slope) = bent_ratio(curvatures[small] / curvatures[large]);
    let paraboloid = Paraboloid::new(curvatures[large], ratio);
    let sphere = indent_sphere(approach, paraboloid.radius, effective_modulus);
    let by_large = -0.5 * sphere.energy_by_radius * paraboloid.radius * paraboloid.short;
    let by_small = -0.5 * sphere.energy_by_radius * paraboloid.radius * paraboloid.long;
    let mut contact = EllipseContact {
        force: sphere.force,
        radius: sphere.radius,
        stiffness: sphere.stiffness,
        energy: sphere.energy,
        ..Default::default()
    };
    contact.semi_axes[large] = sphere.radius * (paraboloid.short / paraboloid.radius).sqrt();
    contact.semi_axes[small] = sphere.radius * (paraboloid.long / paraboloid.radius).sqrt();
    // The smaller curvature is the larger one times the bent ratio.
    contact.energy_by_curvature[small] = by_small * slope;
    contact.energy_by_curvature[large] = by_large + by_small * (ratio - slope * curvatures[small] / curvatures[large]);
    contact
}

/// A ratio that stays positive, and its derivative; continuous with it.
fn bent_ratio(ratio: f64) -> (f64, f64) {
    if ratio >= 2.0 * LEAST_RATIO {
        (ratio, 1.0)
    } else if ratio > 0.0 {
        (LEAST_RATIO + ratio * ratio / (4.0 * LEAST_RATIO), ratio / (2.0 * LEAST_RATIO))
    } else {
        (LEAST_RATIO, 0.0)
    }
}

/// Hertz's contact at unit depth: lengths in m.
struct Paraboloid {
    /// Radius of the paraboloid of revolution with the same force.
    radius: f64,
    /// Squares of the semi-axes over the depth, across and along the direction of the smaller curvature.
    short: f64,
    long: f64,
}

impl Paraboloid {
    /// From the larger curvature and the ratio of the smaller to it.
    fn new(curvature: f64, ratio: f64) -> Self {
        let mut g = ratio.powf(2.0 / 3.0);
        let mut integrals = Integrals::new(g);
        for _ in 0..MAX_NEWTON_STEPS {
            let miss = (integrals.ratio(g) / ratio).ln();
            g = (g * (-miss / integrals.slope(g)).exp()).min(1.0);
            integrals = Integrals::new(g);
            if miss.abs() < 1e-15 {
                break;
            }
        }
        let Integrals { k, d } = integrals;
        let short = 2.0 * (k - d) / (k * curvature);
        let long = short / (g * g);
        Self { radius: (FRAC_PI_2 / k).powi(2) * long, short, long }
    }
}

/// Complete elliptic integrals of modulus `sqrt(1 - g^2)`: `K` and `D = (K - E)/(1 - g^2)`.
struct Integrals {
    k: f64,
    d: f64,
}

impl Integrals {
    /// By the arithmetic-geometric mean (Abramowitz and Stegun, 17.6): `K - E = K sum 2^(n-1) c_n^2`, here divided by
    /// `c_0^2 = 1 - g^2` term by term, so that nothing cancels where the ellipse is nearly a circle.
    fn new(g: f64) -> Self {
        let (mut a, mut b) = (0.5 * (1.0 + g), g.sqrt());
        let mut c = 0.5 * (1.0 - g);
        let mut c_over_squared_modulus = 0.5 / (1.0 + g);
        let (mut sum, mut power) = (0.5, 1.0);
        for _ in 0..MEAN_STEPS {
            sum += power * c * c_over_squared_modulus;
            power *= 2.0;
            let mean = 0.5 * (a + b);
            b = (a * b).sqrt();
            a = mean;
            let ratio = c / (4.0 * a);
            c_over_squared_modulus *= ratio;
            c *= ratio;
        }
        let k = PI / (2.0 * a);
        Self { k, d: k * sum }
    }

    /// Ratio of the curvatures.
    fn ratio(&self, g: f64) -> f64 {
        g * g * self.d / (self.k - self.d)
    }

    /// Derivative of the ratio's logarithm with respect to that of `g`, from `dK/dg = -(K - D)/g` and
    /// `dD/dg = -((K - D)/g^2 - D) g/(1 - g^2)`.
    fn slope(&self, g: f64) -> f64 {
        let squared_modulus = 1.0 - g * g;
        // Limit of a circle; the difference above is lost in round-off there.
        if squared_modulus < 1e-6 {
            return 1.5;
        }
        let other = self.k - self.d;
        let d_by_g = -(other / (g * g) - self.d) * g / squared_modulus;
        let other_by_g = -other / g - d_by_g;
        2.0 + g * (d_by_g / self.d - other_by_g / other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MODULUS: f64 = 12.5e3;

    /// `K` and `E` by the trapezoidal rule over a period, which converges faster than any power.
    fn integrals_by_quadrature(g: f64) -> (f64, f64) {
        let n = 20_000;
        let (mut k, mut e) = (0.0, 0.0);
        for i in 0..n {
            let (s, c) = (PI * i as f64 / n as f64).sin_cos();
            let root = (c * c + g * g * s * s).sqrt();
            k += 1.0 / root;
            e += root;
        }
        (k * FRAC_PI_2 / n as f64, e * FRAC_PI_2 / n as f64)
    }

    #[test]
    fn elliptic_integrals_are_those_of_quadrature() {
        for g in [1.0, 0.999_999, 0.9, 0.5, 0.1, 0.01, 0.003] {
            let (k, e) = integrals_by_quadrature(g);
            let told = Integrals::new(g);
            assert!((told.k / k - 1.0).abs() < 1e-12, "{g}");
            if g < 0.99 {
                assert!((told.d * (1.0 - g * g) / (k - e) - 1.0).abs() < 1e-12, "{g}");
            }
        }
    }

    /// Hertz's equations as Johnson prints them (4.26 to 4.28), solved for the curvatures from a chosen ellipse.
    #[test]
    fn shallow_contacts_are_hertz_ellipses() {
        for g in [0.999, 0.8, 0.5, 0.2, 0.05, 0.01] {
            let (k, e) = integrals_by_quadrature(g);
            let (a, squared_modulus) = (1e-4, 1.0 - g * g);
            let (b, pressure) = (g * a, 10.0);
            let small = 2.0 * pressure / MODULUS * b / (squared_modulus * a * a) * (k - e);
            let large = 2.0 * pressure / MODULUS * b / (squared_modulus * a * a) * (e / (g * g) - k);
            let depth = pressure * b * k / MODULUS;
            let force = 2.0 / 3.0 * PI * a * b * pressure;
            let contact = indent_ellipse(depth, [small, large], MODULUS);
            // Sneddon's sphere is a fraction d/R away from Hertz.
            let allowed = 2e-9 + depth * large;
            assert!((contact.semi_axes[0] / a - 1.0).abs() < allowed, "{g}: {:?}", contact.semi_axes);
            assert!((contact.semi_axes[1] / b - 1.0).abs() < allowed, "{g}: {:?}", contact.semi_axes);
            assert!((contact.force / force - 1.0).abs() < allowed, "{g}");
            assert!((contact.energy / (0.4 * force * depth) - 1.0).abs() < allowed, "{g}");
            assert!((contact.stiffness / (1.5 * force / depth) - 1.0).abs() < allowed, "{g}");
        }
    }

    #[test]
    fn equal_curvatures_are_a_sphere() {
        for d in [1e-5, 1e-3, 5e-3] {
            let (ellipse, sphere) = (indent_ellipse(d, [100.0, 100.0], MODULUS), indent_sphere(d, 0.01, MODULUS));
            assert!((ellipse.force / sphere.force - 1.0).abs() < 1e-14);
            assert!((ellipse.energy / sphere.energy - 1.0).abs() < 1e-14);
            assert!((ellipse.semi_axes[0] / sphere.radius - 1.0).abs() < 1e-14);
            assert!((ellipse.semi_axes[1] / sphere.radius - 1.0).abs() < 1e-14);
            // Both curvatures together make 1/R.
            let by_radius = -(ellipse.energy_by_curvature[0] + ellipse.energy_by_curvature[1]) / (0.01 * 0.01);
            assert!((by_radius / sphere.energy_by_radius - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn derivatives_are_those_of_the_energy() {
        let pairs = [[100.0, 100.0], [100.0, 99.9], [20.0, 130.0], [300.0, 3.0], [100.0, 0.015], [100.0, -20.0]];
        for curvatures in pairs {
            for d in [1e-4, 2e-3] {
                let contact = indent_ellipse(d, curvatures, MODULUS);
                let h = 1e-5 * d;
                let [above, below] = [d + h, d - h].map(|d| indent_ellipse(d, curvatures, MODULUS));
                let force = (above.energy - below.energy) / (2.0 * h);
                let stiffness = (above.force - below.force) / (2.0 * h);
                assert!((force / contact.force - 1.0).abs() < 1e-8, "{curvatures:?}");
                assert!((stiffness / contact.stiffness - 1.0).abs() < 1e-8, "{curvatures:?}");
                for k in 0..2 {
                    let h = 1e-5 * curvatures[k].abs();
                    let moved = |by: f64| {
                        let mut moved = curvatures;
                        moved[k] += by;
                        indent_ellipse(d, moved, MODULUS).energy
                    };
                    let difference = (moved(h) - moved(-h)) / (2.0 * h);
                    let error = (difference - contact.energy_by_curvature[k]).abs();
                    assert!(error < 1e-7 * contact.energy_by_curvature[k].abs() + 1e-10 * contact.energy / 1e-4);
                }
            }
        }
    }

    /// A change of the curvatures by a part in 1e12 changes nothing by more than that: no step at a circle, nor at the
    /// least ratio.
    #[test]
    fn smooth_where_formulae_change() {
        for edge in [100.0, 100.0 * (1.0 - 5e-7), 200.0 * LEAST_RATIO, 0.0] {
            let of = |small: f64| indent_ellipse(1e-3, [100.0, small], MODULUS);
            let (below, above) = (of(edge - 1e-10), of(edge + 1e-10));
            assert!((above.force / below.force - 1.0).abs() < 1e-8);
            for k in 0..2 {
                let change = (above.energy_by_curvature[k] - below.energy_by_curvature[k]).abs();
                assert!(change < 1e-4 * below.energy_by_curvature[0].abs().max(below.energy_by_curvature[1].abs()));
            }
        }
    }

    #[test]
    fn nothing_touches_from_outside_or_in_a_hollow() {
        assert_eq!(indent_ellipse(0.0, [100.0, 50.0], MODULUS), EllipseContact::default());
        assert_eq!(indent_ellipse(f64::NAN, [100.0, 50.0], MODULUS), EllipseContact::default());
        assert_eq!(indent_ellipse(1e-3, [-1.0, -2.0], MODULUS), EllipseContact::default());
    }
}
