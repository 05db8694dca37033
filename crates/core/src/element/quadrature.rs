//! Rules of quadrature on the reference tetrahedron, all with positive weights that sum to its volume 1/6.

use std::sync::LazyLock;

use glam::DVec3;

/// A place in the reference tetrahedron and the volume it stands for.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Reference coordinates.
    pub xi: DVec3,
    /// Its part of 1/6.
    pub weight: f64,
}

/// Degree 1.
pub fn centroid() -> &'static [Point] {
    const RULE: [Point; 1] = [Point { xi: DVec3::splat(0.25), weight: 1.0 / 6.0 }];
    &RULE
}

/// Degree 2 (P. C. Hammer and A. H. Stroud, 1956): one orbit, `a = (5 - sqrt 5) / 20`.
pub fn four_points() -> &'static [Point] {
    static RULE: LazyLock<Vec<Point>> = LazyLock::new(|| corner_orbit((5.0 - 5f64.sqrt()) / 20.0, 0.25).to_vec());
    &RULE
}

/// Degree 5 (N. J. Walkington, Quadrature on simplices of arbitrary dimension, 2000).
pub fn fourteen_points() -> &'static [Point] {
    static RULE: LazyLock<Vec<Point>> = LazyLock::new(|| {
        let mut rule = corner_orbit(0.310_885_919_263_300_6, 0.112_687_925_718_015_85).to_vec();
        rule.extend(corner_orbit(0.092_735_250_310_891_23, 0.073_493_043_116_361_95));
        rule.extend(edge_orbit(0.045_503_704_125_649_65, 0.042_546_020_777_081_47));
        rule
    });
    &RULE
}

/// Degree 7: the product of Gauss-Jacobi rules of four points in the coordinates `(u, v, w)` of
/// `xi = (u, (1 - u) v, (1 - u)(1 - v) w)`, whose determinant `(1 - u)^2 (1 - v)` is in the rules' weights (A. H. Stroud,
/// Approximate Calculation of Multiple Integrals, 1971, section 2.4).
pub fn sixty_four_points() -> &'static [Point] {
    static RULE: LazyLock<Vec<Point>> = LazyLock::new(|| {
        let mut rule = Vec::with_capacity(64);
        for (u, wu) in JACOBI_2 {
            for (v, wv) in JACOBI_1 {
                for (w, ww) in LEGENDRE {
                    let xi = DVec3::new(u, (1.0 - u) * v, (1.0 - u) * (1.0 - v) * w);
                    rule.push(Point { xi, weight: wu * wv * ww });
                }
            }
        }
        rule
    });
    &RULE
}

/// Abscissae and weights on [0, 1] for the weight function `(1 - u)^2`.
const JACOBI_2: [(f64, f64); 4] = [
    (0.048_500_549_446_997_276, 0.110_888_415_611_277_74),
    (0.238_600_737_551_862_34, 0.143_458_789_799_214_45),
    (0.517_047_295_104_367_4, 0.068_633_887_172_923_1),
    (0.795_851_417_896_772_8, 0.010_352_240_749_918_081),
];

/// The same for `1 - v`.
const JACOBI_1: [(f64, f64); 4] = [
    (0.057_104_196_114_517_725, 0.135_506_913_431_488_52),
    (0.276_843_013_638_123_8, 0.203_464_568_010_271_1),
    (0.583_590_432_368_916_8, 0.129_847_547_608_232_03),
    (0.860_240_135_656_219_5, 0.031_180_970_950_008_085),
];

/// The same for 1.
const LEGENDRE: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_9),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_1),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_1),
    (0.930_568_155_797_026_2, 0.173_927_422_568_726_9),
];

/// The four points with three barycentric coordinates equal to `a`; `weight` is each one's part of one.
fn corner_orbit(a: f64, weight: f64) -> [Point; 4] {
    let b = 1.0 - 3.0 * a;
    [[a, a, a], [b, a, a], [a, b, a], [a, a, b]].map(|xi| Point { xi: xi.into(), weight: weight / 6.0 })
}

/// The six points with two barycentric coordinates equal to `a`, the others to each other.
fn edge_orbit(a: f64, weight: f64) -> [Point; 6] {
    let b = 0.5 - a;
    [[b, a, a], [a, b, a], [a, a, b], [b, b, a], [b, a, b], [a, b, b]]
        .map(|xi| Point { xi: xi.into(), weight: weight / 6.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `int x^i y^j z^k dV = i! j! k! / (i + j + k + 3)!`
    fn monomial([i, j, k]: [i32; 3]) -> f64 {
        let factorial = |n: i32| (1..=n).map(f64::from).product::<f64>();
        factorial(i) * factorial(j) * factorial(k) / factorial(i + j + k + 3)
    }

    #[test]
    fn rules_are_exact_to_their_degree_and_no_further() {
        for (rule, degree) in [(centroid(), 1), (four_points(), 2), (fourteen_points(), 5), (sixty_four_points(), 7)] {
            let error = |degree: i32| {
                let exponents = (0..=degree).flat_map(|i| (0..=degree - i).map(move |j| [i, j, degree - i - j]));
                exponents
                    .map(|e| {
                        let power = |xi: DVec3| xi.x.powi(e[0]) * xi.y.powi(e[1]) * xi.z.powi(e[2]);
                        let sum: f64 = rule.iter().map(|p| p.weight * power(p.xi)).sum();
                        (sum / monomial(e) - 1.0).abs()
                    })
                    .fold(0.0, f64::max)
            };
            assert!(rule.iter().all(|p| p.weight > 0.0 && p.xi.min_element() > 0.0 && p.xi.element_sum() < 1.0));
            for d in 0..=degree {
                assert!(error(d) < 1e-12, "degree {d} of the rule of degree {degree}: {:e}", error(d));
            }
            assert!(error(degree + 1) > 1e-6);
        }
    }
}
