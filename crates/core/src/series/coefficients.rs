//! Coefficients of the law of contact (`contact::local::force_series`) from the series of a body under a patch.

use glam::DVec3;

use super::body::SeriesAt;
use crate::contact::SeriesFields;
use crate::contact::regular::HALF_SPACE;
use crate::math::pow;

/// Least part of the compliance at rest that is left where the series ends.
const LEAST_COMPLIANCE: f64 = 0.2;
/// Part of the energy that is left out, over `U_2`, at which the series of a body that softens ends, and that of a body that hardens:
/// its further orders alternate.
const LARGEST_REST: [f64; 2] = [0.02, 0.05];
/// `-e_3/e_2^2` from which the orders four and five count, and from which they count fully.
const HARD: [f64; 2] = [1.0, 2.0];
/// The part of a patch's compliance that is not the half-space's, from which a body counts as one that bends, and fully so.
const BENDS: [f64; 2] = [0.4, 0.8];
/// Displacement of a half-space in the middle of a patch less the weighted mean, times `E* b`.
const MIDDLE: f64 = 16.0 / (5.0 * std::f64::consts::PI) - HALF_SPACE;
/// Largest ratio of displacements of a small contact and of a patch.
const MOST_NARROWED: f64 = 2.0;
/// Steps to the coefficients that match the orders four and five.
const STEPS: usize = 8;

/// Coefficients from a series under a patch that is pressed along `inward`: less the displacements `half_space` (m/N to m/N^4) of
/// the half-space under it, as `U_3 = F^2 b_3 . f`, `U_4 = F^3 b_4 . f` and `U_5 = F^5 beta`. The first is `1/(E* b)`.
pub fn coefficients(at: &SeriesAt, inward: DVec3, half_space: [f64; 4]) -> SeriesFields {
    let [first, q2, q3] = at.displacements;
    let compliance = first.dot(inward);
    let bends = 1.0 - HALF_SPACE * half_space[0] / compliance;
    let [s1, s3] = narrowed(at, inward, half_space[0], bends);
    // As far as these are known from plates.
    let (s4, s5, s6) = (s3 / s1, s3, s3 * s3 / (s1 * s1));
    let compliance = compliance * s1;
    let (q2, q3) = (q2 - inward * half_space[1], (q3 - inward * half_space[2]) * s3);
    let [fourth, fifth, sixth] = at.energies;
    let [fourth, fifth, sixth] = [5.0 * fourth * s4, 6.0 * fifth * s5, 7.0 * sixth * s6];
    let orders = [q2.dot(inward), q3.dot(inward), fourth, fifth, sixth].map(|order| order / compliance);
    let Hardening { bending, hardening, softening, ending } = Hardening::new(orders, bends, half_space[3] / compliance);
    // In powers of y = F - alpha F^2 + .. in place of F.
    let q3 = q3 + q2.dot(inward) * inward * (2.0 * bending);
    // The gradients of both forms at f = F inward are F^2 (b_3 + 2 (b_3 . n) n) and F^3 (b_4 + 3 (b_4 . n) n).
    let cubic = q2 - inward * (2.0 / 3.0 * q2.dot(inward));
    let quartic = q3 - inward * (0.75 * q3.dot(inward));
    // So far of y.
    let ending = if ending > 0.0 { ending / (1.0 + (bending + hardening / ending) / ending) } else { 0.0 };
    let fields = [
        cubic.x,
        cubic.y,
        cubic.z,
        quartic.x,
        quartic.y,
        quartic.z,
        ending,
        hardening,
        bending,
        softening * compliance / 5.0,
    ];
    // A place on a support is not displaced.
    if fields.iter().all(|field| field.is_finite()) { fields } else { SeriesFields::default() }
}

/// Displacements of the first and third order of a small contact over those of the patch, in a body that hardens as it bends: a plate is
/// displaced more under a contact than under a wide patch of the same force. The energy `U_k` is a form of degree `k` in the pressure,
/// and the displacement in the middle has the small contact in place of one of `k` patches: its ratio to the mean counts `k` times. That
/// of the second order, in which a plate becomes thinner, would make plates that are bent by more than their thickness 4 % too soft.
fn narrowed(at: &SeriesAt, inward: DVec3, half_space: f64, bends: f64) -> [f64; 2] {
    let hardens = at.displacements[2].dot(inward) < 0.0;
    let part = if hardens { rise(bends, BENDS) } else { 0.0 };
    let ratio = |k: usize| at.middle[k].dot(inward) / at.displacements[k].dot(inward);
    let own = MIDDLE * half_space / at.displacements[0].dot(inward);
    let ratios = [(ratio(0) - own).powi(2), ratio(2).powi(4)];
    ratios.map(|ratio| if ratio.is_finite() { 1.0 + part * (ratio.clamp(1.0, MOST_NARROWED) - 1.0) } else { 1.0 })
}

/// How a body hardens or softens: `F = y + alpha y^2 + kappa y^3`, where
/// `q/c_1 = y + (e_2 + alpha) y^2 + (e_3 + 2 alpha e_2 + kappa) y^3 + beta_1 y^4`.
struct Hardening {
    /// `alpha`, 1/N.
    bending: f64,
    /// `kappa`, 1/N^2.
    hardening: f64,
    /// `beta_1`, 1/N^3: none in a body that hardens.
    softening: f64,
    /// One over the `y` at which the series ends, 1/N.
    ending: f64,
}

impl Hardening {
    /// Of a body with the displacement `q = c_1 (F + e_2 F^2 + .. + e_6 F^6)`; a half-space's are taken off `e_2` and `e_3`, and `e_4`
    /// has that of `half_space`. `bends` is the part of `c_1` that the half-space lacks.
    fn new(orders: [f64; 5], bends: f64, half_space: f64) -> Self {
        let first = Self::of_three(orders, half_space);
        let [second, third, ..] = orders;
        let part = rise(bends, BENDS) * if third < 0.0 { rise(-third / (second * second), HARD) } else { 0.0 };
        let Some(matched) = Self::of_five(orders).filter(|_| part > 0.0) else { return first };
        let mixed = |of: fn(&Self) -> f64| of(&first) + part * (of(&matched) - of(&first));
        Self {
            bending: mixed(|x| x.bending),
            hardening: mixed(|x| x.hardening),
            softening: mixed(|x| x.softening),
            ending: mixed(|x| x.ending),
        }
    }

    /// `alpha = -share e_2`, and the cubic terms cancel for `kappa = -(e_3 + 2 alpha e_2)`. Both are zero for a body that softens,
    /// `e_3 >= 0`. The share is 1 where `-e_3` is at least `e_2^2`: then the force as a function of the displacement is a cubic
    /// polynomial, `c_1 y = q`. As `kappa >= 2 share e_2^2`, the force always grows with `y`. A body that softens keeps its fourth
    /// order, as far as that is positive: a lobe of the liver that is bent away by a third of its thickness was 14 % too soft without.
    fn of_three([second, third, fourth, fifth, _]: [f64; 5], half_space: f64) -> Self {
        let hardens = (-third).max(0.0);
        let square = second * second;
        let share = if hardens > 0.0 { (hardens / square).min(1.0) } else { 0.0 };
        let (bending, hardening) = (-share * second, hardens + 2.0 * share * square);
        let lacks = fourth + second * (bending * bending + 2.0 * hardening) + 3.0 * bending * third;
        let next = fifth
            + 2.0 * second * bending * hardening
            + 3.0 * third * (bending * bending + hardening)
            + 4.0 * fourth * bending;
        let own = lacks - half_space;
        let softening = (1.0 - share) * own.max(0.0);
        let part = |lacks: f64, order: f64, rest: f64| pow((2.0 * lacks / order).abs() / rest, 1.0 / (order - 2.0));
        let soft = part(own.min(0.0), 5.0, LARGEST_REST[0]).max(part(next, 6.0, LARGEST_REST[0]));
        let hard = part(lacks, 5.0, LARGEST_REST[1]);
        let ending = (soft + share * (hard - soft)).max(softest([2.0 * (1.0 - share) * second, 3.0 * third.max(0.0)]));
        Self { bending, hardening, softening, ending }
    }

    /// The `alpha` and `kappa` that have the orders four and five too: both polynomials in `y` are then of the third degree, as of a
    /// plate that hardens less than the cube of its displacement. None where one of them turns back.
    fn of_five([second, third, fourth, fifth, sixth]: [f64; 5]) -> Option<Self> {
        let (mut bending, mut hardening) = (0.0, 0.0);
        for _ in 0..STEPS {
            hardening = -(3.0 * third * bending * bending + 4.0 * bending * fourth + fifth)
                / (2.0 * second * bending + 3.0 * third);
            bending = -(fourth + second * (2.0 * hardening + bending * bending)) / (3.0 * third);
        }
        let (square, cube) = (second + bending, third + 2.0 * bending * second + hardening);
        let turns = |second: f64, third: f64| third < 0.0 || 3.0 * third < second * second;
        if !(bending.is_finite() && hardening.is_finite()) || turns(bending, hardening) || turns(square, cube) {
            return None;
        }
        let (square, products) = (bending * bending, bending * hardening);
        let lacks = sixth
            + second * hardening * hardening
            + third * (square * bending + 6.0 * products)
            + fourth * (6.0 * square + 4.0 * hardening)
            + 5.0 * bending * fifth;
        let ending = pow((lacks / 3.5).abs() / LARGEST_REST[1], 0.2);
        Some(Self { bending, hardening, softening: 0.0, ending })
    }
}

/// One over the `y` from which the compliance along the force is less than a part of what it was; zero if there is none. The energy
/// is convex up to there. The compliance over that at rest is `1 + s_2 y + s_3 y^2`, times a positive factor in a body that hardens.
fn softest([second, third]: [f64; 2]) -> f64 {
    // In x = 1/y: (1 - part) x^2 + s_2 x + s_3 = 0, its largest root.
    let whole = 1.0 - LEAST_COMPLIANCE;
    let discriminant = second * second - 4.0 * whole * third;
    if discriminant < 0.0 { 0.0 } else { ((discriminant.sqrt() - second) / (2.0 * whole)).max(0.0) }
}

/// From 0 to 1 between two values.
pub(super) fn rise(x: f64, [low, high]: [f64; 2]) -> f64 {
    ((x - low) / (high - low)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::{Hardening, LARGEST_REST, softest};

    #[test]
    fn the_series_ends_where_the_compliance_vanishes() {
        // 1 - 0.4 F reaches 0.2 at F = 2, and 1 - 0.2 F^2 too.
        assert!((softest([-0.4, 0.0]) - 0.5).abs() < 1e-14);
        assert!((softest([0.0, -0.2]) - 0.5).abs() < 1e-14);
        assert_eq!(softest([0.3, 0.0]), 0.0);
    }

    /// Orders two to six of `q/c_1 = y + b y^2 + g y^3` in powers of `F = y + a y^2 + k y^3`, one after another.
    fn orders([b, g, a, k]: [f64; 4]) -> [f64; 5] {
        let product = |x: &[f64; 7], y: &[f64; 7]| -> [f64; 7] {
            std::array::from_fn(|n| (0..=n).map(|i| x[i] * y[n - i]).sum())
        };
        let force = [0.0, 1.0, a, k, 0.0, 0.0, 0.0];
        let mut powers = vec![force];
        for n in 1..6 {
            powers.push(product(&powers[n - 1], &force));
        }
        let mut left = [0.0, 1.0, b, g, 0.0, 0.0, 0.0];
        let mut found = [0.0; 7];
        for n in 1..7 {
            found[n] = left[n];
            let power = powers[n - 1];
            left.iter_mut().zip(power).for_each(|(x, p)| *x -= found[n] * p);
        }
        std::array::from_fn(|n| found[n + 2])
    }

    /// A spring whose force and displacement are polynomials of the third degree is found from five orders, and a cubic spring from
    /// three.
    #[test]
    fn a_spring_is_found_from_its_series() {
        for [b, g, a, k] in [[0.3, 5.0, -0.1, 40.0], [0.1, 0.5, -0.3, 8.0], [0.0, 0.0, -0.2, 3.0]] {
            let found = Hardening::of_five(orders([b, g, a, k])).expect("a spring");
            assert!((found.bending - a).abs() < 1e-6 && (found.hardening / k - 1.0).abs() < 1e-6, "{}", found.bending);
            assert!(found.ending < 0.1 * k.sqrt(), "{}", found.ending);
        }
        let found = Hardening::of_three(orders([0.0, 0.0, -0.3, 5.0]), 0.0);
        assert!((found.bending + 0.3).abs() < 1e-14 && (found.hardening / 5.0 - 1.0).abs() < 1e-14);
        // One that softens stays a series, with its fourth order less that of a half-space.
        let soft = Hardening::new([0.3, 0.5, 0.5, 0.3, 0.0], 1.0, 0.1);
        assert_eq!([soft.bending, soft.hardening, soft.softening], [0.0, 0.0, 0.4]);
        // The part of the energy that is left out is 0.3/3 y^4.
        assert!((soft.ending - (0.1 / LARGEST_REST[0]).powf(0.25)).abs() < 1e-12, "{}", soft.ending);
        // A negative one is left out itself, 0.4/2.5 y^3, and so is all of it in a body that hardens.
        let soft = Hardening::new([0.3, 0.5, -0.4, 0.0, 0.0], 1.0, 0.0);
        assert_eq!(soft.softening, 0.0);
        assert!((soft.ending - (0.16 / LARGEST_REST[0]).cbrt()).abs() < 1e-12, "{}", soft.ending);
        assert_eq!(Hardening::new([0.3, -0.5, 0.4, 0.3, 0.0], 0.0, 0.0).softening, 0.0);
    }
}
