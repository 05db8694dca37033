//! Stand-in for the displacements inside a body in builds without the offline part: there are none.

use crate::Result;

/// Never made.
pub enum Interior {}

impl Interior {
    /// See the offline part.
    ///
    /// # Errors
    /// None.
    pub fn extend(&self, _surface: &[f64]) -> Result<Vec<f64>> {
        match *self {}
    }

    /// See the offline part.
    ///
    /// # Errors
    /// None.
    pub fn extend_responses(&self, _fields: &[f64]) -> Result<Vec<f64>> {
        match *self {}
    }

    /// See the offline part.
    pub fn surface_count(&self) -> usize {
        match *self {}
    }

    /// See the offline part.
    pub fn dof_count(&self) -> usize {
        match *self {}
    }
}
