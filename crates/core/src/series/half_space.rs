//! Series of a half-space under the whole patch, which the local contact law represents.

use super::half_space_table::{NEO_HOOKEAN, POLYNOMIAL, RATIOS};
use crate::contact::local::{StrainLaw, interpolate};

/// `h_2`, `h_3` and `h_4` of `q = sum h_n F^n / (E^n b^(2 n - 1))`, the mean displacement along the force.
pub fn half_space_terms(law: &StrainLaw, poisson: f64) -> [f64; 3] {
    let poisson = poisson.clamp(RATIOS[0], RATIOS[RATIOS.len() - 1]);
    let polynomial = |x: f64, y: f64| {
        let [a, b, c, d, e, f, g, h, i, j, k] = interpolate(&RATIOS, poisson, |row| POLYNOMIAL[row]);
        let square = x * x;
        [a + b * x, c + d * x + e * square + f * y, g + h * x + i * square + j * square * x + k * y]
    };
    match *law {
        StrainLaw::Linear => [0.0; 3],
        StrainLaw::NeoHookean => interpolate(&RATIOS, poisson, |i| NEO_HOOKEAN[i]),
        StrainLaw::MooneyRivlin { share } => polynomial(share, 0.0),
        StrainLaw::Yeoh { quadratic, .. } => polynomial(0.0, quadratic),
    }
}
