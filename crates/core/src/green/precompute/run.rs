//! The whole precomputation by one process: in memory, or into a file that survives an interruption.

use std::sync::{Arc, Mutex};

use super::arrangement::Arrangement;
use super::claim::Claim;
use super::column_store::{ColumnStore, PreviousWork, Target, geometry};
use super::columns::Columns;
use super::factorization::{RequestedPrecision, fitting};
use super::growth::Growth;
use super::mirror::Mirror;
use super::number::Number;
use super::panels::Panels;
use super::plan::{Bounds, Plan, SymbolicAnalysis};
use super::problem::Problem;
use super::scales::magnitudes;
use super::solving::{Work, solve};
use super::stages::stages;
use super::tasks::{Phase, Progress, report_progress, task_failed};
use crate::green::entries::Entries;
use crate::green::function::GreensFunction;
use crate::green::numbers::Numbers;
use crate::green::precision::Precision;
use crate::{Error, Result};

/// Counts operations and memory of a precomputation. Without a format (`None`) they are those of the best one that the memory
/// allows.
///
/// # Errors
/// A bound of memory (bytes) that cannot be kept.
pub fn plan(problem: &Problem, precision: Option<Precision>, memory: Option<usize>) -> Result<Plan> {
    let prepared = SymbolicAnalysis::new(problem, &|_| {})?;
    let bounds = Bounds { memory, in_memory: false };
    let (precision, route) = match precision {
        Some(precision) => (precision, prepared.plan_blocks(precision, bounds)?),
        None => fitting(&prepared, bounds)?.pop().ok_or_else(task_failed)?,
    };
    prepared.plan(problem, precision, &route)
}

/// Solves the reference problem for every touchable dof, in memory.
///
/// # Errors
/// A singular stiffness, or [`Error::Interrupted`].
pub fn precompute(problem: &Problem, precision: Precision, progress: Progress<'_>) -> Result<GreensFunction> {
    let (requested, columns) = (RequestedPrecision::Named(precision), 3 * problem.touch.len());
    let columns = Columns::new(problem, requested, None, true, &|_| {}, &|| report_progress(progress, 0, columns))?;
    let mut green = geometry(problem, &columns.parts.layout, &columns.measurement, requested)?;
    match precision {
        Precision::F64 => collect::<f64>(columns, &mut green, progress)?,
        Precision::F16 | Precision::F32 => collect::<f32>(columns, &mut green, progress)?,
    }
    Ok(green)
}

fn collect<T: Number>(columns: Columns, green: &mut GreensFunction, progress: Progress<'_>) -> Result<()> {
    let (precision, tasks) = (green.precision(), columns.tasks);
    let blocks = columns.parts.layout.blocks(columns.measurement.width);
    let panels = Panels::<T>::in_memory(blocks.len());
    let all: Vec<usize> = (0..blocks.len()).collect();
    let put = |block: usize, panel: &[u8]| panels.put(block, bytemuck::cast_slice(panel));
    solve(&columns, &blocks, (&all, 0), Work { begin: &|_| true, put: &put }, progress)?;
    let parts = columns.parts.clone();
    let arrangement = Arrangement::new(&green.surface.positions, &parts.layout, parts.layout.columns);
    // The factor's memory is free for the operator's.
    drop(columns);
    let mirror = Mirror { parts: &parts, arrangement: &arrangement, blocks: &blocks, panels: &panels, tasks };
    let magnitude = magnitudes(&mirror)?;
    let mut numbers = Numbers::try_zeros(precision, parts.layout.columns * green.rows)?;
    let bytes = green.rows * precision.bytes();
    let places: Vec<Mutex<&mut [u8]>> = numbers.bytes_mut().chunks_mut(bytes).map(Mutex::new).collect();
    mirror.columns(precision, &magnitude, &|column, bytes| {
        places[column].lock().map_err(|_| task_failed())?.copy_from_slice(bytes);
        Ok(())
    })?;
    drop(places);
    green.entries = Entries::new(arrangement.node_order.clone(), &green.row_is_fixed, magnitude, numbers, None);
    Ok(())
}

/// Solves the reference problem into a file, without ever holding the operator.
///
/// Finished blocks are stored in the file of the claim. An interrupted computation of the same problem is resumed, with the same
/// bits as without the interruption if the same nodes are to be touched first. In stages, the file is a complete store of the nodes
/// that are ready from the end of the first on.
///
/// # Errors
/// A singular stiffness, a bound that cannot be kept (nothing is left behind), the operating system's, finished blocks
/// that another program has changed, or [`Error::Interrupted`] (the finished blocks are left behind, if there are any).
pub fn precompute_to(
    claim: Arc<Claim>,
    problem: &Problem,
    target: &Target<'_>,
    growth: &Growth<'_>,
    found: &mut dyn FnMut(PreviousWork),
    progress: Progress<'_>,
) -> Result<()> {
    let all = 3 * problem.touch.len();
    let mut columns = Columns::new(problem, target.precision, target.memory, false, target.phase, &|| {
        report_progress(progress, 0, all)
    })?;
    let tasks = columns.tasks;
    let stages = stages(&problem.surface_positions(), &problem.touch, growth.first, 0);
    let mut store = ColumnStore::open_in_stages(claim, problem, &columns.parts, &stages, &columns.measurement, target)?;
    columns.arrange(Arc::clone(&store.parts));
    found(store.previous);
    (target.phase)(Phase::Columns);
    let solved = growth.grow(problem, &mut columns, &mut store, progress);
    drop(columns);
    (target.phase)(Phase::Store);
    let result = solved.and_then(|()| store.finish(tasks, progress));
    // Finished blocks stay after an interruption, a full disk or damage; otherwise the file is removed.
    if !matches!(result, Err(Error::Interrupted | Error::Io { .. } | Error::Store { .. })) || store.done() == 0 {
        store.discard();
    }
    result
}
