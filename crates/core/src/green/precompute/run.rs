//! The whole precomputation: plan, factor, columns, mirror; in memory or into a file that survives an interruption.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use faer::Par;

use super::block::Block;
use super::free_response::free_response;
use super::layout::Layout;
use super::mirror::Mirror;
use super::number::Number;
use super::operators::operators;
use super::panels::Panels;
use super::partial::Partial;
use super::plan::{Plan, Prepared};
use super::problem::Problem;
use super::scales::{quantise, scales};
use super::sweep::{Scratch, Sweep};
use super::system::System;
use super::tasks::{in_tasks, task_failed};
use crate::fem::SymmetricCsc;
use crate::green::entries::Entries;
use crate::green::function::GreensFunction;
use crate::green::key::FORMAT_VERSION;
use crate::green::numbers::Numbers;
use crate::green::precision::Precision;
use crate::green::store_writer::StoreWriter;
use crate::solver::{condition, require_regular};
use crate::{Error, Result};

/// Told `(columns done, columns in all)` from any thread; `false` stops the computation.
pub type Progress<'a> = &'a (dyn Fn(usize, usize) -> bool + Sync);

/// Where the operator is to be written, and how.
pub struct Target<'a> {
    /// The store.
    pub path: &'a Path,
    /// Number format.
    pub precision: Precision,
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

/// Counts what a precomputation would do and need.
///
/// # Errors
/// A bound of memory (bytes) that cannot be kept.
pub fn plan(problem: &Problem, precision: Precision, memory: Option<usize>) -> Result<Plan> {
    Ok(Prepared::new(problem, precision, memory, false)?.plan)
}

/// Solves the reference problem for every touchable dof, in memory.
///
/// # Errors
/// A singular stiffness, or [`Error::Interrupted`].
pub fn precompute(problem: &Problem, precision: Precision, progress: Progress<'_>) -> Result<GreensFunction> {
    let prepared = Prepared::new(problem, precision, None, true)?;
    let mut green = geometry(problem, &prepared.layout, precision)?;
    match precision {
        Precision::F64 => collect::<f64, f64>(problem, prepared, &mut green, progress)?,
        Precision::F32 => collect::<f64, f32>(problem, prepared, &mut green, progress)?,
        Precision::F16 => collect::<f32, f32>(problem, prepared, &mut green, progress)?,
    }
    Ok(green)
}

fn collect<C: Number, T: Number>(
    problem: &Problem,
    prepared: Prepared,
    green: &mut GreensFunction,
    progress: Progress<'_>,
) -> Result<()> {
    let precision = green.precision();
    let panels = Panels::in_memory(prepared.blocks.len());
    let mut solved = solve::<C, T>(problem, prepared, panels, progress)?;
    green.free_response = std::mem::take(&mut solved.free_response);
    let scale = solved.scales(precision)?;
    let mut numbers = Numbers::zeros(precision, solved.layout.columns * green.rows);
    let bytes = green.rows * precision.bytes();
    let columns: Vec<Mutex<&mut [u8]>> = numbers.bytes_mut().chunks_mut(bytes).map(Mutex::new).collect();
    solved.columns(precision, &scale, &|column, bytes| {
        columns[column].lock().map_err(|_| task_failed())?.copy_from_slice(bytes);
        Ok(())
    })?;
    drop(columns);
    green.entries = Entries::new(solved.layout.places, &green.row_is_fixed, scale, numbers, None);
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
    let prepared = Prepared::new(problem, target.precision, target.memory, false)?;
    let mut green = geometry(problem, &prepared.layout, target.precision)?;
    target.description.clone_into(&mut green.description);
    match target.precision {
        Precision::F64 => write::<f64, f64>(problem, prepared, green, target, found, progress),
        Precision::F32 => write::<f64, f32>(problem, prepared, green, target, found, progress),
        Precision::F16 => write::<f32, f32>(problem, prepared, green, target, found, progress),
    }
}

fn write<C: Number, T: Number>(
    problem: &Problem,
    prepared: Prepared,
    mut green: GreensFunction,
    target: &Target<'_>,
    found: &mut dyn FnMut(Found),
    progress: Progress<'_>,
) -> Result<()> {
    let (kind, width) = (size_of::<T>(), prepared.plan.width);
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
    let (partial, discarded) = Partial::open(&path, &header, &prepared.blocks, kind).map_err(named)?;
    let done = |partial: &Partial| -> usize {
        prepared.blocks.iter().enumerate().filter(|(k, _)| partial.has(*k)).map(|(_, block)| block.width).sum()
    };
    found(Found { resumed: done(&partial), discarded });
    let finished = AtomicUsize::new(0);
    let watched = |done: usize, all: usize| {
        finished.fetch_max(done, Ordering::Relaxed);
        progress(done, all)
    };
    let result = solve::<C, T>(problem, prepared, Panels::File(partial), &watched).and_then(|mut solved| {
        green.free_response = std::mem::take(&mut solved.free_response);
        let scale = solved.scales(target.precision)?;
        green.entries = without_numbers(&solved.layout, &green.row_is_fixed, scale.clone(), target.precision);
        let writer = StoreWriter::create(target.path, &green)?;
        solved.columns(target.precision, &scale, &|column, bytes| {
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
    free_response: Vec<f64>,
    stiffness: SymmetricCsc,
    layout: Layout,
    blocks: Vec<Block>,
    panels: Panels<T>,
    tasks: usize,
}

/// Factorises and solves the blocks that are missing.
fn solve<C: Number, T: Number>(
    problem: &Problem,
    prepared: Prepared,
    panels: Panels<T>,
    progress: Progress<'_>,
) -> Result<Solved<T>> {
    let Prepared { stiffness, symbolic, layout, tree, blocks, plan } = prepared;
    let missing: Vec<usize> = (0..blocks.len()).filter(|&k| !panels.has(k)).collect();
    let columns: usize = missing.iter().map(|&k| blocks[k].width).sum();
    let done = AtomicUsize::new(layout.columns - columns);
    let go_on = |more: usize| match progress(done.fetch_add(more, Ordering::Relaxed) + more, layout.columns) {
        true => Ok(()),
        false => Err(Error::Interrupted),
    };
    go_on(0)?;
    let mut response = Vec::new();
    if !missing.is_empty() || !problem.loads.is_empty() {
        let system = System { stiffness: &stiffness, supports: &problem.supports, layout: &layout };
        let factor = symbolic.factorise(Par::rayon(0))?;
        require_regular(condition(&factor, &stiffness, &problem.supports), &problem.mesh.nodes)?;
        go_on(0)?;
        response = free_response(system.stiffness, &factor, system.supports, &problem.loads, &layout.row_dofs)?;
        let operators = operators::<C>(&tree, factor.supernodal()?);
        drop(factor);
        let sweep = Sweep { tree, operators };
        let next = AtomicUsize::new(0);
        in_tasks(plan.tasks, &|| {
            let mut scratch = Scratch::new(&sweep.tree, plan.width);
            let mut panel = Vec::new();
            while let Some(&block) = missing.get(next.fetch_add(1, Ordering::Relaxed)) {
                system.solve(&sweep, &blocks[block], &mut scratch, &mut panel);
                panels.put(block, &panel)?;
                go_on(blocks[block].width)?;
            }
            Ok(())
        })?;
    }
    Ok(Solved { free_response: response, stiffness, layout, blocks, panels, tasks: plan.tasks })
}

impl<T: Number> Solved<T> {
    fn mirror(&self) -> Mirror<'_, T> {
        Mirror { layout: &self.layout, blocks: &self.blocks, panels: &self.panels }
    }

    /// Scales of the stored rows; none where the format needs none.
    fn scales(&self, precision: Precision) -> Result<Vec<f64>> {
        if precision == Precision::F16 { scales(&self.mirror(), &self.stiffness) } else { Ok(Vec::new()) }
    }

    /// Hands the bytes of every column to `put`, as column of the store and bytes, from several tasks at a time.
    fn columns(
        &self,
        precision: Precision,
        scale: &[f64],
        put: &(dyn Fn(usize, &[u8]) -> Result<()> + Sync),
    ) -> Result<()> {
        let inverse: Vec<f64> = scale.iter().map(|scale| 1.0 / scale).collect();
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
fn geometry(problem: &Problem, layout: &Layout, precision: Precision) -> Result<GreensFunction> {
    let supports = &problem.supports;
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
        free_response: Vec::new(),
        key: problem.key(precision),
        youngs_modulus: problem.common_youngs_modulus(),
        description: String::new(),
        path: None,
    })
}

/// Places, format and scales of entries that are still to be computed.
fn without_numbers(layout: &Layout, row_is_fixed: &[bool], scale: Vec<f64>, precision: Precision) -> Entries {
    Entries::new(layout.places.clone(), row_is_fixed, scale, Numbers::zeros(precision, 0), None)
}

/// Where unfinished work on a store is kept.
pub fn partial_path(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(".partial");
    path.with_file_name(name)
}
