//! Number types for computing and storing.

use std::iter::Sum;
use std::ops::{AddAssign, Neg, SubAssign};

use bytemuck::Pod;
use faer::traits::ComplexField;

/// `f32` or `f64`.
pub trait Number:
    ComplexField + Pod + Default + Neg<Output = Self> + AddAssign + SubAssign + Sum + Send + Sync
{
    /// Nearest number.
    fn from_f64(x: f64) -> Self;
    /// Exactly.
    fn to_f64(self) -> f64;
}

impl Number for f32 {
    fn from_f64(x: f64) -> Self {
        x as f32
    }
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
}

impl Number for f64 {
    fn from_f64(x: f64) -> Self {
        x
    }
    fn to_f64(self) -> f64 {
        self
    }
}
