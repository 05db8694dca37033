//! Higher orders of a body's displacement below a contact, from the Taylor series of its complementary energy.
//!
//! With the pressing force `F = -n . f` (outward normal `n`) of the force `f` on the body,
//!
//! ```text
//! U(f) = F^2 b_3 . f + F^3 b_4 . f,    u = dU/df
//! ```
//!
//! is added to the linear `f^T C_reg f / 2`. Terms of the second and higher order in the tangential force are left out: without
//! friction it is a small part of the pressing one. Beyond the force `F_e` at which the series ends the powers go on as straight
//! lines, `F^k -> F_e^k + k F_e^(k-1) (F - F_e)`, so that no energy comes from outside the series' range.
//!
//! A stiffness `s` times as high has `U_s(f) = s U(f/s)`.

use glam::{DMat3, DVec3};

use crate::contact::smooth::Blended;
use crate::tensor::outer;

/// Numbers at a fan.
pub const SERIES_FIELDS: usize = 7;
/// `b_3` (m/N^2), `b_4` (m/N^3) and `1/F_e` (1/N) at a fan. All are zero where no series is known.
pub type SeriesFields = [f64; SERIES_FIELDS];
/// Fields of `b_3`, of `b_4` and of `1/F_e`.
const CUBIC: usize = 0;
const QUARTIC: usize = 3;
const ENDING: usize = 6;

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

/// `F^k`, straight beyond `F_e`: value, first and second derivative by `F`, derivative by `F_e`.
fn power(k: i32, force: f64, ending: f64) -> [f64; 4] {
    let degree = f64::from(k);
    let at = |base: f64| {
        let low = base.powi(k - 2);
        [low * base * base, degree * low * base, degree * (degree - 1.0) * low]
    };
    if force <= ending {
        let [value, slope, curvature] = at(force);
        return [value, slope, curvature, 0.0];
    }
    let [value, slope, curvature] = at(ending);
    [value + slope * (force - ending), slope, 0.0, curvature * (force - ending)]
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
    let mut found = HigherOrders { fraction: pressing * inverse_ending, ..HigherOrders::default() };
    let (mut by_pressing, mut by_ending) = (0.0, 0.0);
    for (first, degree) in [(CUBIC, 2), (QUARTIC, 3)] {
        let b = DVec3::from_slice(&fields.values[first..first + 3]);
        let [value, slope, curvature, of_ending] = power(degree, pressing, ending);
        let along = b.dot(force);
        found.displacement += inward * (slope * along) + b * value;
        found.compliance += outer(inward, inward) * (curvature * along) + (outer(inward, b) + outer(b, inward)) * slope;
        found.energy += value * along;
        let gradient: DVec3 = (0..3).map(|axis| fields.slope(first + axis) * force[axis]).sum();
        found.slope += gradient * value;
        let by_component = DMat3::from_cols(fields.slope(first), fields.slope(first + 1), fields.slope(first + 2));
        found.slope_by_force += by_component * value + outer(gradient, inward) * slope;
        by_pressing += slope * along;
        by_ending += of_ending * along;
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
        let start = [0.2, -0.3, 0.5, -0.1, 0.07, 0.11, 0.8];
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

    #[test]
    fn nothing_where_no_series_is_known_and_for_a_force_outwards() {
        let none = Blended::from_parts([0.0; SERIES_FIELDS], [DVec3::ZERO; SERIES_FIELDS]);
        let turning = DMat3::ZERO;
        assert_eq!(higher_orders(&none, (DVec3::Z, &turning), -DVec3::Z, 1.0), HigherOrders::default());
        let outward = higher_orders(&fields(DVec3::ZERO), (DVec3::Z, &turning), DVec3::Z, 1.0);
        assert_eq!(outward, HigherOrders::default());
    }
}
