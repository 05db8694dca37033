//! Fewer triangles for drawing a large surface, by meshoptimizer (quadric errors; Garland and Heckbert, 1997).

use meshopt::{SimplifyOptions, VertexDataAdapter, simplify_with_locks};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use palpate_core::Error;
use pyo3::prelude::*;

use crate::body::vectors;
use crate::errors::Answer;

/// About `target` of the triangles (3k) with corners among `positions` (n, 3), and how far from the surface they lie, in the
/// unit of the positions. Corners stay where they are: every vertex of the answer is one of the given. Those of `kept` stay.
#[pyfunction]
pub fn simplified<'py>(
    py: Python<'py>,
    positions: PyReadonlyArray2<'py, f64>,
    triangles: PyReadonlyArray1<'py, u32>,
    locked: PyReadonlyArray1<'py, bool>,
    target: usize,
) -> Answer<(Bound<'py, PyArray1<u32>>, f32)> {
    let positions = vectors(&positions)?;
    let (corners, locked): (Vec<u32>, Vec<bool>) = (triangles.as_array().to_vec(), locked.as_array().to_vec());
    let found = py.detach(|| fewer(&positions, &corners, &locked, target))?;
    Ok((found.0.into_pyarray(py), found.1))
}

fn fewer(positions: &[glam::DVec3], corners: &[u32], locked: &[bool], target: usize) -> Result<(Vec<u32>, f32), Error> {
    if locked.len() != positions.len() || corners.iter().any(|&corner| corner as usize >= positions.len()) {
        return Err(Error::Invalid("the triangles to be drawn name vertices that are not there".into()));
    }
    let vertices: Vec<f32> = positions.iter().flat_map(|p| p.as_vec3().to_array()).collect();
    let adapter = VertexDataAdapter::new(bytemuck::cast_slice(&vertices), 12, 0)
        .map_err(|e| Error::Invalid(format!("the surface cannot be simplified: {e}")))?;
    let mut error = 0.0;
    // Even where the surface is flat: a tool dents it there as well.
    let options = SimplifyOptions::ErrorAbsolute | SimplifyOptions::Regularize;
    let found = simplify_with_locks(corners, &adapter, locked, 3 * target, f32::MAX, options, Some(&mut error));
    Ok((found, error))
}
