//! Blending weights of the fans around a foot: values at the nodes become smooth fields of the tool's position.
//!
//! `nu_i = w_i eta_i / sum w_j eta_j`, with `w = (1 - r^2)^3` of the distance from the fan over its reach, and `eta` rising
//! smoothly from zero, where the fan's normal is at a right angle to that of the contact, to one at 60 degrees.

use glam::DVec3;
use pulp::{Arch, NullaryFnOnce};

use super::SmoothSurface;
use super::foot::FootPoint;
use super::neighbourhood::{FanLanes, LANES, Lane, Neighbourhood, reaches};

/// Most fans around a foot.
pub const MAX_FANS: usize = 160;
/// Cosine of the angle between normals from which a fan counts fully.
const FULLY: f64 = 0.5;

/// Fans around a foot, with weights that sum to one and their gradients by the tool's position.
#[derive(Clone, Debug)]
pub struct FanWeights {
    /// The fans of the triangle at the foot.
    pub near: Neighbourhood,
    count: usize,
    fans: [u32; MAX_FANS],
    weights: [f64; MAX_FANS],
    gradients: [DVec3; MAX_FANS],
    turns: [DVec3; MAX_FANS],
    /// Part of the weight on touchable nodes.
    pub touchable: f64,
    arch: Arch,
}

/// Fields known at the fans, blended.
#[derive(Clone, Copy, Debug)]
pub struct Blended<const N: usize> {
    /// Their values.
    pub values: [f64; N],
    /// Their derivatives by each coordinate of the tool's place.
    slopes: [[f64; N]; 3],
}

impl<const N: usize> Default for Blended<N> {
    fn default() -> Self {
        Self { values: [0.0; N], slopes: [[0.0; N]; 3] }
    }
}

impl<const N: usize> Blended<N> {
    /// From values and their gradients.
    #[cfg(test)]
    pub fn from_parts(values: [f64; N], slopes: [DVec3; N]) -> Self {
        Self { values, slopes: std::array::from_fn(|axis| slopes.map(|slope| slope[axis])) }
    }

    /// Divides a field by a positive number with a gradient.
    pub fn divide(&mut self, field: usize, (by, slope): (f64, DVec3)) {
        let value = self.values[field] / by;
        for (along, slope) in self.slopes.iter_mut().zip(slope.to_array()) {
            along[field] = (along[field] - value * slope) / by;
        }
        self.values[field] = value;
    }

    /// Gradient of a field by the tool's place.
    pub fn slope(&self, field: usize) -> DVec3 {
        DVec3::from_array(self.slopes.map(|along| along[field]))
    }
}

impl FanWeights {
    /// Whether most of the weight lies on nodes that are not touchable.
    pub fn is_outside(&self) -> bool {
        self.touchable < 0.5
    }

    /// With memory for any triangle of some surfaces.
    pub fn new(near: Neighbourhood) -> Self {
        Self {
            near,
            count: 0,
            fans: [0; MAX_FANS],
            weights: [0.0; MAX_FANS],
            gradients: [DVec3::ZERO; MAX_FANS],
            turns: [DVec3::ZERO; MAX_FANS],
            touchable: 0.0,
            arch: Arch::new(),
        }
    }

    /// Starts a set of weights; [`FanWeights::add`] adds to it.
    pub fn begin(&mut self) {
        (self.count, self.touchable) = (0, 0.0);
    }

    /// Adds weight to a fan, with its gradients by the tool's place and by its rotation; nothing where there is no room left.
    pub fn add(&mut self, fan: u32, weight: f64, [by_place, by_rotation]: [DVec3; 2]) {
        let place = match self.fans[..self.count].iter().position(|&known| known == fan) {
            Some(place) => place,
            None if self.count == MAX_FANS => return,
            None => {
                let place = self.count;
                (self.fans[place], self.weights[place]) = (fan, 0.0);
                (self.gradients[place], self.turns[place]) = (DVec3::ZERO, DVec3::ZERO);
                self.count += 1;
                place
            }
        };
        self.weights[place] += weight;
        self.gradients[place] += by_place;
        self.turns[place] += by_rotation;
    }

    /// Scales the weights to a sum of one.
    pub fn normalise(&mut self) {
        let Self { count, weights, gradients, turns, .. } = self;
        let sum: f64 = weights[..*count].iter().sum();
        let inverse = if sum > 0.0 { 1.0 / sum } else { 0.0 };
        let slope: DVec3 = gradients[..*count].iter().sum();
        let turn: DVec3 = turns[..*count].iter().sum();
        for place in 0..*count {
            weights[place] *= inverse;
            gradients[place] = (gradients[place] - slope * weights[place]) * inverse;
            turns[place] = (turns[place] - turn * weights[place]) * inverse;
        }
    }

    /// Adds other weights that have a share of the whole, with the share's gradient by the tool's place, 1/m.
    pub fn mix(&mut self, other: &Self, share: f64, gradient: DVec3) {
        for place in 0..self.count {
            self.gradients[place] = self.gradients[place] * (1.0 - share) - gradient * self.weights[place];
            self.turns[place] *= 1.0 - share;
            self.weights[place] *= 1.0 - share;
        }
        for place in 0..other.count {
            let by_place = other.gradients[place] * share + gradient * other.weights[place];
            self.add(other.fans[place], share * other.weights[place], [by_place, other.turns[place] * share]);
        }
        self.touchable += share * (other.touchable - self.touchable);
    }

    /// Rank of each fan, and the gradient of its weight by the tool's rotation; zero for a sphere.
    pub fn with_turns(&self) -> impl Iterator<Item = (usize, DVec3)> + '_ {
        self.iter().zip(&self.turns).map(|((fan, _), &turn)| (fan, turn))
    }

    /// Rank of each fan and its weight.
    pub fn iter(&self) -> impl Iterator<Item = (usize, f64)> + Clone + '_ {
        self.fans[..self.count].iter().zip(&self.weights).map(|(&fan, &weight)| (fan as usize, weight))
    }

    /// Rank of each fan, its weight, and the gradient of that by the place of the tool, 1/m.
    pub fn with_gradients(&self) -> impl Iterator<Item = (usize, f64, DVec3)> + '_ {
        self.iter().zip(&self.gradients).map(|((fan, weight), &gradient)| (fan, weight, gradient))
    }

    /// Part of the weight on some of the fans, and its gradient; exactly one where it is all.
    pub fn share(&self, counts: impl Fn(usize) -> bool) -> (f64, DVec3) {
        let (mut share, mut slope, mut all) = (0.0, DVec3::ZERO, true);
        for (fan, weight, gradient) in self.with_gradients() {
            if counts(fan) {
                share += weight;
                slope += gradient;
            } else {
                all &= weight == 0.0;
            }
        }
        if all { (1.0, DVec3::ZERO) } else { (share, slope) }
    }

    /// Fields known at the fans, and their gradients.
    pub fn blend<const N: usize>(&self, fields: &[[f64; N]]) -> Blended<N> {
        let mut blended = Blended::default();
        self.blend_part::<N, N>(fields, 0, &mut blended);
        blended
    }

    /// Blends `M` of the fields, from `first` on.
    pub fn blend_part<const N: usize, const M: usize>(
        &self,
        fields: &[[f64; N]],
        first: usize,
        blended: &mut Blended<N>,
    ) {
        self.arch.dispatch(Blending::<N, M> { weights: self, fields, first, blended });
    }
}

/// The sums as a struct: a closure might be compiled for the narrowest vectors.
struct Blending<'a, const N: usize, const M: usize> {
    weights: &'a FanWeights,
    fields: &'a [[f64; N]],
    first: usize,
    blended: &'a mut Blended<N>,
}

impl<const N: usize, const M: usize> NullaryFnOnce for Blending<'_, N, M> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let (mut values, mut slopes) = ([0.0; M], [[0.0; M]; 3]);
        let FanWeights { count, fans, weights, gradients, .. } = self.weights;
        for ((&fan, &weight), gradient) in fans[..*count].iter().zip(weights).zip(gradients) {
            let own = &self.fields[fan as usize][self.first..self.first + M];
            for k in 0..M {
                values[k] += weight * own[k];
                slopes[0][k] += gradient.x * own[k];
                slopes[1][k] += gradient.y * own[k];
                slopes[2][k] += gradient.z * own[k];
            }
        }
        let part = self.first..self.first + M;
        self.blended.values[part.clone()].copy_from_slice(&values);
        for (to, slope) in self.blended.slopes.iter_mut().zip(slopes) {
            to[part.clone()].copy_from_slice(&slope);
        }
    }
}

impl SmoothSurface {
    /// Computes the weights of the touchable fans around a foot.
    pub fn weigh(&self, foot: &FootPoint, weights: &mut FanWeights) {
        weights.near.load(self, foot.triangle);
        self.arch.dispatch(Weighing { foot, weights });
    }
}

/// Weights of the near fans, as a struct: a closure might be compiled for the narrowest vectors.
struct Weighing<'a> {
    foot: &'a FootPoint,
    weights: &'a mut FanWeights,
}

impl NullaryFnOnce for Weighing<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let FanWeights { near, count, fans, weights, gradients, turns, touchable, .. } = self.weights;
        let (position, mut all, mut place) = (self.foot.position.to_array(), 0.0, 0);
        let (mut sum, mut slope) = (0.0, DVec3::ZERO);
        for group in near.all() {
            let (offset, relative) = group.offset(position);
            if !reaches(&relative) {
                continue;
            }
            let (weight, gradient) = weigh_lanes(group, &offset, &relative, self.foot);
            for l in 0..LANES {
                all += weight[l];
                if weight[l] == 0.0 || group.touchable[l] == 0.0 || place == MAX_FANS {
                    continue;
                }
                let own = DVec3::new(gradient[0][l], gradient[1][l], gradient[2][l]);
                (fans[place], weights[place], gradients[place]) = (group.ranks[l], weight[l], own);
                place += 1;
                sum += weight[l];
                slope += own;
            }
        }
        *count = place;
        turns[..place].fill(DVec3::ZERO);
        *touchable = if all > 0.0 { sum / all } else { 0.0 };
        let inverse = if sum > 0.0 { 1.0 / sum } else { 0.0 };
        let relative = slope * inverse;
        for (weight, gradient) in weights[..place].iter_mut().zip(gradients) {
            *weight *= inverse;
            *gradient = *gradient * inverse - relative * *weight;
        }
    }
}

/// `w eta` of fans side by side, and its gradient by the tool's place.
#[inline(always)]
fn weigh_lanes(fans: &FanLanes, offset: &[Lane; 3], relative: &Lane, foot: &FootPoint) -> (Lane, [Lane; 3]) {
    let (mut weights, mut gradients) = ([0.0; LANES], [[0.0; LANES]; 3]);
    let [x, y, z] = foot.normal.to_array();
    // Both derivative matrices are symmetric.
    let (s, d) = (foot.shift.to_cols_array_2d(), foot.turning.to_cols_array_2d());
    let n = &fans.normal;
    for l in 0..LANES {
        let left = if relative[l] < 1.0 { 1.0 - relative[l] } else { 0.0 };
        let (w, fall) = (left * left * left, -6.0 * left * left * fans.inverse_squared_reach[l]);
        let cosine = n[0][l] * x + n[1][l] * y + n[2][l] * z;
        let t = if cosine < FULLY { cosine * (1.0 / FULLY) } else { 1.0 };
        let t = if t > 0.0 { t } else { 0.0 };
        let (facing, rise) = (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t) * (1.0 / FULLY));
        weights[l] = w * facing;
        let (by_place, by_normal) = (fall * facing, w * rise);
        let (ox, oy, oz) = (offset[0][l] * by_place, offset[1][l] * by_place, offset[2][l] * by_place);
        let (nx, ny, nz) = (n[0][l] * by_normal, n[1][l] * by_normal, n[2][l] * by_normal);
        for k in 0..3 {
            gradients[k][l] = s[k][0] * ox + s[k][1] * oy + s[k][2] * oz + d[k][0] * nx + d[k][1] * ny + d[k][2] * nz;
        }
    }
    (weights, gradients)
}
