//! Closest points of a surface.

use glam::DVec3;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray2};
use palpate_core::Error;
use palpate_core::contact::{SurfaceQuery, is_thin_at};
use palpate_core::mesh::Surface;
use pyo3::prelude::*;

use crate::body::{faces, vectors};
use crate::errors::Answer;

/// A closed surface that can be searched.
#[pyclass(module = "palpate._native", frozen)]
pub struct SurfaceSearch {
    surface: Surface,
    query: SurfaceQuery,
}

#[pymethods]
impl SurfaceSearch {
    /// From positions (n, 3) and triangles (k, 3) or faces of six nodes (k, 6).
    #[new]
    fn new(nodes: PyReadonlyArray2<'_, f64>, triangles: PyReadonlyArray2<'_, u32>) -> Answer<Self> {
        let surface = Surface::new(vectors(&nodes)?, faces(&triangles)?)?;
        let query = SurfaceQuery::new(&surface)?;
        Ok(Self { surface, query })
    }

    /// Closest points (3p) of the surface to `points` (p, 3), in the unit of the positions.
    fn closest<'py>(&self, py: Python<'py>, points: PyReadonlyArray2<'py, f64>) -> Answer<Bound<'py, PyArray1<f64>>> {
        let find = |point: DVec3| {
            let found = self.query.closest(&self.surface, point);
            found.map(|found| found.position).ok_or_else(|| Error::Invalid("a point is not finite".into()))
        };
        let points = vectors(&points)?;
        let found = py.detach(|| points.into_iter().map(find).collect::<Result<Vec<_>, _>>())?;
        Ok(found.iter().flat_map(DVec3::to_array).collect::<Vec<_>>().into_pyarray(py))
    }

    /// Whether the body ends within a thickness below a point of its surface, along the inward normal.
    fn is_thin_at(&self, point: [f64; 3], normal: [f64; 3], thickness: f64) -> bool {
        is_thin_at(&self.query, &self.surface, point.into(), normal.into(), thickness)
    }
}
