//! Higher orders of a body's displacement below a contact, from the Taylor series of its complementary energy.
//!
//! With the pressing force `F = -n . f` (outward normal `n`) of the force `f` on the body,
//!
//! ```text
//! U(f) = F^2 b_3 . f + F^3 b_4 . f + F^5 beta,    u = dU/df
//! ```
//!
//! is added to the linear `f^T C_reg f / 2`. The last term, `beta >= 0`, is of a body that softens, as a lobe that is bent away.
//!
//! A plate that is clamped hardens as it bends: its displacement `q = c_1 F + c_2 F^2 + c_3 F^3` with `c_3 < 0` has a maximum at
//! about one thickness. The force as a function of the displacement, `F = y + alpha y^2 + kappa y^3` of `y = q/c_1`, has none. So in
//! such a body `F^2` and `F^3` are replaced by functions `P_2(F)`, `P_3(F)` whose displacements are powers of `y`,
//! `d(F P_2)/dF = 3 y^2` and `d(F P_3)/dF = 4 y^3`. They are `F^2` and `F^3` for small forces:
//!
//! ```text
//! F P_2 = y^3 + 3/2 alpha y^4 + 9/5 kappa y^5        F P_3 = y^4 + 8/5 alpha y^5 + 2 kappa y^6
//! dP_2/dalpha = -3/2 y^4/F    dP_2/dkappa = -6/5 y^5/F    dP_3/dalpha = -12/5 y^5/F    dP_3/dkappa = -2 y^6/F
//! ```
//!
//! Terms of the second and higher order in the tangential force are left out: without
//! friction it is a small part of the pressing one. Beyond the force `F_e` at which the series ends the powers go on as straight
//! lines, `F^k -> F_e^k + k F_e^(k-1) (F - F_e)`, so that no energy comes from outside the series' range.
//!
//! Where the series is known at a part `p` of the fans only, the others count with zeros: the energy is a mean, of the part `p` of the
//! series and of a body that stays linear. Each ends at its own force, so that `1/F_e` is the mean over the fans with a series.
//!
//! A stiffness `s` times as high has `U_s(f) = s U(f/s)`.

use glam::{DMat3, DVec3};

use crate::contact::smooth::{Blended, FanWeights};
use crate::tensor::outer;

/// Numbers at a fan.
pub const SERIES_FIELDS: usize = 10;
/// `b_3` (m/N^2), `b_4` (m/N^3), `1/F_e` (1/N), `kappa` (1/N^2), `alpha` (1/N) and `beta` (m/N^4) at a fan. All are zero where no series
/// is known.
pub type SeriesFields = [f64; SERIES_FIELDS];
/// Fields of `b_3`, of `b_4` and of `1/F_e`.
const CUBIC: usize = 0;
const QUARTIC: usize = 3;
const ENDING: usize = 6;
const HARDENING: usize = 7;
const BENDING: usize = 8;
const SOFTENING: usize = 9;
/// Newton steps to `y`; four give all digits. None follows one shorter than this part of the force.
const STEPS: usize = 6;
const SETTLED: f64 = 1e-9;

/// Whether a series is known.
pub fn is_known(fields: &SeriesFields) -> bool {
    fields[ENDING] > 0.0
}

/// Fields at a place, and the part of it where they are known.
pub fn blended_series(series: &[SeriesFields], weights: &FanWeights) -> (Blended<SERIES_FIELDS>, f64) {
    let mut blended = weights.blend(series);
    let share = weights.share(|fan| is_known(&series[fan]));
    if share.0 > 0.0 && share.0 < 1.0 {
        blended.divide(ENDING, share);
    }
    (blended, share.0)
}

/// Displacement, energy and their derivatives at one force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HigherOrders {
    /// `u`, m.
    pub displacement: DVec3,
    /// `du/df`, m/N.
    pub compliance: DMat3,
    /// `U`, J.
    pub energy: f64,
    /// Derivative of the energy by the tool's position at constant force, N.
    pub slope: DVec3,
    /// Derivative of the slope by the force, the change of the displacement along the surface: columns by components of the force.
    /// The parts of the turning normal and of a changing `F_e` are left out.
    pub slope_by_force: DMat3,
    /// `F / F_e`.
    pub fraction: f64,
}

impl Default for HigherOrders {
    fn default() -> Self {
        // A matrix is the identity by default.
        Self {
            displacement: DVec3::ZERO,
            compliance: DMat3::ZERO,
            energy: 0.0,
            slope: DVec3::ZERO,
            slope_by_force: DMat3::ZERO,
            fraction: 0.0,
        }
    }
}

impl HigherOrders {
    /// At a force changed by a little: displacement and energy to the first and second order.
    pub fn moved(&self, change: DVec3) -> Self {
        let more = self.compliance * change;
        let displacement = self.displacement + more;
        Self { displacement, energy: self.energy + change.dot(self.displacement + more * 0.5), ..*self }
    }
}

/// A function of the pressing force, with its derivatives by the force, by `F_e`, and by `alpha` and `kappa`.
#[derive(Clone, Copy, Debug)]
struct Power {
    value: f64,
    slope: f64,
    curvature: f64,
    by_ending: f64,
    by_terms: [f64; 2],
    slope_by_terms: [f64; 2],
}

/// `y` of `F = y + alpha y^2 + kappa y^3`, and what both functions of it share.
#[derive(Clone, Copy, Debug)]
struct HardeningSpring {
    inverse_force: f64,
    y: f64,
    /// `alpha y` and `kappa y^2`.
    terms: [f64; 2],
    /// `dy/dF`.
    by_force: f64,
}

impl HardeningSpring {
    fn new(force: f64, [bending, hardening]: [f64; 2]) -> Self {
        let y = hardened(force, [bending, hardening]);
        let terms = [bending * y, hardening * y * y];
        Self { inverse_force: 1.0 / force, y, terms, by_force: 1.0 / (1.0 + 2.0 * terms[0] + 3.0 * terms[1]) }
    }

    /// `P_2`.
    fn square(&self) -> Power {
        self.power(2.0, [1.5, 1.8], self.y)
    }

    /// `P_3`.
    fn cube(&self) -> Power {
        self.power(3.0, [1.6, 2.0], self.y * self.y)
    }

    /// `P_4`.
    fn fourth(&self) -> Power {
        self.power(4.0, [5.0 / 3.0, 15.0 / 7.0], self.y * self.y * self.y)
    }

    /// `P_k` with `F P_k = y^(k+1) (1 + s_1 alpha y + s_2 kappa y^2)` and `d(F P_k)/dF = (k + 1) y^k`; `lower` is `y^(k-1)`.
    fn power(&self, order: f64, shares: [f64; 2], lower: f64) -> Power {
        let Self { inverse_force, y, terms, by_force } = *self;
        let (count, power, square) = (order + 1.0, lower * y, y * y);
        let whole = 1.0 + shares[0] * terms[0] + shares[1] * terms[1];
        // F = y (1 + alpha y + kappa y^2), and F P_k' = (k + 1) y^k - P_k.
        let value = power * whole / (1.0 + terms[0] + terms[1]);
        let slope = (count * power - value) * inverse_force;
        let rise = count * order * lower * by_force;
        // dy/dalpha = -y^2 dy/dF and dy/dkappa = -y^3 dy/dF.
        let moved = [square, square * y];
        let by_terms = [0, 1].map(|k| (shares[k] - count) * power * moved[k] * inverse_force);
        Power {
            value,
            slope,
            curvature: (rise - 2.0 * slope) * inverse_force,
            by_ending: 0.0,
            by_terms,
            slope_by_terms: [0, 1].map(|k| (-rise * moved[k] - by_terms[k]) * inverse_force),
        }
    }
}

impl Power {
    /// The function straight beyond `ending`, where `self` is its value there.
    fn straight_from(self, ending: f64, force: f64) -> Self {
        let beyond = force - ending;
        Self {
            value: self.value + self.slope * beyond,
            curvature: 0.0,
            by_ending: self.curvature * beyond,
            by_terms: [0, 1].map(|k| self.by_terms[k] + self.slope_by_terms[k] * beyond),
            ..self
        }
    }
}

/// `y` of `F = y + alpha y^2 + kappa y^3`, which grows with the force: `3 kappa > alpha^2`.
fn hardened(force: f64, [bending, hardening]: [f64; 2]) -> f64 {
    let bent = 1.0 + hardening * force * force;
    let (half, quarter) = (bent.sqrt(), bent.sqrt().sqrt());
    // Close to F / bent^(1/3) for all forces.
    let mut y = force / (half / (quarter / quarter.sqrt()));
    for _ in 0..STEPS {
        let [second, third] = [bending * y, hardening * y * y];
        let step = (y + second * y + third * y - force) / (1.0 + 2.0 * second + 3.0 * third);
        y -= step;
        // The error is about the square of the relative step.
        if step.abs() < SETTLED * force {
            break;
        }
    }
    y
}

/// Higher orders at the force `force` on a body of outward `normal` (with its derivative `turning` by the tool's position), where the
/// stiffness is `scale` times that of the series.
pub fn higher_orders(
    fields: &Blended<SERIES_FIELDS>,
    (normal, turning): (DVec3, &DMat3),
    force: DVec3,
    scale: f64,
) -> HigherOrders {
    let force = force * (1.0 / scale);
    let pressing = -normal.dot(force);
    let inverse_ending = fields.values[ENDING];
    if !(pressing > 0.0 && inverse_ending > 0.0) {
        return HigherOrders::default();
    }
    let ending = 1.0 / inverse_ending;
    let inward = -normal;
    let harder = [BENDING, HARDENING].map(|field| fields.slope(field));
    let mut found = HigherOrders { fraction: pressing * inverse_ending, ..HigherOrders::default() };
    let within = pressing.min(ending);
    let spring = HardeningSpring::new(within, [BENDING, HARDENING].map(|field| fields.values[field]));
    let (mut by_pressing, mut by_ending) = (0.0, 0.0);
    let mut add = |at_most: Power, b: DVec3, by_component: DMat3| -> Power {
        let power = if pressing > ending { at_most.straight_from(ending, pressing) } else { at_most };
        let Power { value, slope, curvature, by_terms, slope_by_terms, .. } = power;
        let along = b.dot(force);
        found.displacement += inward * (slope * along) + b * value;
        found.compliance += outer(inward, inward) * (curvature * along) + (outer(inward, b) + outer(b, inward)) * slope;
        found.energy += value * along;
        let gradient = by_component * force;
        found.slope += gradient * value + (harder[0] * by_terms[0] + harder[1] * by_terms[1]) * along;
        found.slope_by_force += by_component * value + outer(gradient, inward) * slope;
        for k in 0..2 {
            found.slope_by_force += outer(harder[k], b * by_terms[k] + inward * (slope_by_terms[k] * along));
        }
        by_pressing += slope * along;
        by_ending += power.by_ending * along;
        power
    };
    for (first, power) in [(CUBIC, spring.square()), (QUARTIC, spring.cube())] {
        let b = DVec3::from_slice(&fields.values[first..first + 3]);
        let [x, y, z] = [0, 1, 2].map(|axis| fields.slope(first + axis));
        add(power, b, DMat3::from_cols(x, y, z));
    }
    let softening = fields.values[SOFTENING];
    if softening > 0.0 {
        let power = add(spring.fourth(), inward * softening, outer(fields.slope(SOFTENING), inward));
        // It turns with the normal.
        by_pressing += power.value * softening;
    }
    found.slope -= turning.transpose() * force * by_pressing;
    found.slope -= fields.slope(ENDING) * (by_ending * ending * ending);
    found.compliance *= 1.0 / scale;
    found.energy *= scale;
    found.slope *= scale;
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fields(at: DVec3) -> Blended<SERIES_FIELDS> {
        let slopes: [DVec3; SERIES_FIELDS] =
            std::array::from_fn(|k| DVec3::new(0.2 * k as f64 - 0.5, 0.3, -0.1 * k as f64) * 0.3);
        let start = [0.2, -0.3, 0.5, -0.1, 0.07, 0.11, 0.8, 1.3, -0.4, 0.3];
        let values = std::array::from_fn(|k| start[k] + slopes[k].dot(at));
        Blended::from_parts(values, slopes)
    }

    /// Below and beyond the force at which the series ends.
    #[test]
    fn displacement_and_slope_are_derivatives_of_the_energy() {
        let (place, h) = (DVec3::new(0.02, -0.03, 0.01), 1e-5);
        let turning = DMat3::from_cols(DVec3::new(0.3, 0.1, 0.0), DVec3::new(0.1, -0.2, 0.0), DVec3::ZERO);
        for (force, scale) in [(DVec3::new(0.1, 0.2, -0.6), 1.0), (DVec3::new(0.3, -0.4, -2.6), 0.7)] {
            let at = |moved: DVec3, f: DVec3| {
                // The normal turns with the position; it need not be a unit vector for this.
                higher_orders(&fields(place + moved), (DVec3::Z + turning * moved, &turning), f, scale)
            };
            let here = at(DVec3::ZERO, force);
            assert_eq!(here.fraction > 1.0, scale < 1.0);
            for axis in DVec3::AXES {
                let by_force =
                    (at(DVec3::ZERO, force + axis * h).energy - at(DVec3::ZERO, force - axis * h).energy) / (2.0 * h);
                assert!((by_force - here.displacement.dot(axis)).abs() < 1e-8, "{by_force} {:?}", here.displacement);
                let by_place = (at(axis * h, force).energy - at(-axis * h, force).energy) / (2.0 * h);
                assert!((by_place - here.slope.dot(axis)).abs() < 1e-8, "{by_place} {:?}", here.slope);
                let by_force = (at(DVec3::ZERO, force + axis * h).displacement
                    - at(DVec3::ZERO, force - axis * h).displacement)
                    / (2.0 * h);
                assert!((by_force - here.compliance * axis).length() < 1e-8);
            }
        }
    }

    /// Displacements of a spring `F = y + alpha y^2 + kappa y^3` are those of both functions, which are powers of the force at
    /// small ones.
    #[test]
    fn a_hardening_spring_is_followed() {
        for (terms, force) in [([-0.6, 0.7], 0.02), ([0.5, 0.7], 1.0), ([-1.1, 0.7], 30.0), ([0.0; 2], 2.0)] {
            let [bending, hardening] = terms;
            let spring = HardeningSpring::new(force, terms);
            let y = spring.y;
            assert!((y + bending * y * y + hardening * y.powi(3) - force).abs() < 1e-13 * force, "{force}");
            let [square, cube] = [spring.square(), spring.cube()];
            // y = F - alpha d(F P_2)/dF / 3 - kappa d(F P_3)/dF / 4.
            let [second, third] = [square, cube].map(|power| power.value + force * power.slope);
            assert!((force - bending * second / 3.0 - hardening * third / 4.0 - y).abs() < 1e-13 * force);
            assert!((square.value + force * square.slope - 3.0 * y * y).abs() < 1e-13 * force * force);
            assert!(force > 0.1 || (cube.value / force.powi(3) - 1.0).abs() < 5e-2);
            let h = 1e-6;
            for k in 0..2 {
                let moved = |by: f64| {
                    let mut terms = terms;
                    terms[k] += by;
                    let spring = HardeningSpring::new(force, terms);
                    [spring.square(), spring.cube()]
                };
                for (power, (high, low)) in [square, cube].iter().zip(moved(h).into_iter().zip(moved(-h))) {
                    assert!(((high.value - low.value) / (2.0 * h) - power.by_terms[k]).abs() < 1e-6 * force.powi(3));
                    assert!(
                        ((high.slope - low.slope) / (2.0 * h) - power.slope_by_terms[k]).abs() < 1e-6 * force.powi(2)
                    );
                }
            }
        }
    }

    #[test]
    fn nothing_where_no_series_is_known_and_for_a_force_outwards() {
        let none = Blended::from_parts([0.0; SERIES_FIELDS], [DVec3::ZERO; SERIES_FIELDS]);
        let turning = DMat3::ZERO;
        assert_eq!(higher_orders(&none, (DVec3::Z, &turning), -DVec3::Z, 1.0), HigherOrders::default());
        let outward = higher_orders(&fields(DVec3::ZERO), (DVec3::Z, &turning), DVec3::Z, 1.0);
        assert_eq!(outward, HigherOrders::default());
    }
}
