//! Coefficients of the law of contact (`contact::local::force_series`) from the series of a body under a patch.

use glam::DVec3;

use super::body::SeriesAt;
use crate::contact::SeriesFields;
use crate::math::cbrt;

/// Least part of the compliance at rest that is left where the series ends.
const LEAST_COMPLIANCE: f64 = 0.2;
/// `|U_5| / U_2` at which the series of a body that softens ends, and that of a body that hardens: its further orders alternate.
const LARGEST_REST: [f64; 2] = [0.01, 0.05];

/// Coefficients from a series under a patch that is pressed along `inward`: less the displacements `half_space` (m/N^2, m/N^3) of the
/// half-space under it, as `U_3 = F^2 b_3 . f` and `U_4 = F^3 b_4 . f`.
pub fn coefficients(at: &SeriesAt, inward: DVec3, half_space: [f64; 2]) -> SeriesFields {
    let [first, q2, q3] = at.displacements;
    let q2 = q2 - inward * half_space[0];
    let q3 = q3 - inward * half_space[1];
    let compliance = first.dot(inward);
    let [second, third] = [q2, q3].map(|field| field.dot(inward));
    let Hardening { share, bending, hardening } = Hardening::new(compliance, [second, third]);
    // In powers of y = F - alpha F^2 + .. in place of F.
    let q3 = q3 + inward * (2.0 * bending * second);
    // The gradients of both forms at f = F inward are F^2 (b_3 + 2 (b_3 . n) n) and F^3 (b_4 + 3 (b_4 . n) n).
    let cubic = q2 - inward * (2.0 / 3.0 * q2.dot(inward));
    let quartic = q3 - inward * (0.75 * q3.dot(inward));
    // The displacement of order four that c_1 y + (1 - share) c_2 y^2 lacks.
    let square = bending * bending;
    let fourth = 5.0 * bending * (hardening - square) * compliance;
    let fourth = fourth + (1.0 - share) * second * (5.0 * square - 2.0 * hardening);
    let fifth = at.fifth - 0.2 * fourth;
    let rest = LARGEST_REST[0] + share * (LARGEST_REST[1] - LARGEST_REST[0]);
    let ending = cbrt(fifth.abs() / (0.5 * rest * compliance));
    let ending = ending.max(softest(compliance, [2.0 * second, 3.0 * third], share));
    // So far of y.
    let ending = if ending > 0.0 { ending / (1.0 + (bending + hardening / ending) / ending) } else { 0.0 };
    let fields = [cubic.x, cubic.y, cubic.z, quartic.x, quartic.y, quartic.z, ending, hardening, bending];
    // A place on a support is not displaced.
    if fields.iter().all(|field| field.is_finite()) { fields } else { SeriesFields::default() }
}

/// How a body hardens: `F = y + alpha y^2 + kappa y^3`, where `q = c_1 y + (1 - share) c_2 y^2`.
struct Hardening {
    share: f64,
    /// `alpha`, 1/N.
    bending: f64,
    /// `kappa`, 1/N^2.
    hardening: f64,
}

impl Hardening {
    /// Of the displacement `c_1 F + c_2 F^2 + c_3 F^3`. `alpha = -share c_2/c_1`, and the cubic terms cancel for
    /// `kappa = -(c_3 + 2 alpha c_2)/c_1`. Both are zero for a body that softens, `c_3 >= 0`. The share is 1 where `-c_3/c_1` is at least
    /// `(c_2/c_1)^2`: then the force as a function of the displacement is a cubic polynomial, `c_1 y = q`. As
    /// `kappa >= 2 share (c_2/c_1)^2`, the force always grows with `y`.
    fn new(compliance: f64, [second, third]: [f64; 2]) -> Self {
        let (relative, hardens) = (second / compliance, (-third / compliance).max(0.0));
        let square = relative * relative;
        let share = if hardens > 0.0 { (hardens / square).min(1.0) } else { 0.0 };
        Self { share, bending: -share * relative, hardening: hardens + 2.0 * share * square }
    }
}

/// One over the `y` from which the compliance along the force is less than a part of what it was; zero if there is none. The energy
/// is convex up to there. A body that softens has the compliance `c + s_2 y + s_3 y^2` and `y = F`, one that hardens
/// `c + (1 - share) s_2 y` times a positive factor.
fn softest(compliance: f64, [second, third]: [f64; 2], share: f64) -> f64 {
    // In x = 1/y: (1 - part) c x^2 + s_2 x + s_3 = 0, its largest root.
    let (second, third) = ((1.0 - share) * second, third.max(0.0));
    let whole = (1.0 - LEAST_COMPLIANCE) * compliance;
    let discriminant = second * second - 4.0 * whole * third;
    if discriminant < 0.0 { 0.0 } else { ((discriminant.sqrt() - second) / (2.0 * whole)).max(0.0) }
}

#[cfg(test)]
mod tests {
    use super::{Hardening, softest};

    #[test]
    fn the_series_ends_where_the_compliance_vanishes() {
        // 1 - 0.4 F reaches 0.2 at F = 2, and 1 - 0.2 F^2 too.
        assert!((softest(1.0, [-0.4, 0.0], 0.0) - 0.5).abs() < 1e-14);
        // One that hardens has none, unless the second order softens it.
        assert_eq!(softest(1.0, [0.0, -0.2], 0.0), 0.0);
        assert!((softest(1.0, [-0.4, -0.2], 0.0) - 0.5).abs() < 1e-14);
        assert_eq!(softest(1.0, [0.3, 0.1], 0.0), 0.0);
        // Nor one whose displacement is y itself.
        assert_eq!(softest(1.0, [-0.4, -0.2], 1.0), 0.0);
    }

    /// The displacement of a cubic spring `F = 2 q - 0.3 q^2 + 5 q^3` up to the third order gives the spring.
    #[test]
    fn a_cubic_spring_is_found_from_its_series() {
        let (first, second, third) = (2.0f64, -0.3f64, 5.0f64);
        let compliance = 1.0 / first;
        let q2 = -second * compliance.powi(3);
        let q3 = (2.0 * second * second - first * third) * compliance.powi(5);
        let found = Hardening::new(compliance, [q2, q3]);
        assert_eq!(found.share, 1.0);
        // y = q/c_1.
        assert!((found.bending / (second * compliance * compliance) - 1.0).abs() < 1e-14);
        assert!((found.hardening / (third * compliance.powi(3)) - 1.0).abs() < 1e-14);
        // One that softens stays a series.
        let soft = Hardening::new(compliance, [q2, -q3]);
        assert_eq!([soft.share, soft.bending, soft.hardening], [0.0; 3]);
    }
}
