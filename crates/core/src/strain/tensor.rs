//! The largest principal strain in magnitude of one place.

use crate::math::{acos, cos};
/// Which strain six numbers of a place stand for. Both are affine in the displacements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StrainKind {
    /// The infinitesimal strain, components xx, yy, zz, xy, yz, zx.
    Infinitesimal,
    /// The deformation gradient `F` (3x2) of the tangent plane, its columns one after the other, of which the strain is
    /// `E = (F^T F - I) / 2`. It is zero for rigid motions.
    InPlane,
}

impl StrainKind {
    /// Largest principal strain in magnitude, or `floor` where an upper bound tells that it is not above `floor`.
    #[inline]
    pub fn magnitude_above(self, sample: &[f64; 6], floor: f64) -> f64 {
        match self {
            StrainKind::Infinitesimal => infinitesimal(sample, floor),
            StrainKind::InPlane => in_plane(sample).max(floor),
        }
    }

    /// Largest principal strain in magnitude.
    pub fn magnitude(self, sample: &[f64; 6]) -> f64 {
        self.magnitude_above(sample, 0.0)
    }

    /// Change of the strain (six components) with the sample, to first order about `base`: `sym(F^T X)`.
    #[cfg(feature = "strain")]
    pub(super) fn linearised(self, base: &[f64; 6], change: &[f64; 6]) -> [f64; 6] {
        let dot = |a: &[f64], b: &[f64]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        match self {
            StrainKind::Infinitesimal => *change,
            StrainKind::InPlane => {
                let ((f1, f2), (x1, x2)) = (base.split_at(3), change.split_at(3));
                [dot(f1, x1), dot(f2, x2), 0.0, 0.5 * (dot(f1, x2) + dot(f2, x1)), 0.0, 0.0]
            }
        }
    }

    /// Squared norm of what the strain changes by beyond first order: `|X^T X| / 2` is not above half of it.
    #[cfg(feature = "strain")]
    pub(super) fn squared_curvature(self, change: &[f64; 6]) -> f64 {
        match self {
            StrainKind::Infinitesimal => 0.0,
            StrainKind::InPlane => change.iter().map(|x| x * x).sum(),
        }
    }
}

/// Scalar product of two symmetric tensors; in its norm, that of Frobenius, none of the principal values is larger.
#[cfg(feature = "strain")]
pub(super) fn tensor_product(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + 2.0 * (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])
}

/// Largest magnitude among the eigenvalues of a symmetric tensor, by the angle of the characteristic cubic (Smith, 1961).
///
/// With the mean `m` of the diagonal and the norm `sqrt(6) s` of the deviator the eigenvalues are `m + 2 s cos(angle)`: none
/// is above `|m| + 2 s` in magnitude. That is within 16 % of the largest one of a deviator and spares most trigonometry.
#[inline]
fn infinitesimal(&[xx, yy, zz, xy, yz, zx]: &[f64; 6], floor: f64) -> f64 {
    let mean = (xx + yy + zz) / 3.0;
    let (a, b, c) = (xx - mean, yy - mean, zz - mean);
    let spread = ((a * a + b * b + c * c + 2.0 * (xy * xy + yz * yz + zx * zx)) / 6.0).sqrt();
    if mean.abs() + 2.0 * spread <= floor {
        return floor;
    }
    let determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * zx) + zx * (xy * yz - b * zx);
    let cosine = determinant / (2.0 * spread * spread * spread).max(f64::MIN_POSITIVE);
    let angle = acos(cosine.clamp(-1.0, 1.0)) / 3.0;
    let high = mean + 2.0 * spread * cos(angle);
    let low = mean + 2.0 * spread * cos(angle + 2.0 * std::f64::consts::FRAC_PI_3);
    high.abs().max(low.abs()).max(floor)
}

/// Of the two principal values `mean +- radius`, the larger in magnitude.
#[inline]
fn in_plane(f: &[f64; 6]) -> f64 {
    let xx = 0.5 * (f[0] * f[0] + f[1] * f[1] + f[2] * f[2] - 1.0);
    let yy = 0.5 * (f[3] * f[3] + f[4] * f[4] + f[5] * f[5] - 1.0);
    let xy = 0.5 * (f[0] * f[3] + f[1] * f[4] + f[2] * f[5]);
    let difference = 0.5 * (xx - yy);
    0.5 * (xx + yy).abs() + (difference * difference + xy * xy).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tensors with known eigenvalues: `Q diag Q^T` with a rotation about (1, 2, 3).
    #[test]
    fn principal_values_of_a_turned_diagonal() {
        let turn = glam::DMat3::from_axis_angle(glam::DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
        let cases =
            [([0.1, -0.05, 0.02], 0.1), ([-0.3, 0.1, 0.2], 0.3), ([0.2, 0.2, 0.2], 0.2), ([0.0, 0.0, -0.1], 0.1)];
        for (values, largest) in cases {
            let t = turn * glam::DMat3::from_diagonal(values.into()) * turn.transpose();
            let sample = [t.x_axis.x, t.y_axis.y, t.z_axis.z, t.x_axis.y, t.y_axis.z, t.z_axis.x];
            let found = StrainKind::Infinitesimal.magnitude(&sample);
            assert!((found - largest).abs() < 1e-8, "{values:?}: {found}");
            assert!((StrainKind::Infinitesimal.magnitude_above(&sample, 0.99 * largest) - found).abs() < 1e-15);
            assert_eq!(StrainKind::Infinitesimal.magnitude_above(&sample, 2.0 * largest), 2.0 * largest);
        }
    }

    /// A turned plane stretched by `s` has the strains `(s^2 - 1) / 2`.
    #[test]
    fn in_plane_strain_is_that_of_green() {
        let turn = glam::DMat3::from_axis_angle(glam::DVec3::new(3.0, -1.0, 2.0).normalize(), 2.1);
        let (x, y) = (turn.x_axis * 1.2, turn.y_axis * 0.7);
        let found = StrainKind::InPlane.magnitude(&[x.x, x.y, x.z, y.x, y.y, y.z]);
        assert!((found - (1.0 - 0.49) / 2.0).abs() < 1e-14, "{found}");
    }
}
