//! Taylor series of bodies beyond small strain.

use std::path::PathBuf;

use numpy::{IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray1};
use palpate_core::Error;
use palpate_core::contact::local::{SERIES_FIELDS, StrainLaw};
use palpate_core::series::SeriesFile;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::errors::to_python;
use crate::green::problem;
use crate::interruptible::run_interruptible;
use crate::scene::strain_law;

/// Laws by name and ratios (k), and the law of each element (m).
pub type LawArguments<'py> = (Vec<(String, f64, f64)>, PyReadonlyArray1<'py, u32>);

fn laws((known, of_element): &LawArguments<'_>) -> palpate_core::Result<Vec<StrainLaw>> {
    let unknown = |name: &str| Error::Invalid(format!("there is no law '{name}'"));
    let known: Vec<StrainLaw> = known
        .iter()
        .map(|(name, first, second)| strain_law(name, *first, *second).ok_or_else(|| unknown(name)))
        .collect::<palpate_core::Result<_>>()?;
    let law = |&rank: &u32| known.get(rank as usize).copied().ok_or_else(|| unknown(&rank.to_string()));
    of_element.as_array().iter().map(law).collect()
}

/// Coefficients and positions of the fans.
type SeriesArrays<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

/// Coefficients (fans, 8) of the higher orders of a body's displacement for tools of a radius, m, and positions (fans, 3), m, from the
/// file beside its store. If there is none, it is computed and written; `progress` is called with places done and all of them.
#[pyfunction]
#[pyo3(signature = (arguments, law_arguments, radius, store, green_key, progress=None))]
pub fn series<'py>(
    py: Python<'py>,
    arguments: &Bound<'py, PyTuple>,
    law_arguments: LawArguments<'py>,
    radius: f64,
    store: PathBuf,
    green_key: &str,
    progress: Option<Py<PyAny>>,
) -> PyResult<SeriesArrays<'py>> {
    let laws = laws(&law_arguments).map_err(|e| to_python(py, e))?;
    let file = SeriesFile::beside(&store, green_key, &laws, radius);
    let found = match file.load() {
        Some(found) => found,
        None => {
            let problem = problem(arguments)?;
            run_interruptible(py, 0, progress.as_ref(), |note| file.compute(&problem, &laws, radius, note))?
        }
    };
    let fans = found.fields.len();
    let fields = found.fields.into_flattened().into_pyarray(py).reshape([fans, SERIES_FIELDS])?;
    Ok((fields, found.positions.into_flattened().into_pyarray(py).reshape([fans, 3])?))
}
