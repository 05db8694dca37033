//! Blending weights of the fans around a foot: what is known at the nodes becomes a smooth field of the tool's place.
//!
//! `nu_i = w_i eta_i / sum w_j eta_j`, with `w` of the distance (`blend`) and `eta` rising smoothly from zero, where the
//! fan's normal is at a right angle to that of the contact, to one at 60 degrees.

use glam::DVec3;

use super::SmoothSurface;
use super::blend::weight;
use super::foot::FootPoint;

/// Most fans around a foot.
pub const MAX_FANS: usize = 160;
/// Cosine of the angle between normals from which a fan counts fully.
const FULLY: f64 = 0.5;

/// Fans around a foot, with weights that sum to one and their gradients by the tool's place.
#[derive(Clone, Debug)]
pub struct FanWeights {
    count: usize,
    fans: [u32; MAX_FANS],
    weights: [f64; MAX_FANS],
    gradients: [DVec3; MAX_FANS],
    /// Part of all weight that lies on nodes which may be touched.
    pub touchable: f64,
}

impl Default for FanWeights {
    fn default() -> Self {
        Self {
            count: 0,
            fans: [0; MAX_FANS],
            weights: [0.0; MAX_FANS],
            gradients: [DVec3::ZERO; MAX_FANS],
            touchable: 0.0,
        }
    }
}

impl FanWeights {
    /// Rank of each fan and its weight.
    pub fn iter(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.fans[..self.count].iter().zip(&self.weights).map(|(&fan, &weight)| (fan as usize, weight))
    }

    /// Rank of each fan, its weight, and the gradient of that by the place of the tool, 1/m.
    pub fn with_gradients(&self) -> impl Iterator<Item = (usize, f64, DVec3)> + '_ {
        self.iter().zip(&self.gradients).map(|((fan, weight), &gradient)| (fan, weight, gradient))
    }

    /// A scalar field known at the fans, and its gradient.
    pub fn field(&self, value: impl Fn(usize) -> f64) -> (f64, DVec3) {
        let mut sum = (0.0, DVec3::ZERO);
        for (fan, weight, gradient) in self.with_gradients() {
            let value = value(fan);
            sum.0 += weight * value;
            sum.1 += gradient * value;
        }
        sum
    }
}

impl SmoothSurface {
    /// Weighs the fans around a foot that may be touched.
    pub fn weigh(&self, foot: &FootPoint, weights: &mut FanWeights) {
        let (mut sum, mut slope, mut all) = (0.0, DVec3::ZERO, 0.0);
        weights.count = 0;
        for &rank in self.all(foot.triangle) {
            let fan = &self.fans[rank as usize];
            let Some((near, fall, _)) = weight(fan, foot.position - fan.position) else { continue };
            let cosine = fan.normal.dot(foot.normal);
            if cosine <= 0.0 || weights.count == MAX_FANS {
                continue;
            }
            let t = (cosine / FULLY).min(1.0);
            let (facing, rise) = (t * t * (3.0 - 2.0 * t), if t < 1.0 { 6.0 * t * (1.0 - t) / FULLY } else { 0.0 });
            all += near * facing;
            if !self.touchable[rank as usize] {
                continue;
            }
            // Both derivative matrices are symmetric.
            let gradient = foot.shift * (fall * facing) + foot.turning * (fan.normal * (near * rise));
            let place = weights.count;
            (weights.fans[place], weights.weights[place], weights.gradients[place]) = (rank, near * facing, gradient);
            weights.count += 1;
            sum += near * facing;
            slope += gradient;
        }
        weights.touchable = if all > 0.0 { sum / all } else { 0.0 };
        let inverse = if sum > 0.0 { 1.0 / sum } else { 0.0 };
        let relative = slope * inverse;
        for place in 0..weights.count {
            weights.weights[place] *= inverse;
            weights.gradients[place] = weights.gradients[place] * inverse - relative * weights.weights[place];
        }
    }
}
