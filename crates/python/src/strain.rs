//! Strain of a pose, and the share of a contact's forces that keeps it within a limit.

use std::sync::Arc;

use glam::DVec3;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use palpate_core::Error;
use palpate_core::contact::{Patch, PatchGeometry, PatchScratch, SurfaceQuery, patch_weights};
use palpate_core::strain::{self, MAX_CONTACTS_WATCHED, StrainOperator};
use pyo3::prelude::*;

use crate::errors::Answer;
use crate::green::{GreenCore, Interior};

/// How strain is measured on one body.
#[pyclass(module = "palpate._native", frozen)]
pub struct StrainMeasure {
    pub(crate) measure: Arc<strain::StrainMeasure>,
}

/// Strain at the places that matter for some contacts, per newton.
#[pyclass(module = "palpate._native", frozen)]
pub struct StrainResponse {
    response: Box<strain::StrainResponse>,
}

/// Nodes (ranks) and weights of a patch.
type PatchArrays<'py> = (PyReadonlyArray1<'py, u32>, PyReadonlyArray1<'py, f64>);

#[pymethods]
impl StrainMeasure {
    /// From a sparse operator in compressed rows, six a place (xx, yy, zz, xy, yz, zx), on the dofs of all nodes.
    #[staticmethod]
    fn of_elements(
        py: Python<'_>,
        start: PyReadonlyArray1<'_, i64>,
        columns: PyReadonlyArray1<'_, u32>,
        values: PyReadonlyArray1<'_, f64>,
        interior: &Interior,
    ) -> Answer<Self> {
        let start: Vec<usize> = start.as_slice()?.iter().map(|&s| usize::try_from(s).unwrap_or(usize::MAX)).collect();
        let operator = StrainOperator { start: &start, columns: columns.as_slice()?, values: values.as_slice()? };
        let interior = interior.interior.clone();
        let measure = py.detach(|| strain::StrainMeasure::of_elements(operator, interior))?;
        Ok(Self { measure: Arc::new(measure) })
    }

    /// By the surface of a store alone.
    #[staticmethod]
    fn of_surface(py: Python<'_>, green: &GreenCore) -> Self {
        Self { measure: Arc::new(py.detach(|| strain::StrainMeasure::of_surface(&green.green.surface))) }
    }

    /// Strain per newton on up to four patches, at the places that decide the limit.
    fn prepare(
        &self,
        py: Python<'_>,
        green: &GreenCore,
        patches: Vec<PatchArrays<'_>>,
        limit: f64,
    ) -> Answer<StrainResponse> {
        let slices = patches
            .iter()
            .map(|(nodes, weights)| Ok((nodes.as_slice()?, weights.as_slice()?)))
            .collect::<Answer<Vec<_>>>()?;
        let response = py.detach(|| self.measure.prepare(&green.green, &slices, limit).map(Box::new))?;
        Ok(StrainResponse { response })
    }

    /// Displacement gradients at all places: first entry of each place and the end (p + 1), node (k) and coefficients
    /// (3k), 1/m, of each entry.
    #[allow(clippy::type_complexity)] // three arrays read once
    fn gradients<'py>(
        &self,
        py: Python<'py>,
    ) -> (Bound<'py, PyArray1<u64>>, Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<f64>>) {
        let (start, nodes, coefficients) = self.measure.gradients().parts();
        let start: Vec<u64> = start.iter().map(|&entry| entry as u64).collect();
        let coefficients = coefficients.as_flattened().to_vec();
        (start.into_pyarray(py), nodes.to_vec().into_pyarray(py), coefficients.into_pyarray(py))
    }

    /// Largest strain of displacements (3s) of the surface, m.
    fn largest(&self, py: Python<'_>, displacements: PyReadonlyArray1<'_, f64>) -> Answer<f64> {
        let displacements = displacements.as_slice()?;
        Ok(py.detach(|| self.measure.largest(displacements))?)
    }
}

#[pymethods]
impl StrainResponse {
    /// Number of places that are watched.
    #[getter]
    fn places(&self) -> usize {
        self.response.place_count()
    }

    /// Largest share in [0, 1] of forces (N), one on each patch, within a limit.
    fn share(&self, forces: Vec<[f64; 3]>, limit: f64) -> Answer<f64> {
        Ok(self.response.share(&self.all(&forces)?, limit))
    }

    /// Largest strain at the places under forces (N), one on each patch.
    fn largest(&self, forces: Vec<[f64; 3]>) -> Answer<f64> {
        Ok(self.response.largest(&self.all(&forces)?))
    }
}

impl StrainResponse {
    /// Forces of all contacts that can be watched.
    fn all(&self, forces: &[[f64; 3]]) -> palpate_core::Result<[DVec3; MAX_CONTACTS_WATCHED]> {
        if forces.len() != self.response.contacts() {
            let (count, given) = (self.response.contacts(), forces.len());
            return Err(Error::Invalid(format!("a force for each of {count} contacts is needed, got {given}")));
        }
        Ok(std::array::from_fn(|c| forces.get(c).map_or(DVec3::ZERO, |&f| f.into())))
    }
}

/// Displacement (m) of a patch that keeps the strain within `limit`, from weights (k; zero of supported nodes), positions
/// (3k), m, and the mean length of the surface's edges, m.
#[pyfunction]
pub fn provisional_displacement(
    weights: PyReadonlyArray1<'_, f64>,
    positions: PyReadonlyArray1<'_, f64>,
    floor: f64,
    limit: f64,
) -> Answer<f64> {
    let positions: Vec<DVec3> = positions.as_slice()?.chunks_exact(3).map(DVec3::from_slice).collect();
    Ok(strain::provisional_displacement(weights.as_slice()?, &positions, floor, limit))
}

/// Nodes (ranks, k) and weights (k) of a patch of radius `radius` (m) around the surface point closest to `point` (m).
#[pyfunction]
#[allow(clippy::type_complexity)] // two arrays; naming them would need a class nobody else uses
pub fn contact_patch<'py>(
    py: Python<'py>,
    green: &GreenCore,
    point: [f64; 3],
    radius: f64,
) -> Answer<(Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<f64>>)> {
    let surface = &green.green.surface;
    let mut patch = Patch::default();
    let query = SurfaceQuery::new(surface)?;
    if let Some(centre) = query.closest(surface, point.into()) {
        let (geometry, mut scratch) = (PatchGeometry::new(surface), PatchScratch::new(surface));
        patch_weights(surface, &geometry, &centre, radius, &mut scratch, &mut patch)
            .map_err(|refusal| Error::Invalid(refusal.message().into()))?;
    }
    Ok((patch.nodes().to_vec().into_pyarray(py), patch.weights().to_vec().into_pyarray(py)))
}
