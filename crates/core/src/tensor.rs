//! Tensors of vectors.

use glam::{DMat3, DVec3};

/// `a b^T`.
pub fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// Projection on the plane across a unit normal, `I - n n^T`.
pub fn across(normal: DVec3) -> DMat3 {
    DMat3::IDENTITY - outer(normal, normal)
}
