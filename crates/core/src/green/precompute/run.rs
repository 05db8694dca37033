//! The whole precomputation: plan, factor, columns, mirror; in memory or into a file that survives an interruption.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::block::Block;
use super::layout::Layout;
use super::made::{Made, Sweeps, Wanted, made};
use super::mirror::Mirror;
use super::number::Number;
use super::panels::Panels;
use super::partial::Partial;
use super::plan::{Bounds, Plan, Prepared, Route};
use super::problem::Problem;
use super::scales::{magnitudes, quantise};
use super::sweep::{Scratch, Sweep};
use super::system::System;
use super::tasks::{in_tasks, task_failed};
use crate::fem::SymmetricCsc;
use crate::green::entries::{Entries, scales};
use crate::green::function::GreensFunction;
use crate::green::key::FORMAT_VERSION;
use crate::green::numbers::Numbers;
use crate::green::precision::Precision;
use crate::green::store_writer::StoreWriter;
use crate::{Error, Result};

/// Told `(columns done, columns in all)` from any thread; `false` stops the computation.
pub type Progress<'a> = &'a (dyn Fn(usize, usize) -> bool + Sync);

/// Where the operator is to be written, and how.
pub struct Target<'a> {
    /// The store.
    pub path: &'a Path,
    /// Number format.
    pub precision: Wanted,
    /// Bytes that may be taken; `None`: any.
    pub memory: Option<usize>,
    /// What the file was made from, in JSON, for people.
    pub description: &'a str,
}

/// What [`precompute_to`] found where it was to write.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Found {
    /// Columns that an interrupted computation had finished.
    pub resumed: usize,
    /// It had left something that does not belong to this computation, which was thrown away.
    pub discarded: bool,
}

/// Counts what a precomputation would do and need; for a format that is yet to be chosen (`None`) those of the best one that
/// the memory allows.
///
/// # Errors
/// A bound of memory (bytes) that cannot be kept.
pub fn plan(problem: &Problem, precision: Option<Precision>, memory: Option<usize>) -> Result<Plan> {
    let prepared = Prepared::new(problem)?;
    let bounds = Bounds { memory, in_memory: false, choosing: precision.is_none() };
    let (precision, route) = match precision {
        Some(precision) => (precision, prepared.route(precision, bounds)?),
        None => {
            let mut best = prepared.route(Precision::F16, bounds).map(|route| (Precision::F16, route));
            for precision in [Precision::F32, Precision::F64] {
                best = prepared.route(precision, bounds).map(|route| (precision, route)).or(best);
            }
            best?
        }
    };
    prepared.plan(problem, precision, &route)
}

/// Solves the reference problem for every touchable dof, in memory.
///
/// # Errors
/// A singular stiffness, or [`Error::Interrupted`].
pub fn precompute(problem: &Problem, precision: Precision, progress: Progress<'_>) -> Result<GreensFunction> {
    let (wanted, columns) = (Wanted::Named(precision), 3 * problem.touch.len());
    let mut made = made(problem, wanted, None, true, &|| go_on(progress, 0, columns))?;
    let mut green = geometry(problem, &mut made, wanted)?;
    match split(made) {
        (Sweeps::Single(sweep), parts) => collect::<f32, f32>(problem, parts, sweep, &mut green, progress)?,
        (Sweeps::Double(sweep), parts) if precision == Precision::F64 => {
            collect::<f64, f64>(problem, parts, sweep, &mut green, progress)?;
        }
        (Sweeps::Double(sweep), parts) => collect::<f64, f32>(problem, parts, sweep, &mut green, progress)?,
    }
    Ok(green)
}

fn collect<C: Number, T: Number>(
    problem: &Problem,
    parts: Parts,
    sweep: Sweep<C>,
    green: &mut GreensFunction,
    progress: Progress<'_>,
) -> Result<()> {
    let precision = green.precision();
    let panels = Panels::in_memory(parts.route.blocks.len());
    let solved = solve::<C, T>(problem, parts, sweep, panels, progress)?;
    let magnitude = solved.magnitudes()?;
    let mut numbers = Numbers::zeros(precision, solved.layout.columns * green.rows);
    let bytes = green.rows * precision.bytes();
    let columns: Vec<Mutex<&mut [u8]>> = numbers.bytes_mut().chunks_mut(bytes).map(Mutex::new).collect();
    solved.columns(precision, &magnitude, &|column, bytes| {
        columns[column].lock().map_err(|_| task_failed())?.copy_from_slice(bytes);
        Ok(())
    })?;
    drop(columns);
    green.entries = Entries::new(solved.layout.places, &green.row_is_fixed, magnitude, numbers, None);
    Ok(())
}

/// Solves the reference problem into a file, without ever holding the operator.
///
/// Finished blocks are kept in `<path>.partial`; where a computation of the same thing was interrupted, it goes on, with
/// the same bits as if it had not been.
///
/// # Errors
/// A singular stiffness, a bound that cannot be kept, the operating system's (nothing is left behind), or
/// [`Error::Interrupted`] (the finished blocks are left behind).
pub fn precompute_to(
    problem: &Problem,
    target: &Target<'_>,
    found: &mut dyn FnMut(Found),
    progress: Progress<'_>,
) -> Result<()> {
    let columns = 3 * problem.touch.len();
    let mut made = made(problem, target.precision, target.memory, false, &|| go_on(progress, 0, columns))?;
    let mut green = geometry(problem, &mut made, target.precision)?;
    target.description.clone_into(&mut green.description);
    match split(made) {
        (Sweeps::Single(sweep), parts) => write::<f32, f32>(problem, parts, sweep, green, target, found, progress),
        (Sweeps::Double(sweep), parts) if green.precision() == Precision::F64 => {
            write::<f64, f64>(problem, parts, sweep, green, target, found, progress)
        }
        (Sweeps::Double(sweep), parts) => write::<f64, f32>(problem, parts, sweep, green, target, found, progress),
    }
}

/// What a computation of the columns needs beside its sweeps.
struct Parts {
    stiffness: SymmetricCsc,
    layout: Layout,
    route: Route,
}

fn split(made: Made) -> (Sweeps, Parts) {
    let Made { stiffness, layout, route, sweeps, .. } = made;
    (sweeps, Parts { stiffness, layout, route })
}

fn go_on(progress: Progress<'_>, done: usize, columns: usize) -> Result<()> {
    if progress(done, columns) { Ok(()) } else { Err(Error::Interrupted) }
}

fn write<C: Number, T: Number>(
    problem: &Problem,
    parts: Parts,
    sweep: Sweep<C>,
    mut green: GreensFunction,
    target: &Target<'_>,
    found: &mut dyn FnMut(Found),
    progress: Progress<'_>,
) -> Result<()> {
    let (kind, width, precision) = (size_of::<T>(), parts.route.width, green.precision());
    let header = format!(
        "{{\"format\":\"palpate-partial\",\"version\":{FORMAT_VERSION},\"key\":\"{}\",\"bytes\":{kind},\"width\":{width}}}\n",
        green.key
    );
    let named = |error: Error| match error {
        // The user knows the file asked for, not the one beside it.
        Error::Io { source, .. } => Error::Io { path: target.path.to_owned(), source },
        other => other,
    };
    let path = partial_path(target.path);
    let (partial, discarded) = Partial::open(&path, &header, &parts.route.blocks, kind).map_err(named)?;
    let done = |partial: &Partial| -> usize {
        parts.route.blocks.iter().enumerate().filter(|(k, _)| partial.has(*k)).map(|(_, block)| block.width).sum()
    };
    found(Found { resumed: done(&partial), discarded });
    let finished = AtomicUsize::new(0);
    let watched = |done: usize, all: usize| {
        finished.fetch_max(done, Ordering::Relaxed);
        progress(done, all)
    };
    let result = solve::<C, T>(problem, parts, sweep, Panels::File(partial), &watched).and_then(|solved| {
        let magnitude = solved.magnitudes()?;
        green.entries = without_numbers(&solved.layout, &green.row_is_fixed, magnitude.clone(), precision);
        let writer = StoreWriter::create(target.path, &green)?;
        solved.columns(precision, &magnitude, &|column, bytes| {
            if !progress(solved.layout.columns, solved.layout.columns) {
                return Err(Error::Interrupted);
            }
            writer.put(column, bytes)
        })?;
        writer.finish()
    });
    // What was finished before an interruption is worth keeping; after any other failure it is in the way.
    if !matches!(result, Err(Error::Interrupted)) || finished.into_inner() == 0 {
        drop(std::fs::remove_file(&path));
    }
    result.map_err(named)
}

/// All panels, finished.
struct Solved<T> {
    stiffness: SymmetricCsc,
    layout: Layout,
    blocks: Vec<Block>,
    panels: Panels<T>,
    tasks: usize,
}

/// Solves the blocks that are missing.
fn solve<C: Number, T: Number>(
    problem: &Problem,
    parts: Parts,
    sweep: Sweep<C>,
    panels: Panels<T>,
    progress: Progress<'_>,
) -> Result<Solved<T>> {
    let Parts { stiffness, layout, route: Route { blocks, width, tasks, .. } } = parts;
    let missing: Vec<usize> = (0..blocks.len()).filter(|&k| !panels.has(k)).collect();
    let columns: usize = missing.iter().map(|&k| blocks[k].width).sum();
    let done = AtomicUsize::new(layout.columns - columns);
    let finished = |more: usize| {
        let before = done.fetch_add(more, Ordering::Relaxed);
        go_on(progress, before + more, layout.columns)
    };
    finished(0)?;
    let system = System { stiffness: &stiffness, supports: &problem.supports, layout: &layout };
    let next = AtomicUsize::new(0);
    in_tasks(tasks, &|| {
        let mut scratch = Scratch::new(&sweep.tree, width);
        let mut panel = Vec::new();
        while let Some(&block) = missing.get(next.fetch_add(1, Ordering::Relaxed)) {
            system.solve(&sweep, &blocks[block], &mut scratch, &mut panel);
            panels.put(block, &panel)?;
            finished(blocks[block].width)?;
        }
        Ok(())
    })?;
    drop(sweep);
    Ok(Solved { stiffness, layout, blocks, panels, tasks })
}

impl<T: Number> Solved<T> {
    fn mirror(&self) -> Mirror<'_, T> {
        Mirror { layout: &self.layout, blocks: &self.blocks, panels: &self.panels }
    }

    /// Bounds of the stored rows.
    fn magnitudes(&self) -> Result<Vec<f64>> {
        magnitudes(&self.mirror(), &self.stiffness)
    }

    /// Hands the bytes of every column to `put`, as column of the store and bytes, from several tasks at a time.
    fn columns(
        &self,
        precision: Precision,
        magnitude: &[f64],
        put: &(dyn Fn(usize, &[u8]) -> Result<()> + Sync),
    ) -> Result<()> {
        let inverse: Vec<f64> = scales(precision, magnitude).into_iter().map(|scale| 1.0 / scale).collect();
        self.mirror().columns(self.tasks, &|place, numbers| {
            let column = self.layout.stored(place);
            if precision != Precision::F16 {
                return put(column, bytemuck::cast_slice(numbers));
            }
            let mut quantised = vec![0i16; numbers.len()];
            quantise(numbers, inverse[column], &inverse, &mut quantised);
            put(column, bytemuck::cast_slice(&quantised))
        })
    }
}

/// Everything but the numbers.
fn geometry(problem: &Problem, made: &mut Made, wanted: Wanted) -> Result<GreensFunction> {
    let (supports, layout, precision) = (&problem.supports, &made.layout, made.precision);
    let row_of_dof: HashMap<u32, u32> =
        layout.row_dofs.iter().enumerate().map(|(row, &dof)| (dof, row as u32)).collect();
    let row_is_fixed: Vec<bool> = layout.row_dofs.iter().map(|&d| supports.is_fixed(d)).collect();
    Ok(GreensFunction {
        surface_nodes: problem.surface_nodes.clone(),
        surface: problem.surface()?,
        touch: problem.touch.clone(),
        fixed_dofs: supports.fixed.clone(),
        fixed_rows: supports.fixed.iter().map(|d| row_of_dof[d]).collect(),
        rows: layout.row_dofs.len(),
        entries: without_numbers(layout, &row_is_fixed, Vec::new(), precision),
        row_is_fixed,
        loads: problem.loads.clone(),
        free_response: std::mem::take(&mut made.response.values),
        accuracy: made.accuracy,
        key: problem.key(wanted.named()),
        youngs_modulus: problem.common_youngs_modulus(),
        description: String::new(),
        path: None,
    })
}

/// Places, format and bounds of entries that are still to be computed.
fn without_numbers(layout: &Layout, row_is_fixed: &[bool], magnitude: Vec<f64>, precision: Precision) -> Entries {
    Entries::new(layout.places.clone(), row_is_fixed, magnitude, Numbers::zeros(precision, 0), None)
}

/// Where unfinished work on a store is kept.
pub fn partial_path(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(".partial");
    path.with_file_name(name)
}
