//! Arithmetic of power series in one variable with `N` coefficients, from order 0 on.

use std::iter::Sum;
use std::ops::{Add, Mul};

use glam::{DMat3, DVec3};

/// Degree of the deformation gradients here, which are polynomials: products with higher coefficients are left out.
pub const DEGREE: usize = 3;

/// Coefficients of a series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truncated<T, const N: usize>(pub [T; N]);

/// A number.
pub type Scalar<const N: usize> = Truncated<f64, N>;

/// A matrix.
pub type Matrix<const N: usize> = Truncated<DMat3, N>;

impl<T: Copy + Add<Output = T> + Mul<f64, Output = T> + Sum, const N: usize> Truncated<T, N> {
    /// Sum of products of coefficients whose orders add up to each order.
    pub fn times<U: Copy>(&self, other: &Truncated<U, N>) -> Self
    where
        T: Mul<U, Output = T>,
    {
        Self(std::array::from_fn(|n| (0..=n).map(|k| self.0[k] * other.0[n - k]).sum()))
    }

    pub fn plus(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|n| self.0[n] + other.0[n]))
    }

    pub fn scaled(&self, factor: f64) -> Self {
        Self(self.0.map(|value| value * factor))
    }
}

impl<const N: usize> Scalar<N> {
    /// With a number added.
    pub fn shifted(mut self, by: f64) -> Self {
        self.0[0] += by;
        self
    }

    /// `ln self` of a series that begins with one: `n l_n = n a_n - sum k l_k a_(n-k)`.
    pub fn logarithm(&self) -> Self {
        let mut l = [0.0; N];
        for n in 1..N {
            l[n] = self.0[n] - (1..n).map(|k| k as f64 * l[k] * self.0[n - k]).sum::<f64>() / n as f64;
        }
        Self(l)
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
    pub fn transposed(&self) -> Self {
        Self(self.0.map(|value| value.transpose()))
    }

    /// `self : other`.
    pub fn contracted(&self, other: &Self) -> Scalar<N> {
        Truncated(std::array::from_fn(|n| (0..=n).map(|k| contraction(&self.0[k], &other.0[n - k])).sum()))
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
        Truncated(l)
    }
}

/// The coefficients of a product of polynomials of degree [`DEGREE`].
fn product<T: Copy, U: Copy, V: Sum, const N: usize>(a: &[T; N], b: &[U; N], of: impl Fn(T, U) -> V) -> [V; N] {
    std::array::from_fn(|n| (n.saturating_sub(DEGREE)..=n.min(DEGREE)).map(|k| of(a[k], b[n - k])).sum())
}

impl<const N: usize> Matrix<N> {
    /// `self : self` of a polynomial of degree [`DEGREE`].
    pub fn squared(&self) -> Scalar<N> {
        Truncated(product(&self.0, &self.0, |a, b| contraction(&a, &b)))
    }

    /// `det self` of such a polynomial.
    pub fn determinant(&self) -> Scalar<N> {
        let [x, y, z] = [0, 1, 2].map(|axis| self.0.map(|matrix| matrix.col(axis)));
        let across = product(&y, &z, DVec3::cross);
        Truncated(std::array::from_fn(|n| (0..=n.min(DEGREE)).map(|k| x[k].dot(across[n - k])).sum()))
    }
}

/// `a : b`.
pub fn contraction(a: &DMat3, b: &DMat3) -> f64 {
    a.x_axis.dot(b.x_axis) + a.y_axis.dot(b.y_axis) + a.z_axis.dot(b.z_axis)
}
