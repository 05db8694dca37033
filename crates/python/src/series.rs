//! Taylor series of bodies beyond small strain.

use std::path::PathBuf;
use std::sync::{Arc, Mutex};

use glam::DVec3;
use numpy::{IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray1};
use palpate_core::Error;
use palpate_core::contact::SeriesFields;
use palpate_core::contact::local::{self, SERIES_FIELDS, StrainLaw};
use palpate_core::green::checksum;
use palpate_core::series::{self, HyperelasticBody, SeriesPlan};
use palpate_core::simulation::KnownSeries;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTuple};

use crate::errors::Answer;
use crate::green::problem;
use crate::interruptible::{locked, on_threads, run_interruptible};

/// Laws by name and ratios (k), and the law of each element (m).
pub type LawArguments<'py> = (Vec<(String, f64, f64)>, PyReadonlyArray1<'py, u32>);

/// A law by its name and two ratios of its constants.
fn strain_law(name: &str, first: f64, second: f64) -> Option<StrainLaw> {
    Some(match name {
        "linear" => StrainLaw::Linear,
        "neo-hookean" => StrainLaw::NeoHookean,
        "mooney-rivlin" => StrainLaw::MooneyRivlin { share: first },
        "yeoh" => StrainLaw::Yeoh { quadratic: first, cubic: second },
        _ => return None,
    })
}

/// Coefficients of a sphere's contact at finite strain of a material, by its law, two ratios of its constants and Poisson's ratio;
/// `None` outside of the table.
#[pyfunction]
pub fn strain_terms(law: &str, first: f64, second: f64, poisson: f64) -> Option<[f64; 3]> {
    let law = strain_law(law, first, second)?;
    law.is_known(poisson).then(|| local::strain_terms(&law, poisson))
}

fn laws((known, of_element): &LawArguments<'_>) -> palpate_core::Result<Vec<StrainLaw>> {
    let unknown = |name: &str| Error::Invalid(format!("there is no law '{name}'"));
    let known: Vec<StrainLaw> = known
        .iter()
        .map(|(name, first, second)| strain_law(name, *first, *second).ok_or_else(|| unknown(name)))
        .collect::<palpate_core::Result<_>>()?;
    let law = |&rank: &u32| known.get(rank as usize).copied().ok_or_else(|| unknown(&rank.to_string()));
    of_element.as_array().iter().map(law).collect()
}

/// Coefficients of the higher orders of a body's displacement for spheres of one radius, as far as they are computed.
#[pyclass(frozen, module = "palpate._native")]
pub struct Series {
    series: series::Series,
}

impl Series {
    /// For the loop.
    pub(crate) fn for_loop(&self, radius: f64) -> Arc<KnownSeries> {
        Arc::new(KnownSeries::new(radius, self.series.at_fans(), self.series.known.clone()))
    }
}

#[pymethods]
impl Series {
    /// Reads any file of series, of whatever body.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> Answer<Self> {
        Ok(Self { series: py.detach(|| series::SeriesFile::read(&path))? })
    }

    /// Coefficients (fans, 9) at the smooth sides of the surface nodes; zero where they are not known.
    #[getter]
    fn fields<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let fields = py.detach(|| self.series.at_fans());
        let fans = fields.len();
        fields.into_flattened().into_pyarray(py).reshape([fans, SERIES_FIELDS])
    }

    /// Positions (fans, 3) of the sides, m.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let sides = &self.series.layout.sides;
        let positions: Vec<f64> = sides.iter().flat_map(|side| side.position.to_array()).collect();
        positions.into_pyarray(py).reshape([sides.len(), 3])
    }

    /// How many places are known.
    #[getter]
    fn done(&self) -> usize {
        self.series.done()
    }

    /// How many places there are.
    #[getter]
    fn places(&self) -> usize {
        self.series.layout.places.len()
    }

    /// Whether all places are known.
    #[getter]
    fn is_complete(&self) -> bool {
        self.series.is_complete()
    }

    /// Whether each block of places is known.
    #[getter]
    fn known(&self) -> Vec<bool> {
        self.series.known.clone()
    }

    /// The same series with only some of its blocks; `None` if it has not all of them.
    fn only(&self, known: Vec<bool>) -> Option<Self> {
        self.series.only(&known).map(|series| Self { series })
    }
}

/// The file of a series.
#[pyclass(frozen, module = "palpate._native")]
pub struct SeriesFile {
    file: Arc<series::SeriesFile>,
    laws: Arc<[StrainLaw]>,
    radius: f64,
    near: Mutex<Option<DVec3>>,
}

#[pymethods]
impl SeriesFile {
    /// Beside the store of a body with such a key, for spheres of a radius, m.
    #[new]
    fn new(law_arguments: LawArguments<'_>, radius: f64, store: PathBuf, green_key: &str) -> Answer<Self> {
        let laws = laws(&law_arguments)?;
        let file = series::SeriesFile::beside(&store, green_key, &laws, radius);
        Ok(Self { file: Arc::new(file), laws: laws.into(), radius, near: Mutex::new(None) })
    }

    /// Its path.
    #[getter]
    fn path(&self) -> PathBuf {
        self.file.path().to_owned()
    }

    /// Has the places near a point, m, be computed first from now on.
    fn set_near(&self, point: [f64; 3]) {
        *locked(&self.near) = Some(point.into());
    }

    /// What is stored, complete or not; `None` for a file that is missing, damaged or of another body.
    fn load(&self, py: Python<'_>) -> Option<Series> {
        py.detach(|| self.file.load()).map(|series| Series { series })
    }

    /// Computes and stores what is not stored yet; `progress` is called with the known places and all of them.
    #[pyo3(signature = (arguments, progress=None))]
    fn compute(&self, py: Python<'_>, arguments: &Bound<'_, PyTuple>, progress: Option<Py<PyAny>>) -> Answer<Series> {
        let problem = Arc::new(problem(arguments)?);
        let near = || *locked(&self.near);
        let computed = run_interruptible(py, 0, progress.as_ref(), |note| {
            self.file.compute(&SeriesPlan::new(problem.clone(), self.laws.clone(), self.radius)?, &near, note)
        });
        computed.map(|series| Series { series })
    }

    /// Places, those that are not stored yet, the points of quadrature at which each is summed, and the bytes of the whole file.
    fn count(&self, py: Python<'_>, arguments: &Bound<'_, PyTuple>) -> Answer<(usize, usize, usize, usize)> {
        let plan = self.plan(py, arguments)?;
        let count = || {
            let layout = plan.layout();
            let (places, bytes) = (layout.places.len(), series::SeriesFile::size(&layout));
            (places, places - self.file.resume(layout).done(), plan.points(), bytes)
        };
        Ok(py.detach(count))
    }

    /// What is stored, to be completed by blocks from elsewhere.
    fn gathering(&self, py: Python<'_>, arguments: &Bound<'_, PyTuple>) -> Answer<GatheredSeries> {
        let plan = self.plan(py, arguments)?;
        let series = py.detach(|| self.file.resume(plan.layout()));
        Ok(GatheredSeries { file: self.file.clone(), series: Mutex::new(series) })
    }
}

impl SeriesFile {
    fn plan(&self, py: Python<'_>, arguments: &Bound<'_, PyTuple>) -> Answer<SeriesPlan> {
        let problem = Arc::new(problem(arguments)?);
        Ok(py.detach(|| SeriesPlan::new(problem, self.laws.clone(), self.radius))?)
    }
}

/// Blocks of a series on their way into its file.
#[pyclass(frozen, module = "palpate._native")]
pub struct GatheredSeries {
    file: Arc<series::SeriesFile>,
    series: Mutex<series::Series>,
}

#[pymethods]
impl GatheredSeries {
    /// Hash of the places in their order.
    #[getter]
    fn order<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &locked(&self.series).layout.order())
    }

    /// How many places are known.
    #[getter]
    fn done(&self) -> usize {
        locked(&self.series).done()
    }

    /// How many places there are.
    #[getter]
    fn places(&self) -> usize {
        locked(&self.series).layout.places.len()
    }

    /// Blocks that are not known.
    fn missing(&self) -> Vec<usize> {
        locked(&self.series).next(usize::MAX, None)
    }

    /// Adds the coefficients (k, 9) of a block, and stores all that is known if the file can be written; `false` for numbers of
    /// another block or with another checksum.
    fn put(&self, py: Python<'_>, block: usize, fields: &[u8], sum: &[u8]) -> bool {
        py.detach(|| {
            let mut series = locked(&self.series);
            let size = size_of_val(series.block(block));
            if fields.len() != size || checksum(fields)[..] != *sum {
                return false;
            }
            let mut numbers = vec![SeriesFields::default(); series.block(block).len()];
            bytemuck::cast_slice_mut(&mut numbers).copy_from_slice(fields);
            series.set(block, &numbers);
            // The result is the same if it cannot be written.
            drop(self.file.write(&series));
            true
        })
    }

    /// The series as far as it is known.
    fn known(&self) -> Series {
        Series { series: locked(&self.series).clone() }
    }
}

/// A factored body: the coefficients of any block of places, from any thread.
#[pyclass(frozen, module = "palpate._native")]
pub struct SeriesBlocks {
    plan: SeriesPlan,
    body: HyperelasticBody,
}

#[pymethods]
impl SeriesBlocks {
    /// Factorises a body on some threads.
    #[new]
    fn new(
        py: Python<'_>,
        arguments: &Bound<'_, PyTuple>,
        law_arguments: LawArguments<'_>,
        radius: f64,
        threads: usize,
    ) -> Answer<Self> {
        let problem = Arc::new(problem(arguments)?);
        let laws = laws(&law_arguments)?;
        on_threads(py, threads, || {
            let plan = SeriesPlan::new(problem, laws.into(), radius)?;
            plan.factorize().map(|body| Self { plan, body })
        })
    }

    /// Hash of the places in their order.
    #[getter]
    fn order<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.plan.layout().order())
    }

    /// Coefficients (k, 9) of a block, and their checksum.
    fn solve<'py>(&self, py: Python<'py>, block: usize) -> (Bound<'py, PyBytes>, Bound<'py, PyBytes>) {
        let fields = py.detach(|| self.plan.solve(&self.body, block));
        let bytes: &[u8] = bytemuck::cast_slice(fields.as_flattened());
        (PyBytes::new(py, bytes), PyBytes::new(py, &checksum(bytes)))
    }
}
