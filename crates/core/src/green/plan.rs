//! What a precomputation will do and need, counted before any number is computed.

use rayon::current_num_threads;

use super::columns::{Layout, Problem};
use super::factor::Symbolic;
use super::mirror;
use super::operator::Precision;
use super::panels::Block;
use super::sweep::{flops, scratch_numbers};
use super::tree::Tree;
use crate::fem::SymmetricCsc;
use crate::{Error, Result};

/// Columns of a block, best first: enough for the matrix products, few enough for the cache and to share among tasks.
/// Multiples of 48, the width of the product's innermost kernel.
const WIDTHS: [usize; 4] = [192, 96, 48, 24];
/// Fewer blocks than this are shared badly among tasks: a smaller body takes narrower ones. It does not depend on the
/// number of threads, so that the bits do not either.
const FEWEST_BLOCKS: usize = 12;
/// Bytes that the allocator, METIS and the tasks' stacks take beside what is counted, measured.
const OVERHEAD_BYTES: usize = 24 << 20;

/// The counts of a precomputation.
#[derive(Clone, Debug)]
pub struct Plan {
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
    /// Operations of the columns as they will be solved.
    pub column_flops: f64,
    /// The same if no subtree were condensed.
    pub walked_flops: f64,
    /// Subtrees that are condensed.
    pub condensed: usize,
    /// At least this many operations would be needed with all touchable dofs ordered last, the trailing block of the
    /// factor being inverted: `s^3/3` each for the factor, its inverse and their product.
    pub surface_last_flops: f64,
    /// Columns of a block.
    pub width: usize,
    /// Blocks solved at a time.
    pub tasks: usize,
    /// Peak of the memory taken, beside what the process holds already, bytes.
    pub memory: usize,
    /// Size of the operator in its store, bytes.
    pub store: usize,
}

/// Everything that precedes the first number.
pub struct Prepared {
    /// Stiffness of all dofs.
    pub stiffness: SymmetricCsc,
    /// Order and structure of the factor.
    pub symbolic: Symbolic,
    /// Rows and columns.
    pub layout: Layout,
    /// The tree.
    pub tree: Tree,
    /// The blocks of columns.
    pub blocks: Vec<Block>,
    /// The counts.
    pub plan: Plan,
}

impl Prepared {
    /// Orders, counts, and chooses blocks so that the peak stays below `memory` bytes. `in_memory`: the operator itself
    /// is to be held, too.
    ///
    /// # Errors
    /// A bound that cannot be kept, with what would fit.
    pub fn new(problem: &Problem, precision: Precision, memory: Option<usize>, in_memory: bool) -> Result<Self> {
        let stiffness = crate::fem::stiffness(&problem.mesh, &problem.materials);
        let symbolic = Symbolic::new(&stiffness, &problem.supports)?;
        let layout = Layout::new(problem, &stiffness, &symbolic);
        let supernodes = symbolic.supernodes()?;
        let tree = Tree::new(supernodes, &layout.wanted, true);
        let walked = Tree::new(supernodes, &layout.wanted, false);
        let sizes = Sizes::new(&stiffness, &symbolic, &layout, &tree, precision, in_memory)?;
        let (width, tasks, peak) = sizes.choose(&layout, &tree, memory)?;
        let blocks = layout.blocks(width);
        let count = |tree: &Tree| -> f64 {
            let reached = |b| layout.right_hand_sides(&stiffness, &problem.supports, tree, b).1;
            blocks.iter().map(|b| flops(tree, &reached(b))).sum()
        };
        let surface = (layout.columns() - layout.supported) as f64;
        let plan = Plan {
            free_dofs: problem.supports.free.len(),
            columns: layout.columns(),
            rows: layout.row_dofs.len(),
            factor_entries: supernodes.len_val(),
            factor_flops: symbolic.flops()?,
            column_flops: count(&tree),
            walked_flops: count(&walked),
            condensed: tree.condensed_count(),
            surface_last_flops: surface.powi(3),
            width,
            tasks,
            memory: peak,
            store: layout.columns() * layout.row_dofs.len() * precision.bytes(),
        };
        Ok(Self { stiffness, symbolic, layout, tree, blocks, plan })
    }
}

/// Bytes of everything, by stage.
struct Sizes {
    /// Matrix and structure, held throughout.
    matrix: usize,
    /// Beside it during the factorisation, and while the operators are made from the factor.
    factorising: usize,
    making: usize,
    /// The operators.
    operators: usize,
    /// The operator and its panels, if they are held.
    result: usize,
    /// Bytes of a panel's number and of a computed one.
    stored: usize,
    computed: usize,
}

impl Sizes {
    fn new(
        stiffness: &SymmetricCsc,
        symbolic: &Symbolic,
        layout: &Layout,
        tree: &Tree,
        precision: Precision,
        in_memory: bool,
    ) -> Result<Self> {
        let supernodes = symbolic.supernodes()?;
        let (computed, stored) = (precision.computed_bytes(), precision.panel_bytes());
        let factor = 8 * supernodes.len_val();
        let lower = 16 * symbolic.matrix_entries();
        let structure = 8 * supernodes.row_idx().len() + 64 * stiffness.dimension + 4 * tree.boundaries.len();
        let numbers: usize = tree.nodes.iter().map(|n| n.size() * (n.size() + n.boundary_size())).sum();
        let largest = tree.nodes.iter().map(|n| n.size().max(1) * (n.size() + n.boundary_size())).max().unwrap_or(0);
        let square = layout.columns() * layout.row_dofs.len();
        let panels = layout.columns() * (layout.columns() / 2 + layout.extra.len());
        Ok(Self {
            matrix: 12 * stiffness.values.len() + structure + OVERHEAD_BYTES,
            factorising: factor + lower + symbolic.scratch_bytes(faer::Par::rayon(0)),
            making: factor + computed * numbers + 3 * 8 * largest,
            operators: computed * numbers,
            result: if in_memory { stored * panels + precision.bytes() * square } else { 0 },
            stored,
            computed,
        })
    }

    /// Peak with blocks of `width` columns in `tasks` tasks.
    fn peak(&self, layout: &Layout, tree: &Tree, width: usize, tasks: usize) -> usize {
        let numbers = scratch_numbers(tree, width);
        let solving = self.operators + tasks * (self.computed * numbers + self.stored * width * layout.line());
        let mirroring = tasks * self.stored * mirror::numbers(layout, width);
        self.matrix + self.result + self.factorising.max(self.making).max(solving).max(mirroring)
    }

    /// Width, tasks and peak: as many tasks as there are threads, as wide as possible, within the bound.
    fn choose(&self, layout: &Layout, tree: &Tree, memory: Option<usize>) -> Result<(usize, usize, usize)> {
        let threads = current_num_threads();
        let widest = layout.columns() / FEWEST_BLOCKS;
        let mut least = usize::MAX;
        for tasks in (1..=threads).rev() {
            for &width in WIDTHS.iter().filter(|&&w| w <= widest.max(WIDTHS[2])) {
                let peak = self.peak(layout, tree, width, tasks);
                least = least.min(peak);
                if memory.is_none_or(|bound| peak <= bound) {
                    return Ok((width, tasks, peak));
                }
            }
        }
        let (needed, bound) = (gigabytes(least), gigabytes(memory.unwrap_or(0)));
        let factor = gigabytes(self.matrix + self.factorising);
        let remedy = if self.matrix + self.factorising < least {
            "a smaller touch region needs less, and so does 'f32' or 'f16' instead of 'f64'"
        } else {
            "only a coarser mesh needs less, the touch region and the precision change nothing here"
        };
        Err(Error::Memory(format!(
            "the precomputation needs at least {needed} of memory, {bound} are allowed; the factor alone takes {factor}: \
             {remedy}"
        )))
    }
}

fn gigabytes(bytes: usize) -> String {
    format!("{:.2} GB", bytes as f64 / 1e9)
}
