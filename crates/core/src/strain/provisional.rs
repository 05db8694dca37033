//! Provisional bound on the displacement of a patch, used until the strain response of its contact is ready.
//!
//! On a half-space a traction `3 F / (pi a^2) (1 - r^2/a^2)^2`, whose weights are those of a patch of radius `a`, moves the
//! patch, by the mean `d = W^T u` with its own weights, by
//!
//! ```text
//! d = I F / (pi a) times (1 - nu) / (2 G) along the normal, (1 - nu/2) / (2 G) across it
//! I = int_0^inf (48 J_3(x) / x^3)^2 dx = 2.408
//! ```
//!
//! from the compliance `1/(G k) [(1 - nu) n n^T + t t^T + (1 - nu) k k^T / k^2]` of a half-space to a traction of wave
//! number `k` (Johnson, Contact Mechanics, 1985, chapter 3; the mask's transform is `48 J_3(ka)/(ka)^3`). A tangential
//! motion shears the surface at the centre by `3 F / (pi a^2) / (2 G)`, so that the largest principal strain is
//! `1.25 / (1 - nu/2) d/a`. Off the centre and for oblique motions it is a little larger: over all of them (evaluated by
//! Fourier transforms) the surface is strained by at most
//!
//! ```text
//! 1.71 d/a for nu = 0     1.64 for 0.4     1.65 for 0.45     1.67 for 0.5
//! ```
//!
//! hardly dependent on Poisson's ratio: 0.58 of `limit * a` is the exact bound. [`SAFE_PART`] is less, for what a half-space
//! lacks: layers and edges thinner than the patch, elements that cannot follow the mask, supports nearby.
//!
//! Of a patch that reaches over a support only a part `p` of the weights can move. Its mean moves by `d = p d_p` when that
//! part moves by `d_p`, over a distance of about `p a` from the support: the strain is about `d / (p^2 a)`.

use glam::DVec3;

/// Part of `limit * a` that a patch may move: a quarter of what a half-space allows. On the built-in bodies, patches of 2 to
/// 25 mm anywhere are then strained by less than the limit, also over thin edges and supports.
const SAFE_PART: f64 = 0.15;

/// Displacement (m) of a patch, from where it is without force, that keeps the strain within `limit`, from its `weights`
/// at `positions` (m) alone; weights of supported nodes are given as zero. `floor` (m) is the mean length of the surface's
/// edges: elements spread what acts on less.
///
/// The effective radius is `2 sqrt(sum w |x - m|^2)` with the weights' centroid `m`: the radius `a` of a flat disc under
/// the mask `(1 - r^2/a^2)^2`, for which the mean of `r^2` is `a^2 / 4`.
pub fn provisional_displacement(weights: &[f64], positions: &[DVec3], floor: f64, limit: f64) -> f64 {
    let total: f64 = weights.iter().sum();
    let centre = weights.iter().zip(positions).map(|(&w, &x)| w * x).sum::<DVec3>() / total;
    let spread: f64 = weights.iter().zip(positions).map(|(&w, &x)| w * (x - centre).length_squared()).sum();
    let radius = 2.0 * (spread / total).max(0.0).sqrt();
    if total > 0.0 { SAFE_PART * limit * total * total * radius.max(floor) } else { 0.0 }
}
