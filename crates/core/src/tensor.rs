//! Tensors of vectors.

use glam::{DMat3, DVec3};

/// `a b^T`.
pub fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// The matrix of `a x`.
pub fn skew(a: DVec3) -> DMat3 {
    DMat3::from_cols(a.cross(DVec3::X), a.cross(DVec3::Y), a.cross(DVec3::Z))
}

/// Projection on the plane across a unit normal, `I - n n^T`.
pub fn across(normal: DVec3) -> DMat3 {
    DMat3::IDENTITY - outer(normal, normal)
}

/// A symmetric matrix by `xx, xy, xz, yy, yz, zz`.
#[inline(always)]
pub fn symmetric([xx, xy, xz, yy, yz, zz]: [f64; 6]) -> DMat3 {
    DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz])
}
