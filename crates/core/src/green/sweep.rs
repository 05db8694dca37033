//! A block of columns through the tree: up with the forces, down with the displacements (see [`super::tree`]).
//!
//! The block's values are stored by rows, all columns of a row together, so that moving the rows of a boundary copies
//! whole cache lines. Every node works on the range of columns that concern it only: up, those with a force in its
//! subtree; down, those that read something there.

use std::ops::Range;

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};

use super::number::Number;
use super::operators::Operator;
use super::tree::{NONE, Tree};

/// One entry of the right-hand sides.
#[derive(Clone, Copy, Debug)]
pub struct Source {
    /// Kept row.
    pub row: u32,
    /// Column in the block.
    pub column: u32,
    /// Force, N.
    pub value: f64,
}

/// The columns that concern one node.
#[derive(Clone, Debug, Default)]
pub struct Reach {
    /// Columns with a force in the subtree (up), in one range.
    pub forced: Range<usize>,
    /// Columns `0..reading` read something in the subtree (down); contains `forced`.
    pub reading: usize,
}

/// The columns of a block that concern each node. `rows` are the ascending kept rows of the block's columns if each
/// reads only rows from its own on; with `None` every column reads every row.
pub fn reaches(tree: &Tree, width: usize, sources: &[Source], rows: Option<&[u32]>) -> Vec<Reach> {
    let mut reaches = vec![Reach { forced: width..0, reading: 0 }; tree.nodes.len()];
    for source in sources {
        let range = &mut reaches[tree.node_of_row[source.row as usize] as usize].forced;
        let column = source.column as usize;
        *range = range.start.min(column)..range.end.max(column + 1);
    }
    for (k, node) in tree.nodes.iter().enumerate() {
        let Range { start, end } = reaches[k].forced;
        if node.parent != NONE {
            let above = &mut reaches[node.parent as usize].forced;
            *above = above.start.min(start)..above.end.max(end);
        }
        reaches[k].forced = if start < end { start..end } else { 0..0 };
        reaches[k].reading = match rows {
            Some(rows) if node.last_wanted != NONE => rows.partition_point(|&row| row <= node.last_wanted),
            _ => width,
        };
    }
    reaches
}

/// Floating-point operations of a block.
pub fn flops(tree: &Tree, reaches: &[Reach]) -> f64 {
    let one = |(node, reach): (&super::tree::Node, &Reach)| {
        let (size, boundary) = (node.size() as f64, node.boundary_size() as f64);
        2.0 * size * ((size + boundary) * reach.forced.len() as f64 + boundary * reach.reading as f64)
    };
    tree.nodes.iter().zip(reaches).map(one).sum()
}

/// Memory of one task.
pub struct Scratch<T> {
    /// Forces and then displacements, kept rows by columns; the columns of a row are `stride` apart from the next row's.
    pub x: Vec<T>,
    /// Columns there is room for.
    pub stride: usize,
    moved: Vec<T>,
    local: Vec<T>,
}

impl<T: Number> Scratch<T> {
    /// Memory for up to `stride` columns.
    pub fn new(tree: &Tree, stride: usize) -> Self {
        let (boundary, size) = largest(tree);
        let zeros = |rows: usize| vec![T::default(); rows * stride];
        Self { x: zeros(tree.row_count()), stride, moved: zeros(boundary), local: zeros(size) }
    }
}

/// Numbers of a [`Scratch`].
pub fn scratch_numbers(tree: &Tree, stride: usize) -> usize {
    let (boundary, size) = largest(tree);
    (tree.row_count() + boundary + size) * stride
}

fn largest(tree: &Tree) -> (usize, usize) {
    let boundary = tree.nodes.iter().map(super::tree::Node::boundary_size).max().unwrap_or(0);
    (boundary, tree.nodes.iter().map(super::tree::Node::size).max().unwrap_or(0))
}

/// The tree with its matrices.
pub struct Sweep<T> {
    /// Structure.
    pub tree: Tree,
    /// Matrices of each node.
    pub operators: Vec<Operator<T>>,
}

impl<T: Number> Sweep<T> {
    /// Solves for the columns of a block. `scratch.x` is then right at the rows and columns that were to be read, and
    /// undefined elsewhere.
    pub fn solve(&self, scratch: &mut Scratch<T>, sources: &[Source], reaches: &[Reach]) {
        let stride = scratch.stride;
        for (node, reach) in self.tree.nodes.iter().zip(reaches).filter(|(_, reach)| !reach.forced.is_empty()) {
            for row in node.rows.clone() {
                scratch.x[row * stride..][reach.forced.clone()].fill(T::default());
            }
        }
        for source in sources {
            scratch.x[source.row as usize * stride + source.column as usize] += T::from_f64(source.value);
        }
        for k in 0..reaches.len() {
            self.up(k, &reaches[k], scratch);
        }
        for k in (0..reaches.len()).rev() {
            self.down(k, &reaches[k], scratch);
        }
    }

    /// `f_b -= G f`.
    fn up(&self, k: usize, reach: &Reach, scratch: &mut Scratch<T>) {
        let node = &self.tree.nodes[k];
        let (width, stride) = (reach.forced.len(), scratch.stride);
        if width == 0 || node.boundary_size() == 0 {
            return;
        }
        let own = columns(&scratch.x, node.rows.clone(), reach.forced.clone(), stride);
        let product = MatMut::from_row_major_slice_mut(
            &mut scratch.moved[..node.boundary_size() * width],
            node.boundary_size(),
            width,
        );
        matmul(product, Accum::Replace, self.operators[k].g(node), own, T::from_f64(1.0), Par::Seq);
        for (&row, part) in self.tree.boundary(node).iter().zip(scratch.moved.chunks_exact(width)) {
            let values = &mut scratch.x[row as usize * stride..][reach.forced.clone()];
            values.iter_mut().zip(part).for_each(|(value, &part)| *value -= part);
        }
    }

    /// `x = M f - G^T x_b`.
    fn down(&self, k: usize, reach: &Reach, scratch: &mut Scratch<T>) {
        let node = &self.tree.nodes[k];
        let (forced, reading, stride) = (reach.forced.len(), reach.reading, scratch.stride);
        if reading == 0 {
            return;
        }
        if forced > 0 {
            let own = columns(&scratch.x, node.rows.clone(), reach.forced.clone(), stride);
            let local = &mut scratch.local[..node.size() * forced];
            let local = MatMut::from_row_major_slice_mut(local, node.size(), forced);
            matmul(local, Accum::Replace, self.operators[k].m(node), own, T::from_f64(1.0), Par::Seq);
        }
        let boundary = self.tree.boundary(node);
        for (&row, copy) in boundary.iter().zip(scratch.moved.chunks_exact_mut(reading)) {
            copy.copy_from_slice(&scratch.x[row as usize * stride..][..reading]);
        }
        let x = &mut scratch.x[node.rows.start * stride..node.rows.end * stride];
        if boundary.is_empty() {
            x.chunks_exact_mut(stride).for_each(|row| row[..reading].fill(T::default()));
        } else {
            let gathered = &scratch.moved[..boundary.len() * reading];
            let gathered = MatRef::from_row_major_slice(gathered, boundary.len(), reading);
            // Not from_row_major_slice_with_stride_mut: faer 0.24 exchanges its strides.
            let own = MatMut::from_column_major_slice_with_stride_mut(x, reading, node.size(), stride).transpose_mut();
            let follow = self.operators[k].g(node).transpose();
            matmul(own, Accum::Replace, follow, gathered, T::from_f64(-1.0), Par::Seq);
        }
        if forced > 0 {
            let local = scratch.local.chunks_exact(forced);
            for (row, part) in x.chunks_exact_mut(stride).zip(local) {
                row[reach.forced.clone()].iter_mut().zip(part).for_each(|(value, &part)| *value += part);
            }
        }
    }
}

/// Some rows and columns of values stored by rows.
fn columns<T: Number>(x: &[T], rows: Range<usize>, columns: Range<usize>, stride: usize) -> MatRef<'_, T> {
    let values = &x[rows.start * stride + columns.start..(rows.end - 1) * stride + columns.end];
    MatRef::from_row_major_slice_with_stride(values, rows.len(), columns.len(), stride)
}
