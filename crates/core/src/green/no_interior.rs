//! The inside of a body, where the offline part that factorises it is left out: there is none.

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
