//! The matrices `G` and `M` of every node of the tree (see [`super::tree`]), from the factor.

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_inverse::invert_lower_triangular;
use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rayon::prelude::*;

use super::number::Number;
use super::tree::{NONE, Node, Tree};

/// `G` (boundary by rows) and `M` (rows by rows) of a node, columns contiguous.
pub struct Operator<T> {
    g: Vec<T>,
    m: Vec<T>,
}

impl<T: Number> Operator<T> {
    fn new(g: &Mat<f64>, m: &Mat<f64>) -> Self {
        let flat = |a: &Mat<f64>| {
            let mut values = Vec::with_capacity(a.nrows() * a.ncols());
            for j in 0..a.ncols() {
                values.extend((0..a.nrows()).map(|i| T::from_f64(a[(i, j)])));
            }
            values
        };
        Self { g: flat(g), m: flat(m) }
    }

    /// `G`.
    pub fn g(&self, node: &Node) -> MatRef<'_, T> {
        MatRef::from_column_major_slice(&self.g, node.boundary_size(), node.size())
    }

    /// `M`.
    pub fn m(&self, node: &Node) -> MatRef<'_, T> {
        MatRef::from_column_major_slice(&self.m, node.size(), node.size())
    }
}

/// The matrices of all nodes, in parallel.
pub fn operators<T: Number>(tree: &Tree, llt: SupernodalLltRef<'_, usize, f64>) -> Vec<Operator<T>> {
    let build = |node: &Node| {
        let (g, m) = match node.supernodes.len() {
            1 => supernode_matrices(tree, llt, node.supernodes.start),
            _ => Substructure::new(tree, llt, node).condense(tree, node),
        };
        Operator::new(&g, &m)
    };
    // The largest stand last: begin with them.
    let mut made: Vec<Operator<T>> = tree.nodes.par_iter().rev().with_max_len(1).map(build).collect();
    made.reverse();
    made
}

/// `G` and `M` of one supernode on its needed rows.
fn supernode_matrices(tree: &Tree, llt: SupernodalLltRef<'_, usize, f64>, s: usize) -> (Mat<f64>, Mat<f64>) {
    let supernode = llt.supernode(s);
    let size = supernode.val().ncols();
    let (top, below) = supernode.val().split_at_row(size);
    let mut inverse = Mat::zeros(size, size);
    invert_lower_triangular(inverse.as_mut(), top, Par::Seq);
    let start = supernode.start();
    let kept: Vec<usize> = (0..size).filter(|&i| tree.needed[start + i]).collect();
    if kept.len() < size {
        inverse = Mat::from_fn(size, kept.len(), |i, j| inverse[(i, kept[j])]);
    }
    let mut g = Mat::zeros(below.nrows(), kept.len());
    matmul(g.as_mut(), Accum::Replace, below, inverse.as_ref(), 1.0, Par::Seq);
    let mut m = Mat::zeros(kept.len(), kept.len());
    matmul(m.as_mut(), Accum::Replace, inverse.transpose(), inverse.as_ref(), 1.0, Par::Seq);
    (g, m)
}

/// A subtree about to be condensed: its supernodes with their rows in a numbering of its own, boundary rows last.
struct Substructure {
    /// Place of each position of the subtree, or [`NONE`].
    places: Vec<u32>,
    first_position: usize,
    /// Places inside; the boundary follows.
    inside: usize,
    members: Vec<Member>,
}

struct Member {
    first: usize,
    size: usize,
    boundary: Vec<u32>,
    g: Mat<f64>,
    m: Mat<f64>,
}

impl Substructure {
    fn new(tree: &Tree, llt: SupernodalLltRef<'_, usize, f64>, node: &Node) -> Self {
        let symbolic = llt.symbolic();
        let first_position = symbolic.supernode_begin()[node.supernodes.start];
        let end = symbolic.supernode_end()[node.supernodes.end - 1];
        let mut inside = 0;
        let places: Vec<u32> = (first_position..end)
            .map(|position| {
                if tree.needed[position] {
                    inside += 1;
                    inside as u32 - 1
                } else {
                    NONE
                }
            })
            .collect();
        let outer = llt.supernode(node.supernodes.end - 1).pattern();
        let place = |position: usize| match position.checked_sub(end) {
            None => places[position - first_position],
            Some(_) => (inside + outer.partition_point(|&p| p < position)) as u32,
        };
        let members = node
            .supernodes
            .clone()
            .filter_map(|s| {
                let range = symbolic.supernode_begin()[s]..symbolic.supernode_end()[s];
                let first = range.clone().find(|&p| tree.needed[p])?;
                let (g, m) = supernode_matrices(tree, llt, s);
                let boundary = llt.supernode(s).pattern().iter().map(|&p| place(p)).collect();
                Some(Member { first: place(first) as usize, size: m.ncols(), boundary, g, m })
            })
            .collect();
        Self { places, first_position, inside, members }
    }

    /// Walks the subtree with a unit force on each wanted row, the boundary clamped, and with a unit displacement of each
    /// boundary row: the wanted rows of the solutions are `M` and `-G^T`.
    fn condense(&self, tree: &Tree, node: &Node) -> (Mat<f64>, Mat<f64>) {
        let (size, outer) = (node.size(), node.boundary_size());
        let width = size + outer;
        let mut x = vec![0.0; (self.inside + outer) * width];
        let mut wanted = Vec::with_capacity(size);
        for (offset, &place) in self.places.iter().enumerate() {
            let row = tree.row_of_position[self.first_position + offset];
            if row != NONE {
                x[place as usize * width + row as usize - node.rows.start] = 1.0;
                wanted.push(place as usize);
            }
        }
        for b in 0..outer {
            x[(self.inside + b) * width + size + b] = 1.0;
        }
        let longest = self.members.iter().map(|m| m.boundary.len().max(m.size)).max().unwrap_or(0);
        let mut moved = vec![0.0; longest * width];
        for member in &self.members {
            self.up(member, &mut x, &mut moved, width, size);
        }
        for member in self.members.iter().rev() {
            down(member, &mut x, &mut moved, width, size);
        }
        let m = Mat::from_fn(size, size, |i, j| x[wanted[i] * width + j]);
        let g = Mat::from_fn(outer, size, |i, j| -x[wanted[j] * width + size + i]);
        (g, m)
    }

    /// `f_b -= G f` for the unit forces, inside the subtree: what reaches its boundary is held there.
    fn up(&self, member: &Member, x: &mut [f64], moved: &mut [f64], width: usize, forces: usize) {
        let boundary = member.boundary.len();
        let own = &x[member.first * width..(member.first + member.size) * width];
        let own = MatRef::from_row_major_slice_with_stride(own, member.size, forces, width);
        let product = MatMut::from_row_major_slice_mut(&mut moved[..boundary * forces], boundary, forces);
        matmul(product, Accum::Replace, member.g.as_ref(), own, 1.0, Par::Seq);
        for (&place, part) in member.boundary.iter().zip(moved.chunks_exact(forces)) {
            if (place as usize) < self.inside {
                let row = &mut x[place as usize * width..place as usize * width + forces];
                row.iter_mut().zip(part).for_each(|(value, part)| *value -= part);
            }
        }
    }
}

/// `x = M f - G^T x_b`, `f` being zero for the unit displacements.
fn down(member: &Member, x: &mut [f64], moved: &mut [f64], width: usize, forces: usize) {
    let (size, boundary) = (member.size, member.boundary.len());
    let range = member.first * width..(member.first + size) * width;
    let local = MatMut::from_row_major_slice_mut(&mut moved[..size * forces], size, forces);
    let own = MatRef::from_row_major_slice_with_stride(&x[range.clone()], size, forces, width);
    matmul(local, Accum::Replace, member.m.as_ref(), own, 1.0, Par::Seq);
    for (i, row) in x[range.clone()].chunks_exact_mut(width).enumerate() {
        row[..forces].copy_from_slice(&moved[i * forces..(i + 1) * forces]);
        row[forces..].fill(0.0);
    }
    for (&place, copy) in member.boundary.iter().zip(moved.chunks_exact_mut(width)) {
        copy.copy_from_slice(&x[place as usize * width..(place as usize + 1) * width]);
    }
    let gathered = MatRef::from_row_major_slice(&moved[..boundary * width], boundary, width);
    let own = MatMut::from_row_major_slice_mut(&mut x[range], size, width);
    matmul(own, Accum::Add, member.g.transpose(), gathered, -1.0, Par::Seq);
}
