//! Triangular solves with many right-hand sides of which most is zero, and of whose solutions only some rows are wanted.
//!
//! A unit force reaches, in the forward sweep, only the supernodes on the path from its own to the root of the
//! elimination tree. The backward sweep needs, for the rows that are wanted, only their supernodes and those above them.
//! The right-hand sides are stored by rows (all columns of a row together), so that gathering and scattering the rows
//! of a supernode copies whole cache lines.

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;
use faer::{Accum, MatMut, MatRef, Par};

/// No parent: the root of a tree.
const ROOT: u32 = u32::MAX;

/// The factor's supernodes as a forest.
pub struct Pruned<'a> {
    llt: SupernodalLltRef<'a, usize, f64>,
    /// Parent of each supernode; parents come later.
    parent: Vec<u32>,
    /// Supernode of each permuted position.
    supernode_of: Vec<u32>,
    longest_pattern: usize,
}

/// Memory of one task.
pub struct PrunedScratch {
    /// Right-hand sides and then solutions, row-major, permuted positions by columns.
    pub x: Vec<f64>,
    gathered: Vec<f64>,
    reached: Vec<bool>,
    needed: Vec<bool>,
}

impl<'a> Pruned<'a> {
    /// The forest of a factor.
    pub fn new(llt: SupernodalLltRef<'a, usize, f64>) -> Self {
        let symbolic = llt.symbolic();
        let (count, n) = (symbolic.n_supernodes(), symbolic.nrows());
        let mut supernode_of = vec![0u32; n];
        for s in 0..count {
            supernode_of[symbolic.supernode_begin()[s]..symbolic.supernode_end()[s]].fill(s as u32);
        }
        let pattern = |s: usize| llt.supernode(s).pattern();
        let parent = (0..count).map(|s| pattern(s).first().map_or(ROOT, |&row| supernode_of[row])).collect();
        let longest_pattern = (0..count).map(|s| pattern(s).len()).max().unwrap_or(0);
        Self { llt, parent, supernode_of, longest_pattern }
    }

    /// Memory for up to `columns` right-hand sides.
    pub fn scratch(&self, columns: usize) -> PrunedScratch {
        PrunedScratch {
            x: vec![0.0; self.supernode_of.len() * columns],
            gathered: vec![0.0; self.longest_pattern * columns],
            reached: vec![false; self.parent.len()],
            needed: vec![false; self.parent.len()],
        }
    }

    /// Solves for the `columns` right-hand sides in `scratch.x`, nonzero at the positions `sources` only; the solutions
    /// are right at the positions `wanted`, and undefined elsewhere.
    pub fn solve(
        &self,
        scratch: &mut PrunedScratch,
        columns: usize,
        sources: impl Iterator<Item = usize>,
        wanted: impl Iterator<Item = usize>,
    ) {
        self.mark(&mut scratch.reached, sources);
        self.mark(&mut scratch.needed, wanted);
        for s in 0..self.parent.len() {
            if scratch.reached[s] {
                self.forward(s, scratch, columns);
            }
        }
        for s in (0..self.parent.len()).rev() {
            if scratch.needed[s] {
                self.backward(s, scratch, columns);
            }
        }
    }

    /// Marks the supernodes of some positions and all their ancestors.
    fn mark(&self, marks: &mut [bool], positions: impl Iterator<Item = usize>) {
        marks.fill(false);
        for position in positions {
            marks[self.supernode_of[position] as usize] = true;
        }
        for s in 0..marks.len() {
            if marks[s] && self.parent[s] != ROOT {
                marks[self.parent[s] as usize] = true;
            }
        }
    }

    /// `x_s = L_ss^-1 x_s`, then its part leaves the rows below.
    fn forward(&self, s: usize, scratch: &mut PrunedScratch, columns: usize) {
        let node = self.llt.supernode(s);
        let size = node.val().ncols();
        let (top, below) = node.val().split_at_row(size);
        let mut x = rows_mut(&mut scratch.x, node.start(), size, columns);
        solve_lower_triangular_in_place(top, x.as_mut(), Par::Seq);
        let pattern = node.pattern();
        if pattern.is_empty() {
            return;
        }
        let mut gathered = rows_mut(&mut scratch.gathered, 0, pattern.len(), columns);
        matmul(gathered.as_mut(), Accum::Replace, below, x.as_ref(), 1.0, Par::Seq);
        for (&row, part) in pattern.iter().zip(scratch.gathered.chunks_exact(columns)) {
            for (value, part) in scratch.x[row * columns..(row + 1) * columns].iter_mut().zip(part) {
                *value -= part;
            }
        }
    }

    /// `x_s = L_ss^-T (x_s - L_below^T x_below)`.
    fn backward(&self, s: usize, scratch: &mut PrunedScratch, columns: usize) {
        let node = self.llt.supernode(s);
        let size = node.val().ncols();
        let (top, below) = node.val().split_at_row(size);
        let pattern = node.pattern();
        for (&row, copy) in pattern.iter().zip(scratch.gathered.chunks_exact_mut(columns)) {
            copy.copy_from_slice(&scratch.x[row * columns..(row + 1) * columns]);
        }
        let mut x = rows_mut(&mut scratch.x, node.start(), size, columns);
        if !pattern.is_empty() {
            let gathered =
                MatRef::from_row_major_slice(&scratch.gathered[..pattern.len() * columns], pattern.len(), columns);
            matmul(x.as_mut(), Accum::Add, below.transpose(), gathered, -1.0, Par::Seq);
        }
        solve_upper_triangular_in_place(top.transpose(), x.as_mut(), Par::Seq);
    }
}

fn rows_mut(x: &mut [f64], first: usize, count: usize, columns: usize) -> MatMut<'_, f64> {
    MatMut::from_row_major_slice_mut(&mut x[first * columns..(first + count) * columns], count, columns)
}
