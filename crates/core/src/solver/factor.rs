//! Sparse Cholesky factor of `K_NN`, the stiffness of the free dofs.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::perm::Perm;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side};

use super::multifrontal::operations;
use super::ordering::nested_dissection;
use crate::fem::{Supports, SymmetricCsc};
use crate::{Error, Result};

/// Order and structure of a factor, before any number is computed.
pub struct Symbolic {
    structure: SymbolicCholesky<usize>,
}

/// `P K_NN P^T = L L^T`.
pub struct Factor {
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
}

impl Symbolic {
    /// Orders the free part of `stiffness` and finds the structure of its factor.
    ///
    /// # Errors
    /// Not enough memory.
    pub fn new(stiffness: &SymmetricCsc, supports: &Supports) -> Result<Self> {
        Self::of_lower(&free_lower_triangle(stiffness, supports), stiffness, supports)
    }

    fn of_lower(lower: &SparseColMat<usize, f64>, stiffness: &SymmetricCsc, supports: &Supports) -> Result<Self> {
        let order = dof_order(stiffness, supports);
        let mut inverse = vec![0usize; order.len()];
        for (new, &old) in order.iter().enumerate() {
            inverse[old] = new;
        }
        let perm = Perm::new_checked(order.into_boxed_slice(), inverse.into_boxed_slice(), lower.nrows());
        let structure = factorize_symbolic_cholesky(
            lower.symbolic(),
            Side::Lower,
            SymmetricOrdering::Custom(perm.as_ref()),
            // Substructures are cut from the supernodes: never the simplicial form.
            CholeskySymbolicParams {
                supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
                ..CholeskySymbolicParams::default()
            },
        )
        .map_err(|e| Error::Singular(format!("symbolic factorisation failed ({e:?})")))?;
        Ok(Self { structure })
    }

    /// The supernodes, in permuted positions.
    ///
    /// # Errors
    /// Never: the structure is made supernodal.
    pub fn supernodes(&self) -> Result<&SymbolicSupernodalCholesky<usize>> {
        match self.structure.raw() {
            SymbolicCholeskyRaw::Supernodal(supernodes) => Ok(supernodes),
            SymbolicCholeskyRaw::Simplicial(_) => Err(Error::Singular("the factor has no supernodes".into())),
        }
    }

    /// Permuted position of each free dof.
    pub fn positions(&self) -> Vec<u32> {
        match self.structure.perm() {
            Some(perm) => perm.arrays().1.iter().map(|&p| p as u32).collect(),
            None => (0..self.structure.nrows() as u32).collect(),
        }
    }

    /// Operations of a factorisation.
    ///
    /// # Errors
    /// Never: the structure is made supernodal.
    pub fn flops(&self) -> Result<f64> {
        let supernodes = self.supernodes()?;
        Ok((0..supernodes.n_supernodes()).map(|s| operations(supernodes, s)).sum())
    }
}

impl Factor {
    /// Orders and factorises the free part of `stiffness`.
    ///
    /// # Errors
    /// A pivot that is not positive: a part of the body is not held by any support.
    pub fn new(stiffness: &SymmetricCsc, supports: &Supports, par: Par) -> Result<Self> {
        let failed = |what: &str| Error::Singular(format!("{what}; is every part of the body held by a support?"));
        let lower = free_lower_triangle(stiffness, supports);
        let symbolic = Symbolic::of_lower(&lower, stiffness, supports)?.structure;
        let mut values = vec![0.0; symbolic.len_val()];
        let mut memory = MemBuffer::new(symbolic.factorize_numeric_llt_scratch::<f64>(par, Default::default()));
        symbolic
            .factorize_numeric_llt(
                &mut values,
                lower.as_ref(),
                Side::Lower,
                LltRegularization::default(),
                par,
                MemStack::new(&mut memory),
                Default::default(),
            )
            .map_err(|_| failed("a pivot is not positive"))?;
        if !values.iter().all(|v| v.is_finite()) {
            return Err(failed("the factor is not finite"));
        }
        Ok(Self { symbolic, values })
    }

    /// Number of free dofs.
    pub fn dimension(&self) -> usize {
        self.symbolic.nrows()
    }

    /// Solves `K_NN x = b` in place for the right-hand sides in `b`, one after the other in memory, sequentially.
    pub fn solve_in_place(&self, b: &mut [f64], memory: &mut MemBuffer) {
        let (rows, columns) = (self.dimension(), b.len() / self.dimension());
        LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(b, rows, columns),
            Par::Seq,
            MemStack::new(memory),
        );
    }

    /// Scratch for [`Factor::solve_in_place`] with `columns` right-hand sides.
    pub fn solve_scratch(&self, columns: usize) -> MemBuffer {
        MemBuffer::new(self.symbolic.solve_in_place_scratch::<f64>(columns, Par::Seq))
    }
}

fn free_lower_triangle(stiffness: &SymmetricCsc, supports: &Supports) -> SparseColMat<usize, f64> {
    let mut start = vec![0usize];
    let (mut rows, mut values) = (Vec::new(), Vec::new());
    for (j, &dof) in supports.free.iter().enumerate() {
        for (row, value) in stiffness.column(dof as usize) {
            let i = supports.free_rank[row as usize];
            if i != u32::MAX && i as usize >= j {
                rows.push(i as usize);
                values.push(value);
            }
        }
        start.push(rows.len());
    }
    let n = supports.free.len();
    SparseColMat::new(SymbolicSparseColMat::new_checked(n, n, start, None, rows), values)
}

/// Nested dissection of the nodes, each followed by its free dofs in turn: `order[new] = old` in free numbering.
fn dof_order(stiffness: &SymmetricCsc, supports: &Supports) -> Vec<usize> {
    let node_count = stiffness.dimension / 3;
    let (mut start, mut adjacency) = (vec![0usize], Vec::new());
    for node in 0..node_count {
        let mut previous = u32::MAX;
        for (row, _) in stiffness.column(3 * node) {
            let other = row / 3;
            if other != previous && other as usize != node {
                adjacency.push(other);
            }
            previous = other;
        }
        start.push(adjacency.len());
    }
    nested_dissection(&start, &adjacency)
        .into_iter()
        .flat_map(|node| (0..3).map(move |axis| supports.free_rank[(3 * node + axis) as usize]))
        .filter(|&rank| rank != u32::MAX)
        .map(|rank| rank as usize)
        .collect()
}
