//! Computation of the columns of `Psi`: blocked solves with the factor of `K_NN`, one sequential solve a task.

use std::sync::atomic::{AtomicUsize, Ordering};

use faer::Par;
use rayon::prelude::*;

use super::factor::Factor;
use super::free_response::free_response;
use super::key::content_key;
use super::operator::{GreensFunction, Precision, Values};
use super::pruned::{Pruned, PrunedScratch};
use crate::fem::{Isotropic, Supports, SymmetricCsc, stiffness};
use crate::mesh::{Faces, Surface, TetMesh};
use crate::{Error, Result};

/// Right-hand sides a solve: enough for the matrix products of the supernodes, few enough to share among tasks.
const BLOCK: usize = 96;
/// Columns and rows of a tile when mirroring: both ends of a copy stay in the cache.
const TILE: usize = 64;

/// The reference problem (paper 3.1): a supported body, with its own loads if it has any.
pub struct Problem {
    /// The body.
    pub mesh: TetMesh,
    /// One material an element.
    pub materials: Vec<Isotropic>,
    /// Its supports.
    pub supports: Supports,
    /// Mesh indices of the surface nodes, ascending.
    pub surface_nodes: Vec<u32>,
    /// Outward faces of the surface, mesh indices.
    pub surface_faces: Faces,
    /// Touchable surface nodes as ascending ranks in `surface_nodes`.
    pub touch: Vec<u32>,
    /// Reference loads on all dofs, N; empty for none.
    pub loads: Vec<f64>,
}

impl Problem {
    /// Content key of the Green's function with this precision.
    pub fn key(&self, precision: Precision) -> String {
        content_key(self, precision)
    }

    fn surface(&self) -> Result<Surface> {
        let local = |n: u32| self.surface_nodes.binary_search(&n).ok().map(|i| i as u32);
        let positions = self.surface_nodes.iter().map(|&n| self.mesh.nodes[n as usize]).collect();
        Surface::new(positions, self.surface_faces.renumbered(local)?)
    }

    /// Dof of every row: the surface's, then the supported ones inside.
    fn row_dofs(&self) -> Vec<u32> {
        let mut dofs: Vec<u32> = self.surface_nodes.iter().flat_map(|&n| [3 * n, 3 * n + 1, 3 * n + 2]).collect();
        let inside = |d: &u32| self.surface_nodes.binary_search(&(d / 3)).is_err();
        dofs.extend(self.supports.fixed.iter().copied().filter(inside));
        dofs
    }

    /// The modulus of the whole body if it only scales forces: not under loads, for they do not scale with it.
    fn common_youngs_modulus(&self) -> Option<f64> {
        if !self.loads.is_empty() {
            return None;
        }
        let first = self.materials.first()?.youngs_modulus;
        self.materials.iter().all(|m| m.youngs_modulus == first).then_some(first)
    }
}

/// A stored number.
trait Stored: Copy + Send + Sync + Default {
    fn from_f64(x: f64) -> Self;
    fn negated(self) -> Self;
}
impl Stored for f32 {
    fn from_f64(x: f64) -> Self {
        x as f32
    }
    fn negated(self) -> Self {
        -self
    }
}
impl Stored for f64 {
    fn from_f64(x: f64) -> Self {
        x
    }
    fn negated(self) -> Self {
        -self
    }
}

/// What the column tasks share.
struct ColumnTask<'a> {
    stiffness: &'a SymmetricCsc,
    supports: &'a Supports,
    row_dofs: &'a [u32],
    column_dofs: &'a [u32],
    pruned: Pruned<'a>,
    /// Permuted position of each free dof.
    position: Vec<u32>,
    /// Positions whose solution every column needs: free rows that have no column of their own, and what reactions read.
    always_wanted: Vec<u32>,
    /// Columns in the order in which they are solved: moved supports first, then by position.
    order: Vec<u32>,
}

/// Solves the reference problem for every touchable dof.
///
/// `progress(done, total)` is called from any thread after each block of columns; `false` stops the computation.
///
/// # Errors
/// A singular stiffness, or [`Error::Interrupted`].
pub fn precompute(
    problem: &Problem,
    precision: Precision,
    progress: &(dyn Fn(usize, usize) -> bool + Sync),
) -> Result<GreensFunction> {
    let stiffness = stiffness(&problem.mesh, &problem.materials);
    let factor = Factor::new(&stiffness, &problem.supports, Par::rayon(0))?;
    let row_dofs = problem.row_dofs();
    let column_dofs: Vec<u32> = problem
        .touch
        .iter()
        .flat_map(|&t| (0..3).map(move |axis| 3 * t + axis))
        .map(|row| row_dofs[row as usize])
        .collect();
    let supports = &problem.supports;
    let free_response = free_response(&stiffness, &factor, supports, &problem.loads, &row_dofs)?;
    let task = ColumnTask::new(&stiffness, &factor, supports, &row_dofs, &column_dofs)?;
    let row_is_fixed: Vec<bool> = row_dofs.iter().map(|&d| supports.is_fixed(d)).collect();
    let values = match precision {
        Precision::F32 => Values::F32(task.solve_all::<f32>(&problem.touch, &row_is_fixed, progress)?),
        Precision::F64 => Values::F64(task.solve_all::<f64>(&problem.touch, &row_is_fixed, progress)?),
    };
    let surface_count = problem.surface_nodes.len();
    let mut touch_rank = vec![u32::MAX; surface_count];
    for (rank, &node) in problem.touch.iter().enumerate() {
        touch_rank[node as usize] = rank as u32;
    }
    let mut row_of_dof = std::collections::HashMap::with_capacity(row_dofs.len());
    row_of_dof.extend(row_dofs.iter().enumerate().map(|(row, &dof)| (dof, row as u32)));
    Ok(GreensFunction {
        surface_nodes: problem.surface_nodes.clone(),
        surface: problem.surface()?,
        touch: problem.touch.clone(),
        touch_rank,
        fixed_dofs: supports.fixed.clone(),
        fixed_rows: supports.fixed.iter().map(|d| row_of_dof[d]).collect(),
        rows: row_dofs.len(),
        row_is_fixed,
        values,
        loads: problem.loads.clone(),
        free_response,
        key: problem.key(precision),
        youngs_modulus: problem.common_youngs_modulus(),
        description: String::new(),
        path: None,
    })
}

impl<'a> ColumnTask<'a> {
    fn new(
        stiffness: &'a SymmetricCsc,
        factor: &'a Factor,
        supports: &'a Supports,
        row_dofs: &'a [u32],
        column_dofs: &'a [u32],
    ) -> Result<Self> {
        let position = factor.positions();
        let at = |dof: u32| match supports.free_rank[dof as usize] {
            u32::MAX => None,
            rank => Some(position[rank as usize]),
        };
        let has_column: std::collections::HashSet<u32> = column_dofs.iter().copied().collect();
        let mut always_wanted = Vec::new();
        for &dof in row_dofs.iter().filter(|dof| !has_column.contains(dof)) {
            match at(dof) {
                Some(position) => always_wanted.push(position),
                None => always_wanted.extend(stiffness.column(dof as usize).filter_map(|(other, _)| at(other))),
            }
        }
        always_wanted.sort_unstable();
        always_wanted.dedup();
        let mut order: Vec<u32> = (0..column_dofs.len() as u32).collect();
        order.sort_by_key(|&column| at(column_dofs[column as usize]));
        let pruned = Pruned::new(factor.supernodal()?);
        Ok(Self { stiffness, supports, row_dofs, column_dofs, pruned, position, always_wanted, order })
    }

    /// All columns: blocks in the order of elimination, each with the rows of its own and of later columns; the rest
    /// mirrors them.
    fn solve_all<T: Stored>(
        &self,
        touch: &[u32],
        row_is_fixed: &[bool],
        progress: &(dyn Fn(usize, usize) -> bool + Sync),
    ) -> Result<Vec<T>> {
        let (rows, columns) = (self.row_dofs.len(), self.column_dofs.len());
        let mut values = vec![T::default(); rows * columns];
        let done = AtomicUsize::new(0);
        let mut slices: Vec<Option<&mut [T]>> = values.chunks_mut(rows).map(Some).collect();
        let mut ordered: Vec<(u32, &mut [T])> =
            self.order.iter().filter_map(|&c| Some((c, slices[c as usize].take()?))).collect();
        let supported = self.order.iter().take_while(|&&c| self.is_fixed(c)).count();
        let (moved, forced) = ordered.split_at_mut(supported);
        let blocks: Vec<&mut [(u32, &mut [T])]> = moved.chunks_mut(BLOCK).chain(forced.chunks_mut(BLOCK)).collect();
        let mut later = columns;
        let tasks: Vec<_> = blocks
            .into_iter()
            .map(|block| {
                let first = columns - later;
                later -= block.len();
                (first, block)
            })
            .collect();
        tasks.into_par_iter().try_for_each_init(
            || self.pruned.scratch(BLOCK),
            |scratch, (first, block)| {
                self.solve_block(first, block, scratch);
                let finished = done.fetch_add(block.len(), Ordering::Relaxed) + block.len();
                if progress(finished, columns) { Ok(()) } else { Err(Error::Interrupted) }
            },
        )?;
        mirror(&mut values, rows, touch, row_is_fixed, &self.order);
        Ok(values)
    }

    /// One block of columns, the `first` in the order and those after it.
    fn solve_block<T: Stored>(&self, first: usize, block: &mut [(u32, &mut [T])], scratch: &mut PrunedScratch) {
        let count = block.len();
        scratch.x.fill(0.0);
        let mut sources = Vec::new();
        for (k, (column, _)) in block.iter().enumerate() {
            self.right_hand_side(self.column_dofs[*column as usize], |position, value| {
                scratch.x[position * count + k] = value;
                sources.push(position);
            });
        }
        if self.is_fixed(block[0].0) {
            // A moved support is felt everywhere, and read by the reactions of all others.
            self.pruned.solve(scratch, count, sources.into_iter(), 0..self.position.len());
        } else {
            let later = self.order[first..].iter().filter_map(|&c| self.position_of(self.column_dofs[c as usize]));
            let wanted = later.chain(self.always_wanted.iter().map(|&p| p as usize));
            self.pruned.solve(scratch, count, sources.into_iter(), wanted);
        }
        for (k, (column, out)) in block.iter_mut().enumerate() {
            self.extract(self.column_dofs[*column as usize], |position| scratch.x[position * count + k], out);
        }
    }

    fn is_fixed(&self, column: u32) -> bool {
        self.supports.is_fixed(self.column_dofs[column as usize])
    }

    /// Permuted position of a dof, if it is free.
    fn position_of(&self, dof: u32) -> Option<usize> {
        match self.supports.free_rank[dof as usize] {
            u32::MAX => None,
            rank => Some(self.position[rank as usize] as usize),
        }
    }

    /// A unit force on a free dof, or `-K_Nj` for a unit displacement of support `j`.
    fn right_hand_side(&self, dof: u32, mut set: impl FnMut(usize, f64)) {
        if let Some(position) = self.position_of(dof) {
            return set(position, 1.0);
        }
        for (row, value) in self.stiffness.column(dof as usize) {
            if let Some(position) = self.position_of(row) {
                set(position, -value);
            }
        }
    }

    /// Displacements of free rows, `K_DN u_N` (and `K_Dj` of a moved support) on supported rows. Rows that were not
    /// wanted are mirrored later.
    fn extract<T: Stored>(&self, dof: u32, solution: impl Fn(usize) -> f64, column: &mut [T]) {
        for (value, &row) in column.iter_mut().zip(self.row_dofs) {
            *value = T::from_f64(match self.position_of(row) {
                Some(position) => solution(position),
                None => self.reaction(row, dof, &solution),
            });
        }
    }

    fn reaction(&self, row: u32, dof: u32, solution: impl Fn(usize) -> f64) -> f64 {
        let mut sum = 0.0;
        for (other, value) in self.stiffness.column(row as usize) {
            if let Some(position) = self.position_of(other) {
                sum += value * solution(position);
            } else if other == dof {
                sum += value;
            }
        }
        sum
    }
}

/// Completes the touchable square from the part that was solved, so that it is symmetric to the bit: `Psi_NN` and
/// `Psi_DD` symmetric, `Psi_DN = -Psi_ND^T`. An operator that is not lets a hand draw energy from a static spring.
fn mirror<T: Stored>(values: &mut [T], rows: usize, touch: &[u32], row_is_fixed: &[bool], order: &[u32]) {
    let row_of = |column: u32| 3 * touch[column as usize / 3] as usize + column as usize % 3;
    for (i, tile) in order.chunks(TILE).enumerate() {
        for (j, other) in order.chunks(TILE).enumerate().skip(i) {
            for (a, &solved) in tile.iter().enumerate() {
                for &mirrored in &other[if i == j { a + 1 } else { 0 }..] {
                    let same_kind = row_is_fixed[row_of(solved)] == row_is_fixed[row_of(mirrored)];
                    let value = values[solved as usize * rows + row_of(mirrored)];
                    values[mirrored as usize * rows + row_of(solved)] = if same_kind { value } else { value.negated() };
                }
            }
        }
    }
}
