//! The elimination tree, cut down to what the columns of `Psi` need.
//!
//! Write the factor of a node `k`, a block of columns of a supernode, with the rows below it, its boundary `b`, as `L_kk` and
//! `L_bk`. With
//!
//! ```text
//! G_k = L_bk L_kk^-1,      M_k = L_kk^-T L_kk^-1
//! ```
//!
//! a solve `K x = f` is two sweeps of matrix products and nothing else:
//!
//! ```text
//! up:    f_b -= G_k f_k            from the leaves to the root
//! down:  x_k = M_k f_k - G_k^T x_b        from the root to the leaves
//! ```
//!
//! `M_k` is the compliance of the node with its boundary clamped, and `-G_k^T` its response to its boundary. Only those rows are
//! kept that are loaded or read, or lie in the boundary of a kept row below: for all others `f_k` is zero and `x_k` is not needed.

use std::ops::Range;

use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;

use crate::solver::block_columns::cuts;

/// No parent, no row, no column.
pub const NONE: u32 = u32::MAX;

/// Request for the solution at one permuted position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PositionRequest {
    /// Stage of its column, or [`NONE`]: it is read by its own column and those of its stage before it.
    pub stage: u32,
    /// It is read by every column of the stages before this one; [`NONE`]: of all.
    pub before: u32,
    /// It is loaded and read by the columns of moved supports, which read everything.
    pub supports: bool,
}

impl PositionRequest {
    /// No request.
    pub const NOTHING: Self = Self { stage: NONE, before: 0, supports: false };
}

/// The kept rows of a block of columns of a supernode.
#[derive(Clone, Debug)]
pub struct Node {
    /// The rows.
    pub rows: Range<usize>,
    /// Its boundary: part of [`Tree::boundaries`].
    pub boundary: Range<usize>,
    /// Node of the first boundary row, or [`NONE`].
    pub parent: u32,
    /// Its positions, kept or not.
    pub positions: Range<usize>,
    /// Its number among the blocks of all supernodes.
    pub block: usize,
    /// The supernode.
    supernode: usize,
}

impl Node {
    /// Number of kept rows.
    pub fn size(&self) -> usize {
        self.rows.len()
    }

    /// Number of boundary rows.
    pub fn boundary_size(&self) -> usize {
        self.boundary.len()
    }
}

/// The nodes, children before parents, and the kept rows in their order.
#[derive(Clone)]
pub struct Tree {
    /// All nodes.
    pub nodes: Vec<Node>,
    /// Boundary rows of all nodes, one after the other.
    pub boundaries: Vec<u32>,
    /// For each permuted position its kept row, or [`NONE`].
    pub row_of_position: Vec<u32>,
    /// For each kept row its node.
    pub node_of_row: Vec<u32>,
    /// Readers of the rows, stage by stage.
    pub reading: Reading,
}

/// Which columns of a block read something at which nodes: a sweep down leaves out all others. Column `j` of a stage reads
/// the rows of its stage from its own on, for the earlier ones are the mirror of earlier columns, and all rows of later
/// stages. Rows of earlier stages are never read.
///
/// For each stage and node the last row in its subtree that has a column in that stage, or [`NONE`] if some row there is
/// read by every column of the stage.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Reading(Vec<Vec<u32>>);

impl Reading {
    /// From a tree and the request at each permuted position.
    pub fn new(tree: &Tree, requests: &[PositionRequest]) -> Self {
        let stages = requests.iter().map(|w| w.stage).filter(|&stage| stage != NONE).max().map_or(1, |last| last + 1);
        Self((0..stages).map(|stage| last_read(tree, requests, stage)).collect())
    }

    /// For each node how many of a block's columns, the first ones, read something in its subtree; `rows` are the
    /// ascending kept rows of the columns, `stage` is theirs.
    pub fn readers(&self, stage: usize, rows: &[u32]) -> Vec<usize> {
        let of = |&last: &u32| if last == NONE { rows.len() } else { rows.partition_point(|&row| row <= last) };
        self.0.get(stage).map_or(Vec::new(), |lasts| lasts.iter().map(of).collect())
    }
}

fn last_read(tree: &Tree, requests: &[PositionRequest], stage: u32) -> Vec<u32> {
    // One higher here, so that 0 means nothing read and NONE stays the highest.
    let mut last = vec![0u32; tree.nodes.len()];
    for (position, &row) in tree.row_of_position.iter().enumerate().filter(|(_, row)| **row != NONE) {
        let of_node = &mut last[tree.node_of_row[row as usize] as usize];
        if requests[position].before > stage {
            *of_node = NONE;
        } else if requests[position].stage == stage {
            *of_node = (*of_node).max(row + 1);
        }
    }
    for (k, node) in tree.nodes.iter().enumerate().filter(|(_, node)| node.parent != NONE) {
        last[node.parent as usize] = last[node.parent as usize].max(last[k]);
    }
    last.into_iter().map(|row| if row == NONE { NONE } else { row.saturating_sub(1) }).collect()
}

impl Tree {
    /// Cuts the tree down to the `requests` positions.
    pub fn new(supernodes: &SymbolicSupernodalCholesky<usize>, requests: &[PositionRequest]) -> Self {
        let needed = needed_rows(supernodes, requests);
        let mut tree = Self {
            nodes: Vec::new(),
            boundaries: Vec::new(),
            row_of_position: vec![NONE; requests.len()],
            node_of_row: Vec::new(),
            reading: Reading::default(),
        };
        for (block, (supernode, positions)) in blocks(supernodes).enumerate() {
            let first = tree.node_of_row.len();
            for position in positions.clone().filter(|&p| needed[p]) {
                tree.row_of_position[position] = tree.node_of_row.len() as u32;
                tree.node_of_row.push(tree.nodes.len() as u32);
            }
            let rows = first..tree.node_of_row.len();
            if !rows.is_empty() {
                tree.nodes.push(Node { rows, boundary: 0..0, parent: NONE, positions, block, supernode });
            }
        }
        tree.link(supernodes);
        tree.reading = Reading::new(&tree, requests);
        tree
    }

    /// Whether the row of a permuted position is kept.
    pub fn keeps(&self, position: usize) -> bool {
        self.row_of_position[position] != NONE
    }

    /// Number of kept rows.
    pub fn row_count(&self) -> usize {
        self.node_of_row.len()
    }

    /// Boundary rows of a node.
    pub fn boundary(&self, node: &Node) -> &[u32] {
        &self.boundaries[node.boundary.clone()]
    }

    /// Boundaries and parents, once every row has its number.
    fn link(&mut self, supernodes: &SymbolicSupernodalCholesky<usize>) {
        for node in &mut self.nodes {
            let start = self.boundaries.len();
            let below = boundary_positions(supernodes, node.supernode, node.positions.end);
            self.boundaries.extend(below.map(|position| self.row_of_position[position]));
            node.boundary = start..self.boundaries.len();
            if let Some(&row) = self.boundaries.get(start) {
                node.parent = self.node_of_row[row as usize];
            }
        }
    }
}

/// Supernode and positions of every block of columns.
fn blocks(supernodes: &SymbolicSupernodalCholesky<usize>) -> impl Iterator<Item = (usize, Range<usize>)> + '_ {
    (0..supernodes.n_supernodes()).flat_map(|s| {
        let begin = supernodes.supernode_begin()[s];
        let columns = cuts(supernodes.supernode_end()[s] - begin);
        columns.map(move |(first, width)| (s, begin + first..begin + first + width))
    })
}

/// Positions below a block that ends at `end`: the rest of its supernode, and the rows below that.
fn boundary_positions(
    supernodes: &SymbolicSupernodalCholesky<usize>,
    supernode: usize,
    end: usize,
) -> impl Iterator<Item = usize> + '_ {
    (end..supernodes.supernode_end()[supernode]).chain(supernodes.supernode(supernode).pattern().iter().copied())
}

/// Positions that are requested, or read by a needed block below.
fn needed_rows(supernodes: &SymbolicSupernodalCholesky<usize>, requests: &[PositionRequest]) -> Vec<bool> {
    let mut needed: Vec<bool> = requests.iter().map(|w| w.stage != NONE || w.before == NONE || w.supports).collect();
    for (supernode, positions) in blocks(supernodes) {
        if needed[positions.clone()].contains(&true) {
            for row in boundary_positions(supernodes, supernode, positions.end) {
                needed[row] = true;
            }
        }
    }
    needed
}
