//! Hyperelastic materials, and the coefficients of their contact at finite strain.

use super::finite_strain::StrainTerms;
use super::strain_table::{FEW_RATIOS, MOONEY_RIVLIN, NEO_HOOKEAN, RATIOS, SHARES, YEOH, YEOH_CUBIC, YEOH_QUADRATIC};

/// Energy density of a material beyond small strain; its constants at small strain are `E` and `nu`. `A = I1 J^(-2/3)` and
/// `B = I2 J^(-4/3)` are the invariants without the change of volume.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum StrainLaw {
    /// Forces in proportion to displacements, as in the paper.
    #[default]
    Linear,
    /// `mu/2 (I1 - 3 - 2 ln J) + lambda/2 (ln J)^2`.
    NeoHookean,
    /// `c10 (A - 3) + c01 (B - 3) + K/2 (J - 1)^2`.
    MooneyRivlin {
        /// `c01 / (c10 + c01)`.
        share: f64,
    },
    /// `c10 (A - 3) + c20 (A - 3)^2 + c30 (A - 3)^3 + K/2 (J - 1)^2`.
    Yeoh {
        /// `c20 / c10`.
        quadratic: f64,
        /// `c30 / c10`.
        cubic: f64,
    },
}

impl StrainLaw {
    /// Whether the coefficients of the material are known, inside the table or near it.
    pub fn is_known(&self, poisson: f64) -> bool {
        let within = |points: &[f64], x: f64| {
            points.first().is_some_and(|&low| low <= x) && points.last().is_some_and(|&high| x <= high)
        };
        // Beyond the largest ratio of the table little changes.
        let few = FEW_RATIOS[0] <= poisson;
        match *self {
            Self::Linear | Self::NeoHookean => true,
            Self::MooneyRivlin { share } => few && within(&SHARES, share),
            Self::Yeoh { quadratic, cubic } => few && within(&YEOH_QUADRATIC, quadratic) && within(&YEOH_CUBIC, cubic),
        }
    }
}

/// Least and largest Poisson's ratio of the table for the neo-Hookean material.
pub const STRAIN_RATIOS: [f64; 2] = [RATIOS[0], RATIOS[RATIOS.len() - 1]];
/// How far the table is extrapolated.
const BEYOND: f64 = 0.1;

/// Coefficients of a material's contact, interpolated in the table by polynomials.
pub fn strain_terms(law: &StrainLaw, poisson: f64) -> StrainTerms {
    let poisson = poisson.max(STRAIN_RATIOS[0] - BEYOND);
    match *law {
        StrainLaw::Linear => [0.0; 3],
        StrainLaw::NeoHookean => interpolate(&RATIOS, poisson, |i| NEO_HOOKEAN[i]),
        StrainLaw::MooneyRivlin { share } => {
            interpolate(&FEW_RATIOS, poisson, |i| interpolate(&SHARES, share, |j| MOONEY_RIVLIN[i][j]))
        }
        StrainLaw::Yeoh { quadratic, cubic } => interpolate(&FEW_RATIOS, poisson, |i| {
            interpolate(&YEOH_QUADRATIC, quadratic, |j| interpolate(&YEOH_CUBIC, cubic, |k| YEOH[i][j][k]))
        }),
    }
}

/// Lagrange's polynomial through the values at the three points closest to `x`, or at two if there are no more.
pub fn interpolate<const N: usize>(points: &[f64], x: f64, value: impl Fn(usize) -> [f64; N]) -> [f64; N] {
    let count = points.len().min(3);
    let next = points.iter().position(|&point| point >= x).unwrap_or(points.len() - 1);
    // Of the two triples around, that with the closer third point.
    let low = next.saturating_sub(1);
    let low = if low > 0 && next + 1 < points.len() && x - points[low - 1] > points[next + 1] - x {
        low
    } else {
        low.saturating_sub(1)
    };
    let low = if next <= 1 { 0 } else { low }.min(points.len() - count);
    let chosen = low..low + count;
    let mut sum = [0.0; N];
    for i in chosen.clone() {
        let weight: f64 =
            chosen.clone().filter(|&j| j != i).map(|j| (x - points[j]) / (points[i] - points[j])).product();
        for (sum, value) in sum.iter_mut().zip(value(i)) {
            *sum += weight * value;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_met_at_its_points_and_between_them() {
        for (i, &nu) in RATIOS.iter().enumerate() {
            let found = strain_terms(&StrainLaw::NeoHookean, nu);
            assert!(found.iter().zip(NEO_HOOKEAN[i]).all(|(a, b)| (a - b).abs() < 1e-12), "{nu}");
        }
        let square = |x: f64| [x * x, 1.0 - x, 2.0];
        for x in [0.0, 0.07, 0.33, 0.39, 0.44, 0.45] {
            let found = interpolate(&RATIOS, x, |i| square(RATIOS[i]));
            assert!(found.iter().zip(square(x)).all(|(a, b)| (a - b).abs() < 1e-12), "{x}");
        }
        assert_eq!(interpolate(&[0.0, 1.0], 0.25, |i| [i as f64, 0.0, 4.0]), [0.25, 0.0, 4.0]);
    }

    #[test]
    fn materials_outside_the_table_are_unknown() {
        assert!(StrainLaw::NeoHookean.is_known(0.499) && StrainLaw::NeoHookean.is_known(-0.1));
        assert!(StrainLaw::Linear.is_known(-0.5));
        assert!(StrainLaw::MooneyRivlin { share: 0.3 }.is_known(0.44));
        assert!(!StrainLaw::MooneyRivlin { share: 1.2 }.is_known(0.44));
        assert!(!StrainLaw::MooneyRivlin { share: 0.3 }.is_known(0.2));
        assert!(StrainLaw::Yeoh { quadratic: 1.0, cubic: 0.2 }.is_known(0.4));
        assert!(!StrainLaw::Yeoh { quadratic: 9.0, cubic: 0.2 }.is_known(0.4));
        assert!(!StrainLaw::Yeoh { quadratic: f64::NAN, cubic: 0.2 }.is_known(0.4));
    }
}
