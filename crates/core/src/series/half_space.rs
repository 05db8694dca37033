//! Series of a half-space under the whole patch, which the local contact law represents.

use super::half_space_table::{NEO_HOOKEAN, POLYNOMIAL, RATIOS};
use crate::contact::local::{StrainLaw, interpolate};

/// `h_2` and `h_3` of `q = sum h_n F^n / (E^n b^(2 n - 1))`, the mean displacement along the force.
pub fn half_space_terms(law: &StrainLaw, poisson: f64) -> [f64; 2] {
    let poisson = poisson.clamp(RATIOS[0], RATIOS[RATIOS.len() - 1]);
    let polynomial = |x: f64, y: f64| {
        let [a, b, c, d, e, f] = interpolate(&RATIOS, poisson, |i| POLYNOMIAL[i]);
        [a + b * x, c + d * x + e * x * x + f * y]
    };
    match *law {
        StrainLaw::Linear => [0.0; 2],
        StrainLaw::NeoHookean => interpolate(&RATIOS, poisson, |i| NEO_HOOKEAN[i]),
        StrainLaw::MooneyRivlin { share } => polynomial(share, 0.0),
        StrainLaw::Yeoh { quadratic, .. } => polynomial(0.0, quadratic),
    }
}
