//! Computation of the columns of `Psi`: blocked solves with the factor of `K_NN`, one sequential solve a task.

use std::sync::atomic::{AtomicUsize, Ordering};

use faer::{MatMut, Par};
use rayon::prelude::*;

use super::factor::Factor;
use super::key::content_key;
use super::operator::{GreensFunction, Precision, Values};
use crate::fem::{Isotropic, Supports, SymmetricCsc, stiffness};
use crate::mesh::{Surface, TetMesh};
use crate::{Error, Result};

/// Right-hand sides a solve: enough for the matrix products of the supernodes, few enough to share among tasks.
const BLOCK: usize = 96;

/// The reference problem (paper 3.1): a supported body without loads.
pub struct Problem {
    /// The body.
    pub mesh: TetMesh,
    /// One material an element.
    pub materials: Vec<Isotropic>,
    /// Its supports.
    pub supports: Supports,
    /// Mesh indices of the surface nodes, ascending.
    pub surface_nodes: Vec<u32>,
    /// Outward surface triangles, mesh indices.
    pub surface_triangles: Vec<[u32; 3]>,
    /// Touchable surface nodes as ascending ranks in `surface_nodes`.
    pub touch: Vec<u32>,
}

impl Problem {
    /// Content key of the Green's function with this precision.
    pub fn key(&self, precision: Precision) -> String {
        content_key(self, precision)
    }

    fn surface(&self) -> Result<Surface> {
        let local = |n: u32| self.surface_nodes.binary_search(&n).map(|i| i as u32);
        let mut triangles = Vec::with_capacity(self.surface_triangles.len());
        for t in &self.surface_triangles {
            match (local(t[0]), local(t[1]), local(t[2])) {
                (Ok(a), Ok(b), Ok(c)) => triangles.push([a, b, c]),
                _ => {
                    return Err(Error::Invalid(format!(
                        "surface triangle {t:?} names a node that is not on the surface"
                    )));
                }
            }
        }
        Surface::new(self.surface_nodes.iter().map(|&n| self.mesh.nodes[n as usize]).collect(), triangles)
    }

    /// Dof of every row: the surface's, then the supported ones inside.
    fn row_dofs(&self) -> Vec<u32> {
        let mut dofs: Vec<u32> = self.surface_nodes.iter().flat_map(|&n| [3 * n, 3 * n + 1, 3 * n + 2]).collect();
        let inside = |d: &u32| self.surface_nodes.binary_search(&(d / 3)).is_err();
        dofs.extend(self.supports.fixed.iter().copied().filter(inside));
        dofs
    }

    fn common_youngs_modulus(&self) -> Option<f64> {
        let first = self.materials.first()?.youngs_modulus;
        self.materials.iter().all(|m| m.youngs_modulus == first).then_some(first)
    }
}

/// A stored number.
trait Stored: Copy + Send + Sync + Default {
    fn from_f64(x: f64) -> Self;
    fn to_f64(self) -> f64;
}
impl Stored for f32 {
    fn from_f64(x: f64) -> Self {
        x as f32
    }
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
}
impl Stored for f64 {
    fn from_f64(x: f64) -> Self {
        x
    }
    fn to_f64(self) -> f64 {
        self
    }
}

/// What the column tasks share.
struct ColumnTask<'a> {
    stiffness: &'a SymmetricCsc,
    factor: &'a Factor,
    supports: &'a Supports,
    row_dofs: &'a [u32],
    column_dofs: &'a [u32],
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
    let task =
        ColumnTask { stiffness: &stiffness, factor: &factor, supports, row_dofs: &row_dofs, column_dofs: &column_dofs };
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
        key: problem.key(precision),
        youngs_modulus: problem.common_youngs_modulus(),
        description: String::new(),
        path: None,
    })
}

impl ColumnTask<'_> {
    fn solve_all<T: Stored>(
        &self,
        touch: &[u32],
        row_is_fixed: &[bool],
        progress: &(dyn Fn(usize, usize) -> bool + Sync),
    ) -> Result<Vec<T>> {
        let (rows, columns) = (self.row_dofs.len(), self.column_dofs.len());
        let mut values = vec![T::default(); rows * columns];
        let done = AtomicUsize::new(0);
        let n = self.factor.dimension();
        values.par_chunks_mut(rows * BLOCK).enumerate().try_for_each_init(
            || (vec![0.0; n * BLOCK], self.factor.solve_scratch(BLOCK)),
            |(x, memory), (block, out)| {
                let count = out.len() / rows;
                let first = block * BLOCK;
                let x = &mut x[..n * count];
                x.fill(0.0);
                for k in 0..count {
                    self.right_hand_side(self.column_dofs[first + k], &mut x[k * n..(k + 1) * n]);
                }
                self.factor.solve_in_place(MatMut::from_column_major_slice_mut(x, n, count), memory);
                for k in 0..count {
                    let column = &mut out[k * rows..(k + 1) * rows];
                    self.extract(self.column_dofs[first + k], &x[k * n..(k + 1) * n], column);
                }
                let finished = done.fetch_add(count, Ordering::Relaxed) + count;
                if progress(finished, columns) { Ok(()) } else { Err(Error::Interrupted) }
            },
        )?;
        symmetrise(&mut values, rows, touch, row_is_fixed);
        Ok(values)
    }

    /// A unit force on a free dof, or `-K_Nj` for a unit displacement of support `j`.
    fn right_hand_side(&self, dof: u32, b: &mut [f64]) {
        match self.supports.free_rank[dof as usize] {
            u32::MAX => {
                for (row, value) in self.stiffness.column(dof as usize) {
                    let rank = self.supports.free_rank[row as usize];
                    if rank != u32::MAX {
                        b[rank as usize] = -value;
                    }
                }
            }
            rank => b[rank as usize] = 1.0,
        }
    }

    /// Displacements of free rows, `K_DN u_N` (and `K_Dj` of a moved support) on supported rows.
    fn extract<T: Stored>(&self, dof: u32, x: &[f64], column: &mut [T]) {
        for (value, &row) in column.iter_mut().zip(self.row_dofs) {
            let rank = self.supports.free_rank[row as usize];
            *value = T::from_f64(if rank == u32::MAX { self.reaction(row, dof, x) } else { x[rank as usize] });
        }
    }

    fn reaction(&self, row: u32, dof: u32, x: &[f64]) -> f64 {
        let mut sum = 0.0;
        for (other, value) in self.stiffness.column(row as usize) {
            let rank = self.supports.free_rank[other as usize];
            if rank != u32::MAX {
                sum += value * x[rank as usize];
            } else if other == dof {
                sum += value;
            }
        }
        sum
    }
}

/// Makes the touchable square exactly symmetric: `Psi_NN` and `Psi_DD` symmetric, `Psi_DN = -Psi_ND^T`. An operator that
/// is not lets a hand draw energy from a static spring.
fn symmetrise<T: Stored>(values: &mut [T], rows: usize, touch: &[u32], row_is_fixed: &[bool]) {
    let row_of = |column: usize| 3 * touch[column / 3] as usize + column % 3;
    let columns = 3 * touch.len();
    for j in 0..columns {
        for i in 0..j {
            let (upper, lower) = (j * rows + row_of(i), i * rows + row_of(j));
            let sign = if row_is_fixed[row_of(i)] == row_is_fixed[row_of(j)] { 1.0 } else { -1.0 };
            let mean = T::from_f64(0.5 * (values[upper].to_f64() + sign * values[lower].to_f64()));
            values[upper] = mean;
            values[lower] = T::from_f64(sign * mean.to_f64());
        }
    }
}
