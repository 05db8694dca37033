//! Isotropic linear elastic material.

use crate::{Error, Result};

/// Isotropic Hooke material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Isotropic {
    /// Young's modulus, Pa.
    pub youngs_modulus: f64,
    /// Poisson's ratio.
    pub poissons_ratio: f64,
    /// Density, kg/m^3.
    pub density: f64,
}

impl Isotropic {
    /// Checks the ranges in which the elasticity tensor is positive definite.
    ///
    /// # Errors
    /// `E <= 0`, `nu` outside (-1, 0.5), negative density.
    pub fn new(youngs_modulus: f64, poissons_ratio: f64, density: f64) -> Result<Self> {
        if !(youngs_modulus > 0.0 && youngs_modulus.is_finite()) {
            return Err(Error::Invalid(format!("Young's modulus must be positive, got {youngs_modulus} Pa")));
        }
        if !(poissons_ratio > -1.0 && poissons_ratio < 0.5) {
            return Err(Error::Invalid(format!("Poisson's ratio must lie in (-1, 0.5), got {poissons_ratio}")));
        }
        if !(density >= 0.0 && density.is_finite()) {
            return Err(Error::Invalid(format!("density must not be negative, got {density} kg/m^3")));
        }
        Ok(Self { youngs_modulus, poissons_ratio, density })
    }

    /// Lame's constants `(lambda, mu)`, Pa (paper 2.8).
    pub fn lame(&self) -> (f64, f64) {
        let (e, nu) = (self.youngs_modulus, self.poissons_ratio);
        (nu * e / ((1.0 + nu) * (1.0 - 2.0 * nu)), e / (2.0 * (1.0 + nu)))
    }
}
