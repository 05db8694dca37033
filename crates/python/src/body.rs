//! Matrices of a body.

use glam::DVec3;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use palpate_core::fem::{self, Isotropic, SymmetricCsc};
use palpate_core::mesh::{Faces, TetMesh, Tets};
use palpate_core::{Error, Result};
use pyo3::prelude::*;

use crate::errors::Answer;

/// Column starts, rows and values of a compressed sparse matrix.
type CscArrays<'py> = (Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<f64>>);

/// Rows of an `(n, 3)` array as vectors.
pub fn vectors(array: &PyReadonlyArray2<'_, f64>) -> Result<Vec<DVec3>> {
    let view = array.as_array();
    if view.ncols() != 3 {
        return Err(Error::Invalid(format!("positions must have 3 columns, got {}", view.ncols())));
    }
    Ok(view.rows().into_iter().map(|r| DVec3::new(r[0], r[1], r[2])).collect())
}

/// Rows of an `(m, N)` array of indices.
fn index_rows<const N: usize>(array: &PyReadonlyArray2<'_, u32>) -> Result<Vec<[u32; N]>> {
    let view = array.as_array();
    if view.ncols() != N {
        return Err(Error::Invalid(format!("connectivity must have {N} columns, got {}", view.ncols())));
    }
    Ok(view.rows().into_iter().map(|r| std::array::from_fn(|k| r[k])).collect())
}

/// Elements from an `(m, 4)` or `(m, 10)` array.
pub fn tets(array: &PyReadonlyArray2<'_, u32>) -> Result<Tets> {
    match array.as_array().ncols() {
        10 => Ok(Tets::Quadratic(index_rows(array)?)),
        _ => Ok(Tets::Linear(index_rows(array)?)),
    }
}

/// Faces from a `(k, 3)` or `(k, 6)` array.
pub fn faces(array: &PyReadonlyArray2<'_, u32>) -> Result<Faces> {
    match array.as_array().ncols() {
        6 => Ok(Faces::Quadratic(index_rows(array)?)),
        _ => Ok(Faces::Linear(index_rows(array)?)),
    }
}

/// Materials from an `(m, 3)` array of Young's modulus (Pa), Poisson's ratio and density (kg/m^3).
pub fn materials(array: &PyReadonlyArray2<'_, f64>, elements: usize) -> Result<Vec<Isotropic>> {
    let view = array.as_array();
    if view.dim() != (elements, 3) {
        return Err(Error::Invalid(format!("materials must have shape ({elements}, 3), got {:?}", view.dim())));
    }
    view.rows().into_iter().map(|r| Isotropic::new(r[0], r[1], r[2])).collect()
}

/// Copy of a one-dimensional index array.
pub fn indices(array: &PyReadonlyArray1<'_, u32>) -> Vec<u32> {
    array.as_array().iter().copied().collect()
}

fn to_arrays(py: Python<'_>, matrix: SymmetricCsc) -> CscArrays<'_> {
    let start: Vec<i64> = matrix.column_start.iter().map(|&s| s as i64).collect();
    (start.into_pyarray(py), matrix.rows.into_pyarray(py), matrix.values.into_pyarray(py))
}

fn assembled<'py>(
    py: Python<'py>,
    nodes: &PyReadonlyArray2<'py, f64>,
    tets: &PyReadonlyArray2<'py, u32>,
    material: &PyReadonlyArray2<'py, f64>,
    assemble: impl FnOnce(&TetMesh, &[Isotropic]) -> SymmetricCsc + Send,
) -> Answer<CscArrays<'py>> {
    let mesh = TetMesh::new(vectors(nodes)?, self::tets(tets)?)?;
    let materials = materials(material, mesh.tets.len())?;
    let matrix = py.detach(|| assemble(&mesh, &materials));
    Ok(to_arrays(py, matrix))
}

/// Stiffness matrix (3n, 3n), N/m.
#[pyfunction]
pub fn stiffness<'py>(
    py: Python<'py>,
    nodes: PyReadonlyArray2<'py, f64>,
    tets: PyReadonlyArray2<'py, u32>,
    material: PyReadonlyArray2<'py, f64>,
) -> Answer<CscArrays<'py>> {
    assembled(py, &nodes, &tets, &material, fem::stiffness)
}

/// Mass matrix (3n, 3n), kg.
#[pyfunction]
pub fn mass<'py>(
    py: Python<'py>,
    nodes: PyReadonlyArray2<'py, f64>,
    tets: PyReadonlyArray2<'py, u32>,
    material: PyReadonlyArray2<'py, f64>,
    lumped: bool,
) -> Answer<CscArrays<'py>> {
    assembled(py, &nodes, &tets, &material, |mesh, materials| fem::mass(mesh, materials, lumped))
}

/// Least and largest determinant (2m) of the map from the reference element, m^3; not positive where it is inverted.
#[pyfunction]
pub fn determinant_ranges<'py>(
    py: Python<'py>,
    nodes: PyReadonlyArray2<'py, f64>,
    tets: PyReadonlyArray2<'py, u32>,
) -> Answer<Bound<'py, PyArray1<f64>>> {
    let ranges = self::tets(&tets)?.determinant_ranges(&vectors(&nodes)?)?;
    Ok(ranges.as_flattened().to_vec().into_pyarray(py))
}

/// Volume of each element (m), m^3.
#[pyfunction]
pub fn volumes<'py>(
    py: Python<'py>,
    nodes: PyReadonlyArray2<'py, f64>,
    tets: PyReadonlyArray2<'py, u32>,
) -> Answer<Bound<'py, PyArray1<f64>>> {
    Ok(self::tets(&tets)?.volumes(&vectors(&nodes)?)?.into_pyarray(py))
}
