//! A factored body: any block of its columns, by number.
//!
//! The numbers of a block depend on the problem, the number format and the width of the blocks, not on the process, the time or the
//! number of threads. So several processes may solve the blocks of one operator, each with a factor of its own.

use std::sync::Arc;

use super::factorization::{Factorization, RequestedPrecision, Sweeps, factorize};
use super::layout::{Block, Layout};
use super::plan::SymbolicAnalysis;
use super::problem::Problem;
use super::sweep::Scratch;
use super::system::System;
use super::tasks::{PhaseCallback, task_failed};
use super::tree::Reading;
use crate::Result;
use crate::fem::{Supports, SymmetricCsc};
use crate::green::accuracy::Accuracy;
use crate::green::precision::Precision;

/// Matrix, rows and columns of a problem, for solving blocks and assembling a store.
pub struct AssembledProblem {
    /// Stiffness of all dofs.
    pub stiffness: Arc<SymmetricCsc>,
    /// The supports.
    pub supports: Arc<Supports>,
    /// Rows and columns.
    pub layout: Layout,
}

impl AssembledProblem {
    /// Assembles and orders, without a factor.
    ///
    /// # Errors
    /// Not enough memory.
    pub fn new(problem: &Problem) -> Result<Self> {
        let SymbolicAnalysis { stiffness, layout, .. } = SymbolicAnalysis::new(problem, &|_| {})?;
        Ok(Self::of(problem, stiffness, layout))
    }

    fn of(problem: &Problem, stiffness: SymmetricCsc, layout: Layout) -> Self {
        Self { stiffness: Arc::new(stiffness), supports: Arc::new(problem.supports.clone()), layout }
    }

    /// The same with the columns behind the first `kept` in other stages of nodes ([`Layout::arrange`]).
    pub fn with_stages(&self, prefix: usize, stages: &[Vec<u32>]) -> Self {
        self.changed(|layout| layout.arrange(prefix, stages, &self.stiffness, &self.supports))
    }

    /// The same with blocks of these rows first ([`Layout::put_blocks_first`]).
    pub fn with_blocks_first(&self, blocks: &[Vec<u32>]) -> Self {
        self.changed(|layout| layout.put_blocks_first(blocks, &self.stiffness, &self.supports))
    }

    fn changed(&self, change: impl FnOnce(&mut Layout)) -> Self {
        let mut layout = self.layout.clone();
        change(&mut layout);
        Self { stiffness: Arc::clone(&self.stiffness), supports: Arc::clone(&self.supports), layout }
    }

    /// Hash of the order in which rows and columns are solved and stored: blocks of the same number are the same columns
    /// only where it agrees.
    pub fn order(&self) -> [u8; 32] {
        let mut hash = blake3::Hasher::new();
        for part in self.layout.order() {
            hash.update(&(part.len() as u64).to_le_bytes());
            hash.update(bytemuck::cast_slice(part));
        }
        *hash.finalize().as_bytes()
    }
}

/// Properties of the factor that are stored with the columns.
#[derive(Clone, Debug)]
pub struct Measurement {
    /// Number format.
    pub precision: Precision,
    /// Its accuracy.
    pub accuracy: Accuracy,
    /// The free response on the rows; empty without loads.
    pub response: Vec<f64>,
    /// Columns of a block.
    pub width: usize,
}

/// A factored problem.
pub struct Columns {
    /// Matrix, rows and columns.
    pub parts: Arc<AssembledProblem>,
    /// Precision, accuracy and free response.
    pub measurement: Measurement,
    /// Blocks that the memory allows to be solved at a time.
    pub tasks: usize,
    sweeps: Sweeps,
}

/// Memory of one task that solves blocks: for the sweeps and for the panel.
pub enum TaskMemory {
    /// Of a store of halves.
    Single(Scratch<f32>, Vec<f32>),
    /// Computed in double, stored in single precision.
    Mixed(Scratch<f64>, Vec<f32>),
    /// Of a store of doubles.
    Double(Scratch<f64>, Vec<f64>),
}

impl Columns {
    /// Factorises, measures, and chooses the number format and the width of the blocks; `interrupt` is called between the steps.
    ///
    /// # Errors
    /// A singular stiffness, a bound of memory (bytes) that cannot be kept, or an interruption.
    pub fn new(
        problem: &Problem,
        requested: RequestedPrecision,
        memory: Option<usize>,
        in_memory: bool,
        phase: PhaseCallback<'_>,
        interrupt: &(dyn Fn() -> Result<()> + Sync),
    ) -> Result<Self> {
        let Factorization { stiffness, layout, route, sweeps, response, precision, accuracy } =
            factorize(problem, requested, memory, in_memory, phase, interrupt)?;
        let measurement = Measurement { precision, accuracy, response: response.values, width: route.width };
        let parts = Arc::new(AssembledProblem::of(problem, stiffness, layout));
        Ok(Self { parts, measurement, tasks: route.tasks, sweeps })
    }

    /// Continues with the columns in the order of other parts of the same problem.
    pub fn arrange(&mut self, parts: Arc<AssembledProblem>) {
        let requested = &parts.layout.requests;
        match &mut self.sweeps {
            Sweeps::Single(sweep) => sweep.tree.reading = Reading::new(&sweep.tree, requested),
            Sweeps::Double(sweep) => sweep.tree.reading = Reading::new(&sweep.tree, requested),
        }
        self.parts = parts;
    }

    /// Memory for a task that solves blocks of up to `width` columns.
    pub fn task_memory(&self, width: usize) -> TaskMemory {
        match &self.sweeps {
            Sweeps::Single(sweep) => TaskMemory::Single(Scratch::new(&sweep.tree, width), Vec::new()),
            Sweeps::Double(sweep) if self.measurement.precision == Precision::F64 => {
                TaskMemory::Double(Scratch::new(&sweep.tree, width), Vec::new())
            }
            Sweeps::Double(sweep) => TaskMemory::Mixed(Scratch::new(&sweep.tree, width), Vec::new()),
        }
    }

    /// Solves a block; its panel's numbers, as bytes that are aligned for them.
    ///
    /// # Errors
    /// Memory allocated for other columns.
    pub fn solve<'w>(&self, block: &Block, working: &'w mut TaskMemory) -> Result<&'w [u8]> {
        let AssembledProblem { stiffness, supports, layout } = self.parts.as_ref();
        let system = System { stiffness, supports, layout };
        Ok(match (&self.sweeps, working) {
            (Sweeps::Single(sweep), TaskMemory::Single(scratch, panel)) => system.solve(sweep, block, scratch, panel),
            (Sweeps::Double(sweep), TaskMemory::Mixed(scratch, panel)) => system.solve(sweep, block, scratch, panel),
            (Sweeps::Double(sweep), TaskMemory::Double(scratch, panel)) => system.solve(sweep, block, scratch, panel),
            _ => return Err(task_failed()),
        })
    }
}
