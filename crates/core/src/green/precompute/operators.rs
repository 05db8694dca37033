//! The matrices `G` and `M` of every node of the tree (see [`super::tree`]), from the factor.

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_inverse::invert_lower_triangular;
use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;
use faer::{Accum, Mat, MatRef, Par};
use rayon::prelude::*;

use super::number::Number;
use super::tree::{NONE, Node, Tree};

/// `G` (boundary by rows) and `M` (rows by rows) of a node, columns contiguous.
pub struct Operator<C> {
    g: Vec<C>,
    m: Vec<C>,
}

impl<C: Number> Operator<C> {
    /// `G`.
    pub fn g(&self, node: &Node) -> MatRef<'_, C> {
        MatRef::from_column_major_slice(&self.g, node.boundary_size(), node.size())
    }

    /// `M`.
    pub fn m(&self, node: &Node) -> MatRef<'_, C> {
        MatRef::from_column_major_slice(&self.m, node.size(), node.size())
    }
}

/// The matrices of all nodes, in parallel.
pub fn operators<C: Number>(tree: &Tree, llt: SupernodalLltRef<'_, usize, f64>) -> Vec<Operator<C>> {
    // The largest stand last: begin with them.
    let build = |node: &Node| operator(tree, llt, node);
    let mut made: Vec<Operator<C>> = tree.nodes.par_iter().rev().with_max_len(1).map(build).collect();
    made.reverse();
    made
}

fn operator<C: Number>(tree: &Tree, llt: SupernodalLltRef<'_, usize, f64>, node: &Node) -> Operator<C> {
    let supernode = llt.supernode(node.supernode);
    let size = supernode.val().ncols();
    let (top, below) = supernode.val().split_at_row(size);
    let mut inverse = Mat::zeros(size, size);
    invert_lower_triangular(inverse.as_mut(), top, Par::Seq);
    if node.size() < size {
        let positions = &tree.row_of_position[supernode.start()..supernode.start() + size];
        let kept: Vec<usize> = (0..size).filter(|&i| positions[i] != NONE).collect();
        inverse = Mat::from_fn(size, kept.len(), |i, j| inverse[(i, kept[j])]);
    }
    Operator { g: product(below, inverse.as_ref()), m: product(inverse.transpose(), inverse.as_ref()) }
}

/// `a b`, columns contiguous.
fn product<C: Number>(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Vec<C> {
    let mut product = Mat::zeros(a.nrows(), b.ncols());
    matmul(product.as_mut(), Accum::Replace, a, b, 1.0, Par::Seq);
    let columns = (0..b.ncols()).map(|j| product.col_as_slice(j));
    columns.flatten().map(|&value| C::from_f64(value)).collect()
}
