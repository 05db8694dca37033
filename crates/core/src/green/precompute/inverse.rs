//! `K_NN^-1` for loads on any free dof: sweeps through the whole tree, corrected by their residuals.
//!
//! The sweeps may be in single precision: each correction `x += S (f - K x)`, the residual in double, reduces the error by
//! the relative error of the sweeps. If the corrections do not converge, the operators are of no use for columns either.

use rayon::prelude::*;

use super::number::Number;
use super::operators::Operator;
use super::sweep::{Scratch, Source, Sweep, loaded};
use super::tree::{PositionRequest, Tree};
use crate::fem::{Supports, SymmetricCsc};
use crate::solver::Symbolic;
use crate::solver::front::Eliminated;
use crate::solver::multifrontal::Schedule;
use crate::{Error, Result};

/// Corrections stop when one is smaller than this part of the answer in the energy norm, or after so many.
const CORRECTION_TOLERANCE: f64 = 1e-11;
const MAX_CORRECTIONS: usize = 6;
/// Solutions whose last correction is larger are rejected.
const MAX_LAST_CORRECTION: f64 = 1e-5;

/// The factor of a body as sweeps through its whole tree.
pub struct Inverse<'a, C> {
    sweep: Sweep<C>,
    stiffness: &'a SymmetricCsc,
    supports: &'a Supports,
    positions: &'a [u32],
}

/// Refined columns and their errors in the energy norm, over the norm of the column.
pub struct RefinedColumns {
    /// One column after the other, by rank of the free dofs.
    pub columns: Vec<f64>,
    /// Of each column: the first correction, the error of the sweeps alone.
    pub first: Vec<f64>,
    /// Of each column: the last correction, which bounds the remaining error.
    pub last: Vec<f64>,
    /// Of each column: its energy norm, sqrt(J).
    pub size: Vec<f64>,
}

impl<'a, C: Number> Inverse<'a, C> {
    /// Factorises in double precision.
    ///
    /// # Errors
    /// A pivot that is not positive, or that of `interrupt`.
    pub fn new(
        symbolic: &Symbolic,
        schedule: &Schedule,
        positions: &'a [u32],
        stiffness: &'a SymmetricCsc,
        supports: &'a Supports,
        interrupt: &(dyn Fn() -> Result<()> + Sync),
    ) -> Result<Self> {
        let supernodes = symbolic.supernodes()?;
        let mut ranks = vec![0; positions.len()];
        for (rank, &position) in positions.iter().enumerate() {
            ranks[position as usize] = rank;
        }
        // The matrix of the free dofs in the order of elimination.
        let columns = |position: usize, see: &mut dyn FnMut(usize, f64)| {
            for (row, value) in stiffness.column(supports.free[ranks[position]] as usize) {
                if let Some(&row) = positions.get(supports.free_rank[row as usize] as usize)
                    && row as usize >= position
                {
                    see(row as usize, value);
                }
            }
        };
        let keep = |factor: &Eliminated| Operator::<C>::all(factor);
        let operators = schedule.run(supernodes, &columns, &keep, interrupt)?.into_iter().flatten().collect();
        let everything = PositionRequest { supports: true, ..PositionRequest::NOTHING };
        let tree = Tree::new(supernodes, &vec![everything; positions.len()]);
        Ok(Self { sweep: Sweep { tree, operators }, stiffness, supports, positions })
    }

    /// Solves `K_NN x = f` for some columns of loads by rank of the free dofs.
    pub fn solve(&self, scratch: &mut Scratch<C>, x: &mut [f64]) {
        let rows = self.positions.len();
        let width = x.len() / rows;
        // Residuals may be small beyond the range of single precision.
        let largest: Vec<f64> =
            x.chunks_exact(rows).map(|column| column.iter().fold(0.0f64, |m, x| m.max(x.abs()))).collect();
        let mut sources = Vec::with_capacity(x.len());
        for (column, (values, largest)) in x.chunks_exact(rows).zip(&largest).enumerate() {
            let nonzero = values.iter().zip(self.positions).filter(|(value, _)| **value != 0.0);
            sources.extend(nonzero.map(|(value, &row)| Source { row, column: column as u32, value: value / largest }));
        }
        let tree = &self.sweep.tree;
        self.sweep.solve(scratch, &sources, &loaded(tree, width, &sources), &vec![width; tree.nodes.len()]);
        for (column, (values, largest)) in x.chunks_exact_mut(rows).zip(&largest).enumerate() {
            for (value, &row) in values.iter_mut().zip(self.positions) {
                *value = scratch.row(row, width)[column].to_f64() * largest;
            }
        }
    }

    /// Solves and corrects; `None` if the corrections do not become small.
    pub fn refined(&self, loads: &[f64]) -> Option<RefinedColumns> {
        let rows = self.positions.len();
        let width = loads.len() / rows;
        let mut scratch = Scratch::new(&self.sweep.tree, width);
        let mut columns = loads.to_vec();
        self.solve(&mut scratch, &mut columns);
        let mut found = RefinedColumns { columns, first: Vec::new(), last: Vec::new(), size: Vec::new() };
        for _ in 0..MAX_CORRECTIONS {
            let mut residual = loads.to_vec();
            let columns = found.columns.par_chunks_exact(rows).zip(residual.par_chunks_exact_mut(rows));
            columns.for_each(|(x, r)| subtract_product(self.stiffness, self.supports, x, r));
            let mut correction = residual.clone();
            self.solve(&mut scratch, &mut correction);
            found.columns.iter_mut().zip(&correction).for_each(|(x, e)| *x += e);
            found.size = energies(loads, &found.columns, rows);
            let energies = energies(&residual, &correction, rows);
            // NaN stays NaN, and is rejected.
            found.last =
                energies.iter().zip(&found.size).map(|(e, size)| if *size == 0.0 { 0.0 } else { e / size }).collect();
            if found.first.is_empty() {
                found.first.clone_from(&found.last);
            }
            if found.last.iter().all(|&last| last <= CORRECTION_TOLERANCE) {
                break;
            }
        }
        found.last.iter().all(|&last| last <= MAX_LAST_CORRECTION).then_some(found)
    }

    /// Memory for one column.
    pub fn scratch(&self) -> Scratch<C> {
        Scratch::new(&self.sweep.tree, 1)
    }

    /// Its part for the columns of `Psi`.
    ///
    /// # Errors
    /// Never: every node has an operator.
    pub fn cut(self, tree: Tree) -> Result<Sweep<C>> {
        let mut all = self.sweep.operators.into_iter();
        let mut taken = 0;
        let mut operators = Vec::with_capacity(tree.nodes.len());
        for node in &tree.nodes {
            let missing = || Error::Invalid("a node has no operator".into());
            let operator = all.nth(node.block - taken).ok_or_else(missing)?;
            taken = node.block + 1;
            let rows: Vec<usize> =
                (0..node.positions.len()).filter(|&k| tree.keeps(node.positions.start + k)).collect();
            operators.push(operator.cut(&rows));
        }
        Ok(Sweep { tree, operators })
    }

    /// Whether all entries are finite.
    pub fn is_finite(&self) -> bool {
        self.sweep.operators.par_iter().all(Operator::is_finite)
    }
}

/// Energy norm of each column, sqrt(J).
fn energies(forces: &[f64], displacements: &[f64], rows: usize) -> Vec<f64> {
    let columns = forces.chunks_exact(rows).zip(displacements.chunks_exact(rows));
    columns.map(|(f, u)| f.iter().zip(u).map(|(f, u)| f * u).sum::<f64>().abs().sqrt()).collect()
}

/// `residual -= K_NN x` for a vector on the free dofs.
pub fn subtract_product(stiffness: &SymmetricCsc, supports: &Supports, x: &[f64], residual: &mut [f64]) {
    for (r, &dof) in residual.iter_mut().zip(&supports.free) {
        let free = |(other, k): (u32, f64)| x.get(supports.free_rank[other as usize] as usize).map_or(0.0, |x| k * x);
        *r -= stiffness.column(dof as usize).map(free).sum::<f64>();
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use rayon::ThreadPoolBuilder;

    use super::*;
    use crate::fem::{Isotropic, stiffness};
    use crate::mesh::TetMesh;

    /// A block of `n^3` cubes on a clamped face, with more dofs in its largest front than one task takes.
    fn block(n: usize) -> (SymmetricCsc, Supports) {
        let m = n + 1;
        let node = |x: usize, y: usize, z: usize| ((z * m + y) * m + x) as u32;
        let cells = (0..n).flat_map(|x| (0..n).flat_map(move |y| (0..n).map(move |z| (x, y, z))));
        // Six tetrahedra a cube, along its diagonal.
        let paths = [[0, 1, 2], [1, 0, 2], [1, 2, 0], [2, 1, 0], [2, 0, 1], [0, 2, 1]];
        let tets = cells.flat_map(|(x, y, z)| {
            paths.iter().zip(0..).map(move |(path, k)| {
                let mut at = [x, y, z];
                let mut corners = [node(x, y, z); 4];
                for (corner, &axis) in corners[1..].iter_mut().zip(path) {
                    at[axis] += 1;
                    *corner = node(at[0], at[1], at[2]);
                }
                if k % 2 == 1 {
                    corners.swap(1, 2);
                }
                corners
            })
        });
        let places = (0..m * m * m).map(|i| DVec3::new((i % m) as f64, (i / m % m) as f64, (i / m / m) as f64));
        let mesh = TetMesh::new(places.collect(), tets.collect::<Vec<[u32; 4]>>()).unwrap();
        let materials = vec![Isotropic::new(10e3, 0.45, 1000.0).unwrap(); mesh.tets.len()];
        let supports = Supports::new(3 * m * m * m, (0..3 * (m * m) as u32).collect()).unwrap();
        (stiffness(&mesh, &materials), supports)
    }

    fn factorised<'a, C: Number>(
        matrix: &'a SymmetricCsc,
        supports: &'a Supports,
        symbolic: &Symbolic,
        positions: &'a [u32],
    ) -> Inverse<'a, C> {
        let schedule = Schedule::new(symbolic.supernodes().unwrap());
        Inverse::new(symbolic, &schedule, positions, matrix, supports, &|| Ok(())).unwrap()
    }

    #[test]
    fn solutions_leave_no_residual_and_corrections_make_up_for_single_precision() {
        let (matrix, supports) = block(10);
        let symbolic = Symbolic::new(&matrix, &supports).unwrap();
        let positions = symbolic.positions();
        let count = positions.len();
        let loads: Vec<f64> = (0..2 * count).map(|i| ((i * 7919) % 1000) as f64 - 499.5).collect();
        let double = factorised::<f64>(&matrix, &supports, &symbolic, &positions);
        let (exact, single) =
            (double.refined(&loads).unwrap(), factorised::<f32>(&matrix, &supports, &symbolic, &positions));
        let mut residual = loads.clone();
        for (x, r) in exact.columns.chunks_exact(count).zip(residual.chunks_exact_mut(count)) {
            subtract_product(&matrix, &supports, x, r);
        }
        assert!(residual.iter().all(|r| r.abs() < 1e-9 * 500.0));
        assert!(exact.first.iter().all(|&error| error < 1e-11), "{:?}", exact.first);
        let refined = single.refined(&loads).unwrap();
        assert!(refined.first.iter().all(|&error| (1e-8..1e-4).contains(&error)), "{:?}", refined.first);
        let largest = exact.columns.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        assert!(refined.columns.iter().zip(&exact.columns).all(|(a, b)| (a - b).abs() < 1e-9 * largest));
    }

    #[test]
    fn bits_do_not_depend_on_the_number_of_threads() {
        let (matrix, supports) = block(14);
        let symbolic = Symbolic::new(&matrix, &supports).unwrap();
        let positions = symbolic.positions();
        let loads: Vec<f64> = (0..positions.len()).map(|i| ((i * 7919) % 1000) as f64).collect();
        let solved = |threads: usize| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let inverse = factorised::<f64>(&matrix, &supports, &symbolic, &positions);
                let mut x = loads.clone();
                inverse.solve(&mut inverse.scratch(), &mut x);
                x
            })
        };
        let one = solved(1);
        assert!(one.iter().any(|&x| x != 0.0) && (2..4).all(|threads| solved(threads) == one));
    }
}
