//! Coefficients of a sphere's contact at finite strain, by `python -m benches strain-table`.
//!
//! Forces of 26 half-spaces by full Newton's method, d/R to 1.5; fits within 0.2 %.

use super::finite_strain::StrainTerms;

/// Poisson's ratios of the neo-Hookean material.
pub const RATIOS: [f64; 8] = [0.0, 0.1, 0.2, 0.3, 0.35, 0.4, 0.45, 0.49];
/// Poisson's ratios of the others.
pub const FEW_RATIOS: [f64; 2] = [0.3, 0.45];
/// `c01 / (c10 + c01)` of Mooney and Rivlin.
pub const SHARES: [f64; 3] = [0.0, 0.5, 1.0];
/// `c20 / c10` of Yeoh.
pub const YEOH_QUADRATIC: [f64; 3] = [0.0, 0.5, 2.0];
/// `c30 / c10` of Yeoh.
pub const YEOH_CUBIC: [f64; 2] = [0.0, 1.0];

/// By Poisson's ratio.
pub const NEO_HOOKEAN: [StrainTerms; 8] = [
    [0.242607, -0.035773, -0.0279463],
    [0.204017, -0.0369066, -0.0265097],
    [0.151772, -0.0279361, -0.0282368],
    [0.0867226, -0.00913004, -0.0334069],
    [0.0499325, 0.00149966, -0.0355022],
    [0.010048, 0.0144029, -0.0382704],
    [-0.0296183, 0.0247728, -0.0398965],
    [-0.0625876, 0.0361001, -0.0432303],
];

/// By Poisson's ratio and share.
pub const MOONEY_RIVLIN: [[StrainTerms; 3]; 2] = [
    [[0.0664703, 0.0738306, -0.0472004], [0.115329, 0.0469999, -0.00207802], [0.155785, 0.0452019, 0.0106999]],
    [[-0.0176493, 0.0321723, -0.0415028], [0.0491669, -0.00108953, 0.00442381], [0.105684, -0.00398643, 0.015107]],
];

/// By Poisson's ratio, quadratic and cubic term.
pub const YEOH: [[[StrainTerms; 2]; 3]; 2] = [
    [
        [[0.0664703, 0.0738306, -0.0472004], [0.0921588, -0.0489347, 0.109996]],
        [[0.0786475, 0.0735408, 0.0206618], [0.0786727, 0.0595053, 0.0661457]],
        [[0.0759131, 0.244732, -0.0203272], [0.07375, 0.250607, -0.0117926]],
    ],
    [
        [[-0.0176493, 0.0321723, -0.0415028], [0.000215225, -0.0733906, 0.133068]],
        [[-0.00384517, 0.0563391, 0.0207271], [-0.0108998, 0.0636807, 0.0683516]],
        [[0.00300721, 0.286655, -0.0539735], [-0.00181692, 0.303041, -0.0456966]],
    ],
];
