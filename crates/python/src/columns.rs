//! Precomputation by several processes: some solve columns, one writes the store.

use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, PoisonError};

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use palpate_core::green::accuracy::Accuracy;
use palpate_core::green::{
    AssembledProblem, ColumnStore as Store, Columns, Measurement, Precision, Problem, Target, TaskMemory, checksum,
};
use palpate_core::{Error, Result};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTuple};

use crate::allocator::require_scratch_of_products;
use crate::claim::{StoreClaim, claimed};
use crate::errors::Answer;
use crate::green::{problem, requested};
use crate::interruptible::{locked, on_threads, run_interruptible};

/// What a store needs to know of a factor: format, columns of a block, accuracy, free response (rows).
type MeasurementTuple<'py> = (&'static str, usize, [f64; 5], Bound<'py, PyArray1<f64>>);
type MeasurementArguments<'py> = (String, usize, [f64; 5], PyReadonlyArray1<'py, f64>);

/// A factored problem: any block of its columns, from any thread.
#[pyclass(frozen, module = "palpate._native")]
pub struct ColumnJob {
    columns: Columns,
    working: Mutex<TaskMemories>,
    returned: Condvar,
}

/// Memory of the tasks, each for blocks of up to some width.
struct TaskMemories {
    free: Vec<(usize, TaskMemory)>,
    /// How many more may be made.
    allowed: usize,
}

impl ColumnJob {
    /// Memory for a block, once as few others are being solved as the bound of memory allows.
    fn take(&self, width: usize) -> TaskMemory {
        let mut memories = locked(&self.working);
        loop {
            if let Some((room, working)) = memories.free.pop() {
                return if room >= width { working } else { self.columns.task_memory(width) };
            }
            if memories.allowed > 0 {
                memories.allowed -= 1;
                return self.columns.task_memory(width);
            }
            memories = self.returned.wait(memories).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn solved(&self, block: usize, width: usize) -> Result<(Vec<u8>, [u8; 32])> {
        let blocks = self.columns.parts.layout.blocks(width);
        let missing = || Error::Invalid(format!("there is no block {block} of {width} columns"));
        let mut working = self.take(width);
        let panel = blocks.get(block).ok_or_else(missing).and_then(|block| {
            let panel = self.columns.solve(block, &mut working)?;
            Ok((panel.to_vec(), checksum(panel)))
        });
        locked(&self.working).free.push((width, working));
        self.returned.notify_one();
        panel
    }
}

#[pymethods]
impl ColumnJob {
    /// Factorises a problem on some threads, within `memory` bytes; without a name the format is the cheapest whose typical
    /// contacts are right to `within`.
    #[new]
    #[pyo3(signature = (arguments, precision_name, within, threads, memory=None))]
    fn new(
        py: Python<'_>,
        arguments: &Bound<'_, PyTuple>,
        precision_name: Option<&str>,
        within: f64,
        threads: usize,
        memory: Option<usize>,
    ) -> Answer<Self> {
        let problem = problem(arguments)?;
        let wanted = requested(precision_name, within)?;
        require_scratch_of_products()?;
        let factored = || Columns::new(&problem, wanted, memory, false, &|_| {}, &|| Ok(()));
        let columns = on_threads(py, threads, factored)?;
        let working = Mutex::new(TaskMemories { free: Vec::new(), allowed: columns.tasks });
        Ok(Self { columns, working, returned: Condvar::new() })
    }

    /// What the store needs to know.
    #[getter]
    fn measured<'py>(&self, py: Python<'py>) -> MeasurementTuple<'py> {
        let Measurement { precision, accuracy, response, width } = &self.columns.measurement;
        (precision.name(), *width, accuracy.to_array(), response.clone().into_pyarray(py))
    }

    /// Hash of the order of rows and columns.
    #[getter]
    fn order<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.columns.parts.order())
    }

    /// The panel of a block of columns, `width` of which are a block, and its checksum.
    fn solve<'py>(
        &self,
        py: Python<'py>,
        block: usize,
        width: usize,
    ) -> Answer<(Bound<'py, PyBytes>, Bound<'py, PyBytes>)> {
        let (panel, sum) = py.detach(|| self.solved(block, width))?;
        Ok((PyBytes::new(py, &panel), PyBytes::new(py, &sum)))
    }
}

/// Rows and columns of a problem, without a factor.
#[pyclass(frozen, module = "palpate._native")]
pub struct ColumnLayout {
    problem: Problem,
    parts: Arc<AssembledProblem>,
}

#[pymethods]
impl ColumnLayout {
    /// Assembles and orders.
    #[new]
    fn new(py: Python<'_>, arguments: &Bound<'_, PyTuple>) -> Answer<Self> {
        let problem = problem(arguments)?;
        let parts = py.detach(|| AssembledProblem::new(&problem))?;
        Ok(Self { problem, parts: Arc::new(parts) })
    }

    /// Hash of the order of rows and columns.
    #[getter]
    fn order<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.parts.order())
    }
}

/// Blocks of columns on their way into a store.
#[pyclass(frozen, module = "palpate._native")]
pub struct ColumnStore {
    store: Mutex<Store>,
}

#[pymethods]
impl ColumnStore {
    /// Begins the store at `path`, or goes on with it; `precision_name` as asked for, `measured` by a [`ColumnJob`].
    #[new]
    #[pyo3(signature = (layout, precision_name, within, measured, path, description, claim=None))]
    #[allow(clippy::too_many_arguments)] // one call of one caller
    fn new(
        py: Python<'_>,
        layout: &ColumnLayout,
        precision_name: Option<&str>,
        within: f64,
        measured: MeasurementArguments<'_>,
        path: PathBuf,
        description: &str,
        claim: Option<&StoreClaim>,
    ) -> Answer<Self> {
        let (name, width, accuracy, response) = measured;
        let unusable = || Error::Invalid(format!("unusable blocks of {width} columns in '{name}'"));
        let precision = Precision::parse(&name).filter(|_| width > 0).ok_or_else(unusable)?;
        let accuracy = Accuracy::from_slice(&accuracy).ok_or_else(unusable)?;
        let measurement = Measurement { precision, accuracy, response: response.as_array().to_vec(), width };
        let (precision, claim) = (requested(precision_name, within)?, claimed(claim, path)?);
        let target = Target { precision, memory: None, description, phase: &|_| {} };
        let open = || Store::open(claim, &layout.problem, Arc::clone(&layout.parts), &measurement, &target);
        let store = py.detach(open)?;
        Ok(Self { store: Mutex::new(store) })
    }

    /// Numbers of the blocks that are not there.
    fn missing(&self) -> Vec<usize> {
        locked(&self.store).missing()
    }

    /// Columns in all.
    #[getter]
    fn columns(&self) -> usize {
        locked(&self.store).columns()
    }

    /// Columns that are there.
    #[getter]
    fn done(&self) -> usize {
        locked(&self.store).done()
    }

    /// Whether something that belongs to another computation was thrown away.
    #[getter]
    fn discarded(&self) -> bool {
        locked(&self.store).previous.discarded
    }

    /// Keeps the panel of a block; whether it fits its checksum.
    fn put(&self, py: Python<'_>, block: usize, panel: &[u8], sum: &[u8]) -> Answer<bool> {
        Ok(py.detach(|| locked(&self.store).receive(block, panel, sum))?)
    }

    /// Writes the store, by all threads; `progress` as everywhere.
    #[pyo3(signature = (progress=None))]
    fn finish(&self, py: Python<'_>, progress: Option<Py<PyAny>>) -> Answer<()> {
        let total = self.columns();
        run_interruptible(py, total, progress.as_ref(), |note| {
            locked(&self.store).finish(rayon::current_num_threads(), note)
        })
    }
}
