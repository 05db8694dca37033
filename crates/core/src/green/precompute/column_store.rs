//! Store under construction: accepts blocks of columns in any order and from any process, and is written when all are present.
//!
//! The panels lie in `<path>.partial` beside the store to be, each written to its own place. A checksum
//! shows whether a block is damaged, so that a computation resumes with the missing blocks.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use super::arrangement::Arrangement;
use super::claim::Claim;
use super::columns::{AssembledProblem, Measurement};
use super::factorization::RequestedPrecision;
use super::layout::{Block, Layout, Stage};
use super::mirror::Mirror;
use super::number::Number;
use super::panels::Panels;
use super::partial::Partial;
use super::problem::{Problem, TouchKey};
use super::scales::magnitudes;
use super::tasks::{PhaseCallback, Progress, task_failed};
use crate::green::entries::Entries;
use crate::green::function::GreensFunction;
use crate::green::key::FORMAT_VERSION;
use crate::green::numbers::Numbers;
use crate::green::precision::Precision;
use crate::green::store::touch_of_store;
use crate::green::store_writer::StoreWriter;
use crate::{Error, Result};

/// Settings of the store to be written.
pub struct Target<'a> {
    /// Number format asked for.
    pub precision: RequestedPrecision,
    /// Bound of memory, bytes; `None` for none.
    pub memory: Option<usize>,
    /// Description of the inputs, in JSON, for people.
    pub description: &'a str,
    /// Called as each phase begins.
    pub phase: PhaseCallback<'a>,
}

/// Unfinished work of an earlier computation, beside the store.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PreviousWork {
    /// Columns that an interrupted computation had finished.
    pub resumed: usize,
    /// Whether work of another computation was found and discarded.
    pub discarded: bool,
}

/// A store under construction.
pub struct ColumnStore {
    path: PathBuf,
    /// Rows and columns in their order.
    pub parts: Arc<AssembledProblem>,
    /// The blocks.
    pub blocks: Vec<Block>,
    /// Columns of a block.
    width: usize,
    partial: Arc<Partial>,
    /// The Green's function without its numbers and touch region.
    green: GreensFunction,
    key: TouchKey,
    /// Work found at the start.
    pub previous: PreviousWork,
}

/// A stage with missing blocks.
pub struct UnfinishedStage {
    /// Its range of columns.
    pub first: usize,
    pub end: usize,
    /// The missing blocks, ascending.
    pub blocks: Vec<usize>,
}

impl ColumnStore {
    /// Begins a store, or resumes an interrupted computation of the same one. Blocks finished in another order of columns are not
    /// used.
    ///
    /// # Errors
    /// The operating system's.
    pub fn open(
        claim: Arc<Claim>,
        problem: &Problem,
        parts: Arc<AssembledProblem>,
        measurement: &Measurement,
        target: &Target<'_>,
    ) -> Result<Self> {
        let store = Self::begin(claim, problem, Arc::clone(&parts), measurement, target)?;
        store.resumed(parts)
    }

    /// Begins a store whose columns are in stages of nodes, or resumes an interrupted computation of the same one: first in its
    /// order, then by the remaining stages. [`Self::parts`] has the order.
    ///
    /// # Errors
    /// The operating system's.
    pub fn open_in_stages(
        claim: Arc<Claim>,
        problem: &Problem,
        parts: &AssembledProblem,
        stages: &[Vec<u32>],
        measurement: &Measurement,
        target: &Target<'_>,
    ) -> Result<Self> {
        let with_stages = Arc::new(parts.with_stages(0, stages));
        let store = Self::begin(claim, problem, with_stages, measurement, target)?;
        let begun = store.partial.begun();
        let layout = &store.parts.layout;
        let row = |place: usize| layout.row(place) as u32;
        let blocks = layout.blocks(measurement.width);
        let same = |(block, rows): (&Block, &Vec<u32>)| {
            rows.len() == block.width && rows.iter().zip(block.first..).all(|(&begun, place)| row(place) == begun)
        };
        let parts = if begun.len() <= blocks.len() && blocks.iter().zip(&begun).all(same) {
            Arc::clone(&store.parts)
        } else {
            let prefix = begun.iter().map(Vec::len).sum();
            Arc::new(store.parts.with_blocks_first(&begun).with_stages(prefix, stages))
        };
        store.resumed(parts)
    }

    /// Takes up what is finished of the columns in this order.
    fn resumed(mut self, parts: Arc<AssembledProblem>) -> Result<Self> {
        self.arrange(parts)?;
        self.previous.resumed = self.done();
        Ok(self)
    }

    /// Opens the partial file, without any blocks.
    fn begin(
        claim: Arc<Claim>,
        problem: &Problem,
        parts: Arc<AssembledProblem>,
        measurement: &Measurement,
        target: &Target<'_>,
    ) -> Result<Self> {
        let mut green = geometry(problem, &parts.layout, measurement, target.precision)?;
        target.description.clone_into(&mut green.description);
        let (kind, width) = (measurement.precision.panel_bytes(), measurement.width);
        let header = format!(
            "{{\"format\":\"palpate-partial\",\"version\":{FORMAT_VERSION},\"key\":\"{}\",\"bytes\":{kind},\"width\":{width}}}\n",
            green.key
        );
        let path = claim.target.clone();
        let (partial, discarded) = Partial::open(claim, &header, &parts.layout, kind)?;
        let key = problem.key_of_touch(target.precision.named());
        let previous = PreviousWork { resumed: 0, discarded };
        Ok(Self { path, parts, blocks: Vec::new(), width, partial: Arc::new(partial), green, key, previous })
    }

    /// Continues with the columns in the order of other parts of the same problem; equal blocks stay finished.
    ///
    /// # Errors
    /// The operating system's.
    pub fn arrange(&mut self, parts: Arc<AssembledProblem>) -> Result<()> {
        self.blocks = parts.layout.blocks(self.width);
        self.parts = parts;
        let partial = Arc::get_mut(&mut self.partial).ok_or_else(task_failed)?;
        partial.arrange(&self.parts.layout, &self.blocks)
    }

    /// Numbers of the missing blocks.
    pub fn missing(&self) -> Vec<usize> {
        (0..self.blocks.len()).filter(|&k| !self.partial.has(k)).collect()
    }

    /// The first stage with a missing block.
    pub fn first_unfinished(&self) -> Option<UnfinishedStage> {
        let missing = self.missing();
        let stage = self.parts.layout.stage_of(self.blocks[*missing.first()?].first);
        let Stage { supports, forces } = self.parts.layout.stages[stage].clone();
        let blocks = missing.into_iter().take_while(|&block| self.blocks[block].first < forces.end).collect();
        Some(UnfinishedStage { first: supports.start, end: forces.end, blocks })
    }

    /// Number of blocks up to the last finished one.
    pub fn leading_blocks(&self) -> usize {
        (0..self.blocks.len()).rev().find(|&block| self.partial.has(block)).map_or(0, |last| last + 1)
    }

    /// Columns of these blocks.
    pub fn begun(&self) -> usize {
        self.blocks[..self.leading_blocks()].iter().map(|block| block.width).sum()
    }

    /// Columns in all.
    pub fn columns(&self) -> usize {
        self.parts.layout.columns
    }

    /// Number of finished columns.
    pub fn done(&self) -> usize {
        self.blocks.iter().enumerate().filter(|(k, _)| self.partial.has(*k)).map(|(_, block)| block.width).sum()
    }

    /// Stores the panel of a block; from any thread.
    ///
    /// # Errors
    /// A panel of another size, or the operating system's.
    pub fn put(&self, block: usize, panel: &[u8]) -> Result<()> {
        let bytes = self.blocks.get(block).map(|b| b.len() * self.green.precision().panel_bytes());
        if bytes != Some(panel.len()) {
            return Err(Error::Invalid(format!("block {block} of columns does not have {} bytes", panel.len())));
        }
        self.partial.put(block, panel)
    }

    /// Stores the panel of a block from another process, given its checksum; `false` if the checksum does not match.
    ///
    /// # Errors
    /// A panel of another size, or the operating system's.
    pub fn receive(&self, block: usize, panel: &[u8], sum: &[u8]) -> Result<bool> {
        if checksum(panel) != sum {
            return Ok(false);
        }
        self.put(block, panel).map(|()| true)
    }

    /// Writes the store from its blocks, `tasks` of them at a time, and removes the partial file.
    ///
    /// # Errors
    /// A block that is missing or was changed, the operating system's, or an interruption.
    pub fn finish(&mut self, tasks: usize, progress: Progress<'_>) -> Result<()> {
        self.write(self.columns(), tasks, progress)?;
        self.discard();
        Ok(())
    }

    /// Writes a store of the first `columns` alone, which are all the columns of some nodes: it is complete, and has the key
    /// of the problem in which only these may be touched. If there is a store of as many nodes of the same body, it stays.
    ///
    /// # Errors
    /// A block that is missing or was changed, the operating system's, or an interruption.
    pub fn write(&mut self, columns: usize, tasks: usize, progress: Progress<'_>) -> Result<()> {
        let arrangement = Arrangement::new(&self.green.surface.positions, &self.parts.layout, columns);
        let as_large =
            |(key, touch): (String, Vec<u32>)| touch.len() >= arrangement.touch.len() && key == self.key.of(&touch);
        if columns < self.columns() && touch_of_store(&self.path).is_some_and(as_large) {
            return Ok(());
        }
        match self.green.precision() {
            Precision::F64 => self.write_as::<f64>(&arrangement, columns, tasks, progress),
            Precision::F16 | Precision::F32 => self.write_as::<f32>(&arrangement, columns, tasks, progress),
        }
    }

    /// Removes the partial file.
    pub fn discard(&self) {
        self.partial.discard();
    }

    fn write_as<T: Number>(
        &mut self,
        arrangement: &Arrangement,
        columns: usize,
        tasks: usize,
        progress: Progress<'_>,
    ) -> Result<()> {
        let count = self.blocks.partition_point(|block| block.first < columns);
        if let Some(block) = self.missing().into_iter().find(|&block| block < count) {
            return Err(Error::Invalid(format!("block {block} of columns is missing")));
        }
        let (precision, done, all) = (self.green.precision(), self.done(), self.columns());
        let panels = Panels::<T>::File(Arc::clone(&self.partial));
        let mirror = Mirror { parts: &self.parts, arrangement, blocks: &self.blocks[..count], panels: &panels, tasks };
        let magnitude = magnitudes(&mirror)?;
        self.green.touch.clone_from(&arrangement.touch);
        self.green.key = self.key.of(&arrangement.touch);
        self.green.entries = without_numbers(arrangement, &self.green.row_is_fixed, magnitude.clone(), precision);
        let writer = StoreWriter::create(&self.path, &self.green)?;
        mirror.columns(precision, &magnitude, &|column, bytes| {
            if !progress(done, all) {
                return Err(Error::Interrupted);
            }
            writer.put(column, bytes)
        })?;
        self.partial.verify(count)?;
        writer.finish()
    }
}

/// Checksum of a panel (BLAKE3).
pub fn checksum(panel: &[u8]) -> [u8; 32] {
    *blake3::hash(panel).as_bytes()
}

/// The Green's function without its numbers.
pub fn geometry(
    problem: &Problem,
    layout: &Layout,
    measurement: &Measurement,
    requested: RequestedPrecision,
) -> Result<GreensFunction> {
    let supports = &problem.supports;
    let row_of_dof: HashMap<u32, u32> =
        layout.row_dofs.iter().enumerate().map(|(row, &dof)| (dof, row as u32)).collect();
    let row_is_fixed: Vec<bool> = layout.row_dofs.iter().map(|&d| supports.is_fixed(d)).collect();
    let surface = problem.surface()?;
    Ok(GreensFunction {
        surface_nodes: problem.surface_nodes.clone(),
        touch: problem.touch.clone(),
        fixed_dofs: supports.fixed.clone(),
        fixed_rows: supports.fixed.iter().map(|d| row_of_dof[d]).collect(),
        rows: layout.row_dofs.len(),
        entries: without_numbers(
            &Arrangement::new(&surface.positions, layout, layout.columns),
            &row_is_fixed,
            Vec::new(),
            measurement.precision,
        ),
        surface,
        row_is_fixed,
        loads: problem.loads.clone(),
        free_response: measurement.response.clone(),
        accuracy: measurement.accuracy,
        key: problem.key(requested.named()),
        youngs_modulus: problem.common_youngs_modulus(),
        description: String::new(),
        path: None,
    })
}

/// Places, format and bounds of entries that are still to be computed.
fn without_numbers(
    arrangement: &Arrangement,
    row_is_fixed: &[bool],
    magnitude: Vec<f64>,
    precision: Precision,
) -> Entries {
    Entries::new(arrangement.node_order.clone(), row_is_fixed, magnitude, Numbers::zeros(precision, 0), None)
}
