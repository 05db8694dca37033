//! Arithmetic of power series in one variable with `N` coefficients, from order 0 on.

use glam::DMat3;

/// Degree of the deformation gradients here, which are polynomials: products with higher coefficients are left out.
pub const DEGREE: usize = 3;

/// A number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scalar<const N: usize>(pub [f64; N]);

/// A matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Matrix<const N: usize>(pub [DMat3; N]);

impl<const N: usize> Scalar<N> {
    /// Sum of products of coefficients whose orders add up to each order.
    pub fn times(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|n| (0..=n).map(|k| self.0[k] * other.0[n - k]).sum()))
    }

    pub fn plus(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|n| self.0[n] + other.0[n]))
    }

    pub fn scaled(&self, factor: f64) -> Self {
        Self(self.0.map(|value| value * factor))
    }

    /// With a number added.
    pub fn shifted(mut self, by: f64) -> Self {
        self.0[0] += by;
        self
    }

    /// `exp(self)` of a series without constant: `n e_n = sum k l_k e_(n-k)`.
    pub fn exponential(&self) -> Self {
        let mut e = [0.0; N];
        e[0] = 1.0;
        for n in 1..N {
            e[n] = (1..=n).map(|k| k as f64 * self.0[k] * e[n - k]).sum::<f64>() / n as f64;
        }
        Self(e)
    }
}

impl<const N: usize> Matrix<N> {
    pub fn times(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|n| (0..=n).map(|k| self.0[k] * other.0[n - k]).sum()))
    }

    pub fn scaled_by(&self, by: &Scalar<N>) -> Self {
        Self(std::array::from_fn(|n| (0..=n).map(|k| self.0[k] * by.0[n - k]).sum()))
    }

    pub fn plus(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|n| self.0[n] + other.0[n]))
    }

    pub fn scaled(&self, factor: f64) -> Self {
        Self(self.0.map(|value| value * factor))
    }

    pub fn transposed(&self) -> Self {
        Self(self.0.map(|value| value.transpose()))
    }

    /// `self : other`.
    pub fn contracted(&self, other: &Self) -> Scalar<N> {
        Scalar(std::array::from_fn(|n| (0..=n).map(|k| contraction(&self.0[k], &other.0[n - k])).sum()))
    }

    /// Inverse of a polynomial of degree [`DEGREE`] whose constant is the identity: `x_n = -sum a_k x_(n-k)`.
    pub fn inverse(&self) -> Self {
        let mut x = [DMat3::ZERO; N];
        x[0] = DMat3::IDENTITY;
        for n in 1..N {
            let products: DMat3 = (1..n.min(DEGREE + 1)).map(|k| self.0[k] * x[n - k]).sum();
            x[n] = -(products + self.0[n]);
        }
        Self(x)
    }

    /// `ln det self` of such a polynomial, with the `inverse`: `n l_n = sum k tr(x_(n-k) a_k)`.
    pub fn log_determinant(&self, inverse: &Self) -> Scalar<N> {
        let mut l = [0.0; N];
        for (n, value) in l.iter_mut().enumerate().skip(1) {
            let trace = |k: usize| contraction(&inverse.0[n - k].transpose(), &self.0[k]);
            *value = (1..=n.min(DEGREE)).map(|k| k as f64 * trace(k)).sum::<f64>() / n as f64;
        }
        Scalar(l)
    }
}

/// `a : b`.
pub fn contraction(a: &DMat3, b: &DMat3) -> f64 {
    a.x_axis.dot(b.x_axis) + a.y_axis.dot(b.y_axis) + a.z_axis.dot(b.z_axis)
}
