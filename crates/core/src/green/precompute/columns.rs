//! A factored body: any block of its columns, by number.
//!
//! What a block's numbers depend on is the problem, the number format and the width of the blocks; not who solves it, when,
//! or on how many threads. So the blocks of one operator may be solved by several processes, each with a factor of its own.

use std::sync::Arc;

use super::block::Block;
use super::layout::Layout;
use super::made::{Made, Sweeps, Wanted, made};
use super::phase::Listener;
use super::plan::Prepared;
use super::problem::Problem;
use super::sweep::Scratch;
use super::system::System;
use super::tasks::task_failed;
use super::tree::Reading;
use crate::Result;
use crate::fem::{Supports, SymmetricCsc};
use crate::green::accuracy::Accuracy;
use crate::green::precision::Precision;

/// Matrix, rows and columns of a problem: what a block is solved with, and a store put together.
pub struct Parts {
    /// Stiffness of all dofs.
    pub stiffness: Arc<SymmetricCsc>,
    /// The supports.
    pub supports: Arc<Supports>,
    /// Rows and columns.
    pub layout: Layout,
}

impl Parts {
    /// Assembles and orders, without a factor.
    ///
    /// # Errors
    /// Not enough memory.
    pub fn new(problem: &Problem) -> Result<Self> {
        let Prepared { stiffness, layout, .. } = Prepared::new(problem, &|_| {})?;
        Ok(Self::of(problem, stiffness, layout))
    }

    fn of(problem: &Problem, stiffness: SymmetricCsc, layout: Layout) -> Self {
        Self { stiffness: Arc::new(stiffness), supports: Arc::new(problem.supports.clone()), layout }
    }

    /// The same with the columns behind the first `kept` in other stages of nodes ([`Layout::arrange`]).
    pub fn arranged(&self, kept: usize, stages: &[Vec<u32>]) -> Self {
        self.changed(|layout| layout.arrange(kept, stages, &self.stiffness, &self.supports))
    }

    /// The same with blocks of these rows first ([`Layout::adopt`]).
    pub fn adopting(&self, blocks: &[Vec<u32>]) -> Self {
        self.changed(|layout| layout.adopt(blocks, &self.stiffness, &self.supports))
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

/// What a store needs to know of the factor, beside the columns.
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
    /// What the blocks are of.
    pub parts: Arc<Parts>,
    /// What was found on the way.
    pub measurement: Measurement,
    /// Blocks that the memory allows to be solved at a time.
    pub tasks: usize,
    sweeps: Sweeps,
}

/// Memory of one task that solves blocks: what it computes with, and the panel.
pub enum Working {
    /// Of a store of halves.
    Single(Scratch<f32>, Vec<f32>),
    /// Computed in double, stored in single precision.
    Mixed(Scratch<f64>, Vec<f32>),
    /// Of a store of doubles.
    Double(Scratch<f64>, Vec<f64>),
}

impl Columns {
    /// Factorises, measures, and chooses the number format and the width of the blocks; `go_on` is asked between the steps.
    ///
    /// # Errors
    /// A singular stiffness, a bound of memory (bytes) that cannot be kept, or an interruption.
    pub fn new(
        problem: &Problem,
        wanted: Wanted,
        memory: Option<usize>,
        in_memory: bool,
        phase: Listener<'_>,
        go_on: &(dyn Fn() -> Result<()> + Sync),
    ) -> Result<Self> {
        let Made { stiffness, layout, route, sweeps, response, precision, accuracy } =
            made(problem, wanted, memory, in_memory, phase, go_on)?;
        let measurement = Measurement { precision, accuracy, response: response.values, width: route.width };
        let parts = Arc::new(Parts::of(problem, stiffness, layout));
        Ok(Self { parts, measurement, tasks: route.tasks, sweeps })
    }

    /// Goes on with the columns in the order of other parts of the same problem.
    pub fn arrange(&mut self, parts: Arc<Parts>) {
        let wanted = &parts.layout.wanted;
        match &mut self.sweeps {
            Sweeps::Single(sweep) => sweep.tree.reading = Reading::new(&sweep.tree, wanted),
            Sweeps::Double(sweep) => sweep.tree.reading = Reading::new(&sweep.tree, wanted),
        }
        self.parts = parts;
    }

    /// Memory for a task that solves blocks of up to `width` columns.
    pub fn working(&self, width: usize) -> Working {
        match &self.sweeps {
            Sweeps::Single(sweep) => Working::Single(Scratch::new(&sweep.tree, width), Vec::new()),
            Sweeps::Double(sweep) if self.measurement.precision == Precision::F64 => {
                Working::Double(Scratch::new(&sweep.tree, width), Vec::new())
            }
            Sweeps::Double(sweep) => Working::Mixed(Scratch::new(&sweep.tree, width), Vec::new()),
        }
    }

    /// Solves a block; its panel's numbers, as bytes that are aligned for them.
    ///
    /// # Errors
    /// Memory that was made for other columns.
    pub fn solve<'w>(&self, block: &Block, working: &'w mut Working) -> Result<&'w [u8]> {
        let Parts { stiffness, supports, layout } = self.parts.as_ref();
        let system = System { stiffness, supports, layout };
        match (&self.sweeps, working) {
            (Sweeps::Single(sweep), Working::Single(scratch, panel)) => {
                system.solve(sweep, block, scratch, panel);
                Ok(bytemuck::cast_slice(panel))
            }
            (Sweeps::Double(sweep), Working::Mixed(scratch, panel)) => {
                system.solve(sweep, block, scratch, panel);
                Ok(bytemuck::cast_slice(panel))
            }
            (Sweeps::Double(sweep), Working::Double(scratch, panel)) => {
                system.solve(sweep, block, scratch, panel);
                Ok(bytemuck::cast_slice(panel))
            }
            _ => Err(task_failed()),
        }
    }
}
