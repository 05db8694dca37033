//! Symbolic analysis of a precomputation: columns, operations, memory and blocks, before any number is computed.

use rayon::current_num_threads;

use super::layout::{Block, Layout};
use super::operators::operator_numbers;
use super::probe;
use super::problem::Problem;
use super::sweep::{loaded, scratch_numbers};
use super::system::System;
use super::tasks::{Phase, PhaseCallback};
use super::tree::Tree;
use crate::fem::SymmetricCsc;
use crate::green::precision::Precision;
use crate::solver::Symbolic;
use crate::solver::multifrontal::{Schedule, sizes};
use crate::{Error, Result};

/// Columns of a block, best first: enough for the matrix products, few enough for the cache and to share among tasks.
/// Multiples of 48, the width of the product's innermost kernel.
const WIDTHS: [usize; 4] = [192, 96, 48, 24];
/// Least number of blocks, for balance among tasks: a smaller body has narrower ones. It does not depend on the
/// number of threads, so that the bits do not either.
const FEWEST_BLOCKS: usize = 24;
/// Bytes of the allocator, METIS and the tasks' stacks beyond the counted ones, measured.
const OVERHEAD_BYTES: usize = 24 << 20;
/// The counts of a precomputation.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Number format of the counts.
    pub precision: Precision,
    /// Order of the factorised matrix.
    pub free_dofs: usize,
    /// Columns of the operator.
    pub columns: usize,
    /// Rows of the operator.
    pub rows: usize,
    /// Numbers in the factor.
    pub factor_entries: usize,
    /// Operations of the factorisation.
    pub factor_flops: f64,
    /// Operations of the columns, by sweeps through the elimination tree.
    pub sweep_flops: f64,
    /// At least this many operations would be needed with all touchable dofs ordered last, the trailing block of the
    /// factor being inverted: `s^3/3` each for the factor, its inverse and their product.
    pub surface_last_flops: f64,
    /// Columns of a block.
    pub width: usize,
    /// Blocks solved at a time.
    pub tasks: usize,
    /// Peak of the memory beyond that in use at the start, bytes.
    pub memory: usize,
    /// Size of the operator in its store, bytes.
    pub store: usize,
}

/// Symbolic analysis: stiffness, order, structure of the factor, rows and columns.
pub struct SymbolicAnalysis {
    /// Stiffness of all dofs.
    pub stiffness: SymmetricCsc,
    /// Order and structure of the factor.
    pub symbolic: Symbolic,
    /// Rows and columns.
    pub layout: Layout,
    /// The tree.
    pub tree: Tree,
    /// Order of the factorisation.
    pub schedule: Schedule,
}

/// Blocks of columns and number of tasks.
pub struct BlockPlan {
    /// The blocks.
    pub blocks: Vec<Block>,
    /// Columns of a block.
    pub width: usize,
    /// Blocks solved at a time.
    pub tasks: usize,
    /// Peak of the memory, bytes.
    pub peak: usize,
}

/// Bounds of a plan of blocks.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    /// Bound of memory, bytes; `None` for none.
    pub memory: Option<usize>,
    /// Whether the operator itself is held in memory too.
    pub in_memory: bool,
}

impl SymbolicAnalysis {
    /// Assembles and orders.
    ///
    /// # Errors
    /// Not enough memory.
    pub fn new(problem: &Problem, phase: PhaseCallback<'_>) -> Result<Self> {
        phase(Phase::Assembly);
        let stiffness = crate::fem::stiffness(&problem.mesh, &problem.materials);
        phase(Phase::Ordering);
        let symbolic = Symbolic::new(&stiffness, &problem.supports)?;
        let layout = Layout::new(problem, &stiffness, &symbolic);
        let tree = Tree::new(symbolic.supernodes()?, &layout.requests);
        let schedule = Schedule::new(symbolic.supernodes()?);
        Ok(Self { stiffness, symbolic, layout, tree, schedule })
    }

    /// Chooses blocks and tasks so that the peak stays within the bounds.
    ///
    /// # Errors
    /// A bound that cannot be kept, with what would fit.
    pub fn plan_blocks(&self, precision: Precision, bounds: Bounds) -> Result<BlockPlan> {
        let sizes = Sizes::new(self, precision, bounds)?;
        let (width, tasks, peak) = sizes.choose(&self.layout, &self.tree, bounds.memory)?;
        Ok(BlockPlan { blocks: self.layout.blocks(width), width, tasks, peak })
    }

    /// The counts of a plan of blocks.
    ///
    /// # Errors
    /// Never: the structure is made supernodal.
    pub fn plan(&self, problem: &Problem, precision: Precision, route: &BlockPlan) -> Result<Plan> {
        let Self { stiffness, symbolic, layout, tree, .. } = self;
        let system = System { stiffness, supports: &problem.supports, layout };
        Ok(Plan {
            precision,
            free_dofs: problem.supports.free.len(),
            columns: layout.columns,
            rows: layout.rows(),
            factor_entries: symbolic.supernodes()?.len_val(),
            factor_flops: symbolic.flops()?,
            sweep_flops: route.blocks.iter().map(|block| sweep_flops(&system, tree, block)).sum(),
            surface_last_flops: ((layout.columns - layout.supported) as f64).powi(3),
            width: route.width,
            tasks: route.tasks,
            memory: route.peak,
            store: layout.columns * layout.rows() * precision.bytes(),
        })
    }
}

/// Operations of a block.
fn sweep_flops(system: &System<'_>, tree: &Tree, block: &Block) -> f64 {
    let sources = system.layout.loads(system.stiffness, system.supports, tree, block);
    let loaded = loaded(tree, block.width, &sources);
    let readers = system.readers(tree, block);
    let of = |k: usize| {
        let (size, boundary) = (tree.nodes[k].size() as f64, tree.nodes[k].boundary_size() as f64);
        2.0 * size * ((size + boundary) * loaded[k].len() as f64 + boundary * readers[k] as f64)
    };
    (0..tree.nodes.len()).map(of).sum()
}

/// Bytes of everything, by stage.
struct Sizes {
    /// Matrix and structure, held throughout.
    matrix: usize,
    /// Beside it during the factorisation, and while the columns are probed by the whole of the factor.
    factorising: usize,
    probing: usize,
    /// The operators that the columns need.
    operators: usize,
    /// The operator and its panels, if they are held.
    result: usize,
    /// Bytes of a number in a panel, and of one in the sweeps.
    stored: usize,
    computed: usize,
}

impl Sizes {
    fn new(prepared: &SymbolicAnalysis, precision: Precision, bounds: Bounds) -> Result<Self> {
        let SymbolicAnalysis { stiffness, symbolic, layout, tree, schedule } = prepared;
        let supernodes = symbolic.supernodes()?;
        let (stored, computed) = (precision.panel_bytes(), precision.computed_bytes());
        let (dofs, threads) = (stiffness.dimension, current_num_threads());
        let structure = 8 * supernodes.row_idx().len() + 64 * dofs + 4 * tree.boundaries.len();
        let result_numbers = |s: usize| {
            let (size, boundary) = sizes(supernodes, s);
            computed * operator_numbers(size, boundary)
        };
        let fronts = schedule.peak_bytes(supernodes, threads, &result_numbers);
        let whole: usize = (0..supernodes.n_supernodes()).map(result_numbers).sum();
        // The loads of some columns, the columns, residual and correction; and the same in the sweep, with its entries.
        let columns = probe::SOLVED * dofs * (4 * 8 + 16 + computed);
        let patch = computed * scratch_numbers(tree, probe::WIDTH);
        let numbers: usize = tree.nodes.iter().map(|n| n.size() * (n.size() + n.boundary_size())).sum();
        let panels: usize = layout.blocks(WIDTHS[0]).iter().map(Block::len).sum();
        let held = stored * panels + precision.bytes() * layout.columns * layout.rows();
        Ok(Self {
            matrix: 12 * stiffness.values.len() + structure + OVERHEAD_BYTES,
            factorising: fronts + 4 * (threads + 1) * dofs,
            probing: whole + columns.max(patch),
            operators: computed * numbers,
            result: if bounds.in_memory { held } else { 0 },
            stored,
            computed,
        })
    }

    /// Peak with blocks of `width` columns in `tasks` tasks.
    fn peak(&self, layout: &Layout, tree: &Tree, width: usize, tasks: usize) -> usize {
        let panel = self.stored * width * layout.rows();
        let solving = self.operators + tasks * (self.computed * scratch_numbers(tree, width) + panel);
        // By `Mirror::columns`.
        let mirroring = tasks * self.stored * (2 * width + 1) * layout.rows();
        self.matrix + self.result + self.factorising.max(self.probing).max(solving).max(mirroring)
    }

    /// Width, tasks and peak: as many tasks as there are threads, as wide as possible, within the bound.
    fn choose(&self, layout: &Layout, tree: &Tree, memory: Option<usize>) -> Result<(usize, usize, usize)> {
        let widest = (layout.columns / FEWEST_BLOCKS).max(WIDTHS[2]);
        let mut least = usize::MAX;
        for tasks in (1..=current_num_threads()).rev() {
            for width in WIDTHS.into_iter().filter(|&width| width <= widest) {
                let peak = self.peak(layout, tree, width, tasks);
                least = least.min(peak);
                if memory.is_none_or(|bound| peak <= bound) {
                    return Ok((width, tasks, peak));
                }
            }
        }
        let gigabytes = |bytes: usize| format!("{:.3} GB", bytes as f64 / 1e9);
        let remedy = if self.matrix + self.factorising < least {
            "a smaller touch region needs less, and so does 'f16'"
        } else {
            "only a coarser mesh needs less, whatever the touch region and the precision"
        };
        Err(Error::Memory(format!(
            "the precomputation needs at least {} of memory beside what is in use, {} are left; its factor alone takes \
             {}: {remedy}",
            gigabytes(least),
            gigabytes(memory.unwrap_or(0)),
            gigabytes(self.matrix + self.factorising)
        )))
    }
}
