//! Share of the half-space's modulus that is left beside sharp edges and corners, as a function of a sphere's centre.

use glam::{DMat3, DVec3};

use crate::tensor::outer;

/// A function of the sphere's centre, its gradient, and its second derivatives.
#[derive(Clone, Copy, Debug, Default)]
pub struct Share {
    pub value: f64,
    pub gradient: DVec3,
    pub hessian: DMat3,
}

impl Share {
    pub(super) const WHOLE: Self = Self { value: 1.0, gradient: DVec3::ZERO, hessian: DMat3::ZERO };

    /// The product of two functions.
    pub(super) fn times(&self, other: &Self) -> Self {
        let mixed = outer(self.gradient, other.gradient);
        Self {
            value: self.value * other.value,
            gradient: self.gradient * other.value + other.gradient * self.value,
            hessian: self.hessian * other.value + other.hessian * self.value + mixed + mixed.transpose(),
        }
    }

    /// `x^2 (3 - 2 x)` from 0 to 1 between two values.
    pub(super) fn stepped(&self, [low, high]: [f64; 2]) -> Self {
        let width = high - low;
        let x = ((self.value - low) / width).clamp(0.0, 1.0);
        let slope = 6.0 * x * (1.0 - x) / width;
        let bend = if x > 0.0 && x < 1.0 { (6.0 - 12.0 * x) / (width * width) } else { 0.0 };
        Self {
            value: x * x * (3.0 - 2.0 * x),
            gradient: self.gradient * slope,
            hessian: outer(self.gradient, self.gradient) * bend + self.hessian * slope,
        }
    }

    /// `factor * self + constant`.
    pub(super) fn scaled(&self, factor: f64, constant: f64) -> Self {
        Self { value: factor * self.value + constant, gradient: self.gradient * factor, hessian: self.hessian * factor }
    }
}
