//! The elimination tree, cut down to what the columns of `Psi` need.
//!
//! Write the factor of a supernode `k` with the rows below it, its boundary `b`, as `L_kk` and `L_bk`. With
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
//! `M_k` is the compliance of the supernode with its boundary clamped, `-G_k^T` how it follows its boundary. Only rows
//! are kept that somebody loads or reads, or that a kept row below has in its boundary: for all others `f_k` is zero
//! and nobody asks for `x_k`.

use std::ops::Range;

use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;

/// No parent, no row, no column.
pub const NONE: u32 = u32::MAX;

/// What is asked of the solution at one permuted position.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wanted {
    /// It has a column of its own: it is read by its own column and those before it.
    pub column: bool,
    /// It is read by every column.
    pub always: bool,
    /// It is loaded and read by the columns of moved supports, which read everything.
    pub supports: bool,
}

/// The kept rows of a supernode.
#[derive(Clone, Debug)]
pub struct Node {
    /// Them.
    pub rows: Range<usize>,
    /// Its boundary: part of [`Tree::boundaries`].
    pub boundary: Range<usize>,
    /// Node of the first boundary row, or [`NONE`].
    pub parent: u32,
    /// The supernode.
    pub supernode: usize,
    /// Last row in its subtree that has a column, or [`NONE`] if some row there is read by every column.
    pub last_wanted: u32,
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
pub struct Tree {
    /// All nodes.
    pub nodes: Vec<Node>,
    /// Boundary rows of all nodes, one after the other.
    pub boundaries: Vec<u32>,
    /// For each permuted position its kept row, or [`NONE`].
    pub row_of_position: Vec<u32>,
    /// For each kept row its node.
    pub node_of_row: Vec<u32>,
}

impl Tree {
    /// Cuts the tree down to the `wanted` positions.
    pub fn new(supernodes: &SymbolicSupernodalCholesky<usize>, wanted: &[Wanted]) -> Self {
        let needed = needed_rows(supernodes, wanted);
        let mut tree = Self {
            nodes: Vec::new(),
            boundaries: Vec::new(),
            row_of_position: vec![NONE; wanted.len()],
            node_of_row: Vec::new(),
        };
        for supernode in 0..supernodes.n_supernodes() {
            let first = tree.node_of_row.len();
            let range = supernodes.supernode_begin()[supernode]..supernodes.supernode_end()[supernode];
            for position in range.filter(|&p| needed[p]) {
                tree.row_of_position[position] = tree.node_of_row.len() as u32;
                tree.node_of_row.push(tree.nodes.len() as u32);
            }
            let rows = first..tree.node_of_row.len();
            if !rows.is_empty() {
                tree.nodes.push(Node { rows, boundary: 0..0, parent: NONE, supernode, last_wanted: 0 });
            }
        }
        tree.link(supernodes, wanted);
        tree
    }

    /// Number of kept rows.
    pub fn row_count(&self) -> usize {
        self.node_of_row.len()
    }

    /// Boundary rows of a node.
    pub fn boundary(&self, node: &Node) -> &[u32] {
        &self.boundaries[node.boundary.clone()]
    }

    /// Boundaries, parents and last wanted rows, once every row has its number.
    fn link(&mut self, supernodes: &SymbolicSupernodalCholesky<usize>, wanted: &[Wanted]) {
        for node in &mut self.nodes {
            let start = self.boundaries.len();
            let pattern = supernodes.supernode(node.supernode).pattern();
            self.boundaries.extend(pattern.iter().map(|&position| self.row_of_position[position]));
            node.boundary = start..self.boundaries.len();
            if let Some(&row) = self.boundaries.get(start) {
                node.parent = self.node_of_row[row as usize];
            }
        }
        // `last_wanted` is kept one higher here, so that 0 means nothing wanted and NONE stays the highest.
        for (position, &row) in self.row_of_position.iter().enumerate().filter(|(_, row)| **row != NONE) {
            let node = &mut self.nodes[self.node_of_row[row as usize] as usize];
            if wanted[position].always {
                node.last_wanted = NONE;
            } else if wanted[position].column {
                node.last_wanted = node.last_wanted.max(row + 1);
            }
        }
        for k in 0..self.nodes.len() {
            let (parent, last) = (self.nodes[k].parent, self.nodes[k].last_wanted);
            if parent != NONE {
                let parent = &mut self.nodes[parent as usize];
                parent.last_wanted = parent.last_wanted.max(last);
            }
            if last != NONE {
                self.nodes[k].last_wanted = last.saturating_sub(1);
            }
        }
    }
}

/// Positions that are wanted, or read by a needed supernode below.
fn needed_rows(supernodes: &SymbolicSupernodalCholesky<usize>, wanted: &[Wanted]) -> Vec<bool> {
    let mut needed: Vec<bool> = wanted.iter().map(|w| w.column || w.always || w.supports).collect();
    for s in 0..supernodes.n_supernodes() {
        if needed[supernodes.supernode_begin()[s]..supernodes.supernode_end()[s]].contains(&true) {
            for &row in supernodes.supernode(s).pattern() {
                needed[row] = true;
            }
        }
    }
    needed
}
