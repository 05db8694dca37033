//! Energy and first Piola stress of hyperelastic materials as power series, for a displacement gradient that is one.
//!
//! With `F = I + sum H_k s^k`, `X = F^-1`, `L = ln det F` and the invariants `I_1 = F : F`, `I_2 = (I_1^2 - C : C)/2` of `C = F^T F`
//! (Bonet and Wood, 2008, chapter 6):
//!
//! ```text
//! neo-Hookean         W = mu (I_1/2 - L) + lambda L^2/2
//!                     P = mu (F - X^T) + lambda L X^T
//! reduced polynomial  W = w(A) + c01 B + K (J - 1)^2/2,    w(A) = c10 A + c20 (A - 3)^2 + c30 (A - 3)^3
//!                     P = w'(A) dA/dF + c01 dB/dF + K (J - 1) J X^T,    A = I_1 J^(-2/3),  B = I_2 J^(-4/3)
//!                     dA/dF = J^(-2/3) (2 F - 2/3 I_1 X^T)
//!                     dB/dF = J^(-4/3) (2 I_1 F - 2 F C - 4/3 I_2 X^T)
//! ```

use glam::DMat3;

use super::truncated::{DEGREE, Matrix, Truncated};
use crate::contact::local::StrainLaw;
use crate::fem::Isotropic;

/// Displacement gradients of orders 1 to 3.
pub type Gradients = [DMat3; DEGREE];

/// A law with its constants, Pa.
enum Constants {
    Linear { lambda: f64, mu: f64 },
    NeoHookean { lambda: f64, mu: f64 },
    Polynomial { polynomial: Polynomial, bulk: f64 },
}

impl Constants {
    fn new(law: &StrainLaw, material: &Isotropic) -> Self {
        let (lambda, mu) = material.lame();
        let (c10, bulk) = (0.5 * mu, lambda + 2.0 / 3.0 * mu);
        let polynomial = match *law {
            StrainLaw::Linear => return Self::Linear { lambda, mu },
            StrainLaw::NeoHookean => return Self::NeoHookean { lambda, mu },
            StrainLaw::MooneyRivlin { share } => {
                Polynomial { c10: c10 * (1.0 - share), c01: c10 * share, c20: 0.0, c30: 0.0 }
            }
            StrainLaw::Yeoh { quadratic, cubic } => {
                Polynomial { c10, c01: 0.0, c20: c10 * quadratic, c30: c10 * cubic }
            }
        };
        Self::Polynomial { polynomial, bulk }
    }
}

/// Coefficients of a polynomial by its first one and those of the gradients.
fn by_order<const N: usize>(constant: DMat3, gradients: &Gradients, of: impl Fn(DMat3) -> DMat3) -> [DMat3; N] {
    std::array::from_fn(|n| if n == 0 { constant } else { gradients.get(n - 1).map_or(DMat3::ZERO, |&h| of(h)) })
}

/// The first `N` coefficients of the stress, Pa, from order 0 on.
pub fn stress<const N: usize>(law: &StrainLaw, material: &Isotropic, gradients: &Gradients) -> [DMat3; N] {
    let deformation = Truncated(by_order(DMat3::IDENTITY, gradients, |h| h));
    match Constants::new(law, material) {
        Constants::Linear { lambda, mu } => {
            let hooke = |h: DMat3| (h + h.transpose()) * mu + DMat3::IDENTITY * (lambda * trace(&h));
            by_order(DMat3::ZERO, gradients, hooke)
        }
        Constants::NeoHookean { lambda, mu } => neo_hookean(&deformation, lambda, mu),
        Constants::Polynomial { polynomial, bulk } => reduced_polynomial(&deformation, &polynomial, bulk),
    }
}

/// The first `N` coefficients of the energy density, Pa, less a constant.
pub fn energy<const N: usize>(law: &StrainLaw, material: &Isotropic, gradients: &Gradients) -> [f64; N] {
    let deformation: Matrix<N> = Truncated(by_order(DMat3::IDENTITY, gradients, |h| h));
    let whole = match Constants::new(law, material) {
        Constants::Linear { lambda, mu } => {
            let strain: Matrix<N> = Truncated(by_order(DMat3::ZERO, gradients, |h| (h + h.transpose()) * 0.5));
            let volume = Truncated(strain.0.map(|strain| trace(&strain)));
            strain.squared().scaled(mu).plus(&volume.times(&volume).scaled(0.5 * lambda))
        }
        Constants::NeoHookean { lambda, mu } => {
            let log = deformation.determinant().logarithm();
            let shear = deformation.squared().scaled(0.5).plus(&log.scaled(-1.0)).scaled(mu);
            shear.plus(&log.times(&log).scaled(0.5 * lambda))
        }
        Constants::Polynomial { polynomial: Polynomial { c10, c01, c20, c30 }, bulk } => {
            let (volume, i1) = (deformation.determinant(), deformation.squared());
            let shrunk = volume.logarithm().scaled(-2.0 / 3.0).exponential();
            let excess = i1.times(&shrunk).shifted(-3.0);
            let slope = excess.scaled(c30).shifted(c20).times(&excess).shifted(c10);
            let mut whole = slope.times(&excess);
            if c01 != 0.0 {
                let cauchy_green = deformation.transposed().times(&deformation);
                let i2 = i1.times(&i1).plus(&cauchy_green.contracted(&cauchy_green).scaled(-1.0)).scaled(0.5);
                whole = whole.plus(&i2.times(&shrunk).times(&shrunk).scaled(c01));
            }
            let grown = volume.shifted(-1.0);
            whole.plus(&grown.times(&grown).scaled(0.5 * bulk))
        }
    };
    whole.0
}

fn trace(matrix: &DMat3) -> f64 {
    matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z
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

    /// The rest of the series is of order 8.
    #[test]
    fn the_energy_is_the_authors() {
        let material = Isotropic::new(3.0, 0.4, 0.0).expect("a material");
        let (yeoh, mooney) = (StrainLaw::Yeoh { quadratic: 0.7, cubic: 0.4 }, StrainLaw::MooneyRivlin { share: 0.3 });
        for law in [StrainLaw::NeoHookean, mooney, yeoh] {
            let series: [f64; 8] = energy(&law, &material, &gradients());
            let rest = |s: f64| {
                let [first, second, third] = gradients();
                let f = DMat3::IDENTITY + (first + (second + third * s) * s) * s;
                let sum: f64 = (1..8).map(|k| series[k] * s.powi(k as i32)).sum();
                (density(&law, &material, &f) - sum).abs()
            };
            let (wide, half) = (rest(0.2), rest(0.1));
            assert!(half > 1e-12 && wide / half > 150.0, "{law:?}: {wide:e} {half:e}");
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
