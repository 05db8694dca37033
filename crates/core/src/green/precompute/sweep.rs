//! A block of columns through the tree: up with the loads, down with the displacements (see [`super::tree`]).
//!
//! The block's values are stored by rows, all columns of a row together, so that moving the rows of a boundary copies
//! whole cache lines. Every node works on the range of columns that concern it only: up, those with a load in its
//! subtree; down, those that read something there.

use std::ops::Range;

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use rayon::prelude::*;

use super::number::Number;
use super::operators::Operator;
use super::tree::{NONE, Node, Tree};

/// Most columns that are solved one block at a time, with each large matrix shared among the threads and read once.
const NARROW: usize = 32;
/// Numbers of a matrix that is shared.
const SHARED: usize = 1 << 18;
/// Rows and columns of a shared matrix that a thread takes at a time.
const ROWS: usize = 1024;
const COLUMNS: usize = 32;

/// One entry of the right-hand sides.
#[derive(Clone, Copy, Debug)]
pub struct Source {
    /// Kept row.
    pub row: u32,
    /// Column in the block.
    pub column: u32,
    /// Load, N.
    pub value: f64,
}

/// For each node the columns with a load in its subtree, in one range.
pub fn loaded(tree: &Tree, width: usize, sources: &[Source]) -> Vec<Range<usize>> {
    let (mut starts, mut ends) = (vec![width; tree.nodes.len()], vec![0; tree.nodes.len()]);
    for source in sources {
        let k = tree.node_of_row[source.row as usize] as usize;
        starts[k] = starts[k].min(source.column as usize);
        ends[k] = ends[k].max(source.column as usize + 1);
    }
    for (k, node) in tree.nodes.iter().enumerate().filter(|(_, node)| node.parent != NONE) {
        let parent = node.parent as usize;
        starts[parent] = starts[parent].min(starts[k]);
        ends[parent] = ends[parent].max(ends[k]);
    }
    starts.into_iter().zip(ends).map(|(start, end)| if start < end { start..end } else { 0..0 }).collect()
}

/// Memory of one task.
pub struct Scratch<C> {
    /// Loads and then displacements, kept rows by columns.
    pub x: Vec<C>,
    /// Columns there is room for: how far a row is from the next.
    pub stride: usize,
    moved: Vec<C>,
    local: Vec<C>,
}

impl<C: Number> Scratch<C> {
    /// Memory for up to `stride` columns.
    pub fn new(tree: &Tree, stride: usize) -> Self {
        let (boundary, size) = largest(tree);
        let zeros = |rows: usize| vec![C::default(); rows * stride];
        Self { x: zeros(tree.row_count()), stride, moved: zeros(boundary), local: zeros(size) }
    }

    /// The first `width` columns of a kept row.
    pub fn row(&self, tree_row: u32, width: usize) -> &[C] {
        &self.x[tree_row as usize * self.stride..][..width]
    }
}

/// Numbers of a [`Scratch`].
pub fn scratch_numbers(tree: &Tree, stride: usize) -> usize {
    let (boundary, size) = largest(tree);
    (tree.row_count() + boundary + size) * stride
}

fn largest(tree: &Tree) -> (usize, usize) {
    let boundary = tree.nodes.iter().map(Node::boundary_size).max().unwrap_or(0);
    (boundary, tree.nodes.iter().map(Node::size).max().unwrap_or(0))
}

/// The tree with its matrices.
pub struct Sweep<C> {
    /// Structure.
    pub tree: Tree,
    /// Matrices of each node.
    pub operators: Vec<Operator<C>>,
}

impl<C: Number> Sweep<C> {
    /// Solves for the columns of a block: `scratch.x` is then right at the rows and columns that are read, and undefined
    /// elsewhere. `loaded` is that of the function of that name; `readers` says for each node how many columns, the first
    /// ones, read something in its subtree.
    pub fn solve(&self, scratch: &mut Scratch<C>, sources: &[Source], loaded: &[Range<usize>], readers: &[usize]) {
        let stride = scratch.stride;
        for (node, columns) in self.tree.nodes.iter().zip(loaded).filter(|(_, columns)| !columns.is_empty()) {
            for row in node.rows.clone() {
                scratch.x[row * stride..][columns.clone()].fill(C::default());
            }
        }
        for source in sources {
            scratch.x[source.row as usize * stride + source.column as usize] += C::from_f64(source.value);
        }
        for k in (0..loaded.len()).filter(|&k| !loaded[k].is_empty()) {
            self.up(k, &loaded[k], scratch);
        }
        for k in (0..loaded.len()).rev().filter(|&k| readers[k] > 0) {
            self.down(k, &loaded[k], readers[k], scratch);
        }
    }

    /// Whether the threads share the matrices of a node.
    fn is_shared(&self, k: usize, width: usize) -> bool {
        let node = &self.tree.nodes[k];
        width <= NARROW && node.size() * node.boundary_size() >= SHARED
    }

    /// `f_b -= G f`.
    fn up(&self, k: usize, columns: &Range<usize>, scratch: &mut Scratch<C>) {
        let node = &self.tree.nodes[k];
        let (boundary, width) = (node.boundary_size(), columns.len());
        if boundary == 0 {
            return;
        }
        let loads = part(&scratch.x, node, columns, scratch.stride);
        let (g, shared) = (self.operators[k].g(), self.is_shared(k, width));
        let product = |(piece, product): (usize, &mut [C])| {
            let rows = product.len() / width;
            let product = MatMut::from_row_major_slice_mut(product, rows, width);
            matmul(product, Accum::Replace, g.subrows(piece * ROWS, rows), loads, C::from_f64(1.0), Par::Seq);
        };
        let moved = &mut scratch.moved[..boundary * width];
        if shared {
            moved.par_chunks_mut(ROWS * width).enumerate().for_each(product);
        } else {
            let whole = MatMut::from_row_major_slice_mut(moved, boundary, width);
            matmul(whole, Accum::Replace, g, loads, C::from_f64(1.0), Par::Seq);
        }
        for (&row, part) in self.tree.boundary(node).iter().zip(scratch.moved.chunks_exact(width)) {
            let values = &mut scratch.x[row as usize * scratch.stride..][columns.clone()];
            values.iter_mut().zip(part).for_each(|(value, &part)| *value -= part);
        }
    }

    /// `x = M f - G^T x_b` for the first `readers` columns, which contain those that are loaded.
    fn down(&self, k: usize, columns: &Range<usize>, readers: usize, scratch: &mut Scratch<C>) {
        let (node, stride) = (&self.tree.nodes[k], scratch.stride);
        if !columns.is_empty() {
            let local = &mut scratch.local[..node.size() * columns.len()];
            let local = MatMut::from_row_major_slice_mut(local, node.size(), columns.len());
            let loads = part(&scratch.x, node, columns, stride);
            matmul(local, Accum::Replace, self.operators[k].m(), loads, C::from_f64(1.0), Par::Seq);
        }
        let boundary = self.tree.boundary(node);
        for (&row, copy) in boundary.iter().zip(scratch.moved.chunks_exact_mut(readers)) {
            copy.copy_from_slice(&scratch.x[row as usize * stride..][..readers]);
        }
        let x = &mut scratch.x[node.rows.start * stride..node.rows.end * stride];
        if boundary.is_empty() {
            x.chunks_exact_mut(stride).for_each(|row| row[..readers].fill(C::default()));
        } else {
            let gathered = &scratch.moved[..boundary.len() * readers];
            let gathered = MatRef::from_row_major_slice(gathered, boundary.len(), readers);
            let g = self.operators[k].g();
            let follow = |(piece, x): (usize, &mut [C])| {
                let rows = x.len() / stride;
                // Not from_row_major_slice_with_stride_mut: faer 0.24 exchanges its strides.
                let own = MatMut::from_column_major_slice_with_stride_mut(x, readers, rows, stride).transpose_mut();
                let follow = g.subcols(piece * COLUMNS, rows).transpose();
                matmul(own, Accum::Replace, follow, gathered, C::from_f64(-1.0), Par::Seq);
            };
            if self.is_shared(k, readers) {
                x.par_chunks_mut(COLUMNS * stride).enumerate().for_each(follow);
            } else {
                follow((0, x));
            }
        }
        if !columns.is_empty() {
            for (row, part) in x.chunks_exact_mut(stride).zip(scratch.local.chunks_exact(columns.len())) {
                row[columns.clone()].iter_mut().zip(part).for_each(|(value, &part)| *value += part);
            }
        }
    }
}

/// Some columns of a node's rows.
fn part<'x, C>(x: &'x [C], node: &Node, columns: &Range<usize>, stride: usize) -> MatRef<'x, C> {
    let values = &x[node.rows.start * stride + columns.start..(node.rows.end - 1) * stride + columns.end];
    MatRef::from_row_major_slice_with_stride(values, node.size(), columns.len(), stride)
}
