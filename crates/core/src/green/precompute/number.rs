//! Number types for computing and storing.

use std::iter::Sum;

use bytemuck::Pod;
use faer::traits::{RealField, math_utils};

/// `f32` or `f64`.
pub trait Number: RealField + Pod + Default + Into<f64> + Sum {
    /// Nearest number.
    fn from_f64(x: f64) -> Self {
        math_utils::from_f64(x)
    }
    /// Exactly.
    fn to_f64(self) -> f64 {
        self.into()
    }
}

impl Number for f32 {}
impl Number for f64 {}
