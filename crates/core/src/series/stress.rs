//! First Piola stress of hyperelastic materials as a power series, for a displacement gradient that is one.
//!
//! With `F = I + sum H_k s^k`, `X = F^-1`, `L = ln det F` and the invariants `I_1 = F : F`, `I_2 = (I_1^2 - C : C)/2` of `C = F^T F`
//! (Bonet and Wood, 2008, chapter 6):
//!
//! ```text
//! neo-Hookean         P = mu (F - X^T) + lambda L X^T
//! reduced polynomial  P = w'(A) dA/dF + c01 dB/dF + K (J - 1) J X^T,    A = I_1 J^(-2/3),  B = I_2 J^(-4/3)
//!                     dA/dF = J^(-2/3) (2 F - 2/3 I_1 X^T)
//!                     dB/dF = J^(-4/3) (2 I_1 F - 2 F C - 4/3 I_2 X^T)
//! ```

use glam::DMat3;

use super::truncated::{DEGREE, Matrix, Truncated};
use crate::contact::local::StrainLaw;
use crate::fem::Isotropic;

/// Displacement gradients of orders 1 to 3.
pub type Gradients = [DMat3; DEGREE];

/// The first `N` coefficients of the stress, Pa, from order 0 on.
pub fn stress<const N: usize>(law: &StrainLaw, material: &Isotropic, gradients: &Gradients) -> [DMat3; N] {
    let by_order = |constant: DMat3, of: &dyn Fn(DMat3) -> DMat3| {
        std::array::from_fn(|n| if n == 0 { constant } else { gradients.get(n - 1).map_or(DMat3::ZERO, |&h| of(h)) })
    };
    let deformation = Truncated(by_order(DMat3::IDENTITY, &|h| h));
    let (lambda, mu) = material.lame();
    match *law {
        StrainLaw::Linear => {
            let hooke = |h: DMat3| {
                let strain = (h + h.transpose()) * 0.5;
                strain * (2.0 * mu) + DMat3::IDENTITY * (lambda * (h.x_axis.x + h.y_axis.y + h.z_axis.z))
            };
            by_order(DMat3::ZERO, &hooke)
        }
        StrainLaw::NeoHookean => neo_hookean(&deformation, lambda, mu),
        StrainLaw::MooneyRivlin { share } => {
            let polynomial = Polynomial { c10: 0.5 * mu * (1.0 - share), c01: 0.5 * mu * share, c20: 0.0, c30: 0.0 };
            reduced_polynomial(&deformation, &polynomial, bulk(lambda, mu))
        }
        StrainLaw::Yeoh { quadratic, cubic } => {
            let c10 = 0.5 * mu;
            let polynomial = Polynomial { c10, c01: 0.0, c20: c10 * quadratic, c30: c10 * cubic };
            reduced_polynomial(&deformation, &polynomial, bulk(lambda, mu))
        }
    }
}

fn bulk(lambda: f64, mu: f64) -> f64 {
    lambda + 2.0 / 3.0 * mu
}

fn neo_hookean<const N: usize>(deformation: &Matrix<N>, lambda: f64, mu: f64) -> [DMat3; N] {
    let inverse = deformation.inverse();
    let log = deformation.log_determinant(&inverse);
    let against = inverse.transposed();
    let pressed = against.times(&log).scaled(lambda);
    deformation.plus(&against.scaled(-1.0)).scaled(mu).plus(&pressed).0
}

/// Constants of the reduced polynomial, Pa.
struct Polynomial {
    c10: f64,
    c01: f64,
    c20: f64,
    c30: f64,
}

fn reduced_polynomial<const N: usize>(deformation: &Matrix<N>, constants: &Polynomial, bulk: f64) -> [DMat3; N] {
    let inverse = deformation.inverse();
    let log = deformation.log_determinant(&inverse);
    let against = inverse.transposed();
    let (cauchy_green, i1) = (deformation.transposed().times(deformation), deformation.contracted(deformation));
    let shrunk = log.scaled(-2.0 / 3.0).exponential();
    let by_f = deformation.scaled(2.0).plus(&against.times(&i1).scaled(-2.0 / 3.0)).times(&shrunk);
    let excess = i1.times(&shrunk).shifted(-3.0);
    let quadratic = excess.times(&excess).scaled(3.0 * constants.c30);
    let slope = excess.scaled(2.0 * constants.c20).plus(&quadratic).shifted(constants.c10);
    let mut whole = by_f.times(&slope);
    if constants.c01 != 0.0 {
        let i2 = i1.times(&i1).plus(&cauchy_green.contracted(&cauchy_green).scaled(-1.0)).scaled(0.5);
        let second = deformation.times(&i1).scaled(2.0);
        let second = second.plus(&deformation.times(&cauchy_green).scaled(-2.0));
        let second = second.plus(&against.times(&i2).scaled(-4.0 / 3.0));
        whole = whole.plus(&second.times(&shrunk.times(&shrunk)).scaled(constants.c01));
    }
    let volume = log.exponential();
    let pressure = volume.shifted(-1.0).times(&volume).scaled(bulk);
    whole.plus(&against.times(&pressure)).0
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn gradients() -> Gradients {
        let column = |a: f64| DVec3::new(0.3 + a, -0.2 * a, 0.15 - a);
        let matrix = |a: f64| DMat3::from_cols(column(a), column(0.4 * a), column(-0.7 * a + 0.1));
        [matrix(0.5), matrix(-0.3), matrix(0.2)]
    }

    /// Energy density as the authors print it, Pa.
    fn density(law: &StrainLaw, material: &Isotropic, f: &DMat3) -> f64 {
        let (lambda, mu) = material.lame();
        let (j, c) = (f.determinant(), f.transpose() * *f);
        let i1 = c.x_axis.x + c.y_axis.y + c.z_axis.z;
        let i2 = 0.5 * (i1 * i1 - super::super::truncated::contraction(&c, &c));
        let (a, b) = (i1 * j.powf(-2.0 / 3.0) - 3.0, i2 * j.powf(-4.0 / 3.0) - 3.0);
        let volumetric = 0.5 * (lambda + 2.0 / 3.0 * mu) * (j - 1.0) * (j - 1.0);
        match *law {
            StrainLaw::Linear => unreachable!("has no density of finite strain"),
            StrainLaw::NeoHookean => 0.5 * mu * (i1 - 3.0 - 2.0 * j.ln()) + 0.5 * lambda * j.ln() * j.ln(),
            StrainLaw::MooneyRivlin { share } => 0.5 * mu * ((1.0 - share) * a + share * b) + volumetric,
            StrainLaw::Yeoh { quadratic, cubic } => 0.5 * mu * (a + quadratic * a * a + cubic * a * a * a) + volumetric,
        }
    }

    /// The stress by differences of the energy density; the rest of the series is of order 5.
    #[test]
    fn the_series_is_that_of_the_derivative_of_the_energy() {
        let material = Isotropic::new(3.0, 0.4, 0.0).expect("a material");
        let (yeoh, mooney) = (StrainLaw::Yeoh { quadratic: 0.7, cubic: 0.4 }, StrainLaw::MooneyRivlin { share: 0.3 });
        for law in [StrainLaw::NeoHookean, mooney, yeoh] {
            let series: [DMat3; 5] = stress(&law, &material, &gradients());
            let rest = |s: f64| {
                let [first, second, third] = gradients();
                let f = DMat3::IDENTITY + (first + (second + third * s) * s) * s;
                let sum: DMat3 = series.iter().enumerate().map(|(k, &p)| p * s.powi(k as i32)).sum();
                let (mut most, h) = (0.0f64, 1e-5);
                for (row, column) in (0..9).map(|k| (k / 3, k % 3)) {
                    let moved = |by: f64| {
                        let mut g = f;
                        g.col_mut(column)[row] += by;
                        density(&law, &material, &g)
                    };
                    let difference = (moved(h) - moved(-h)) / (2.0 * h);
                    most = most.max((difference - sum.col(column)[row]).abs());
                }
                most
            };
            let (wide, half) = (rest(0.2), rest(0.1));
            assert!(half > 1e-8 && wide / half > 20.0, "{law:?}: {wide:e} {half:e}");
        }
    }

    #[test]
    fn the_first_order_is_hookes_law() {
        let material = Isotropic::new(3.0, 0.4, 0.0).expect("a material");
        let linear = stress::<2>(&StrainLaw::Linear, &material, &gradients())[1];
        let (yeoh, mooney) = (StrainLaw::Yeoh { quadratic: 0.7, cubic: 0.4 }, StrainLaw::MooneyRivlin { share: 0.3 });
        for law in [StrainLaw::NeoHookean, mooney, yeoh] {
            let first: [DMat3; 2] = stress(&law, &material, &gradients());
            assert!((first[1] - linear).abs_diff_eq(DMat3::ZERO, 1e-14) && first[0].abs_diff_eq(DMat3::ZERO, 1e-14));
        }
    }
}
