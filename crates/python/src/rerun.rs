//! Rerun of the inputs of a recording in another simulation.

use std::collections::BTreeMap;

use palpate_core::{Error, Result};
use palpate_recording::RecordingInMemory;
use palpate_scene::PreparedScene;
use palpate_servo::{RecordedInput, Settings, TickRecord};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::errors::Answer;
use crate::recording::header;
use crate::replay::{INTERRUPT_TICKS, Source, open};
use crate::simulation::SimulationCore;

/// Gives the inputs of a recording, up to the first tick that is missing, to a simulation with settings of its own: the
/// recording that comes of it. `progress` is called with the ticks done.
#[pyfunction]
pub fn rerun<'py>(
    py: Python<'py>,
    core: &SimulationCore,
    source: Source,
    about: BTreeMap<String, String>,
    progress: Option<Py<PyAny>>,
) -> Answer<Bound<'py, PyBytes>> {
    let ticks = open(source)?;
    let PreparedScene { model, limits, settings, strain, devices, scheduling, .. } = core.prepared(py);
    let settings = Settings { watch: None, ..settings };
    let mut file = RecordingInMemory::new(header(about, &model, scheduling.rate, false))?;
    let mut stopped = None;
    let inputs = ticks.enumerate().map_while(|(rank, record)| match record {
        Ok(record) if record.tick != rank as u64 => None,
        Ok(record) => {
            stopped = if rank.is_multiple_of(INTERRUPT_TICKS) {
                report_progress(progress.as_ref(), rank).err()
            } else {
                None
            };
            match &stopped {
                None => Some(Ok(record.input)),
                Some(_) => Some(Err(Error::Invalid("interrupted".into()))),
            }
        }
        Err(error) => Some(Err(error)),
    });
    let inputs: Inputs<'_> = Box::new(inputs);
    let each = |record: &TickRecord| file.push(record);
    let result = py.detach(|| palpate_servo::rerun(&model, &devices, limits, settings, &strain, inputs, each));
    if let Some(error) = stopped {
        return Err(error.into());
    }
    result?;
    let bytes = file.finish()?;
    Ok(PyBytes::new(py, &bytes))
}

type Inputs<'a> = Box<dyn Iterator<Item = Result<RecordedInput>> + Send + 'a>;

/// Checks for an interrupt and reports the ticks done.
fn report_progress(progress: Option<&Py<PyAny>>, done: usize) -> PyResult<()> {
    Python::attach(|py| {
        py.check_signals()?;
        progress.map_or(Ok(()), |progress| progress.call1(py, (done,)).map(|_| ()))
    })
}
