//! The elimination tree, cut down to what the columns of `Psi` need.
//!
//! Write the factor of a supernode `k` with the rows below it, its boundary `b`, as `L_kk` and `L_bk`. With
//!
//! ```text
//! G_k = L_bk L_kk^-1,      M_k = L_kk^-T L_kk^-1
//! ```
//!
//! a solve `K x = f` is two sweeps of matrix products (the block form `K = (I + G) M^-1 (I + G^T)`):
//!
//! ```text
//! up:    f_b -= G_k f_k            from the leaves to the root
//! down:  x_k = M_k f_k - G_k^T x_b        from the root to the leaves
//! ```
//!
//! `M_k` is the compliance of the supernode with its boundary clamped, `-G_k^T` how it follows its boundary. Only rows
//! are kept that somebody asks for, or that a kept row below reads. The same two matrices exist for a whole subtree:
//! `M` its compliance between the wanted dofs only, `G^T` how those follow the boundary of the subtree, its inner dofs
//! eliminated first and the wanted ones last. Such a condensed subtree (a substructure, in the words of finite elements)
//! is one node here. Whether to condense a subtree or to walk it is decided by counting.

use std::ops::Range;

use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;

/// No parent, no row, no column.
pub const NONE: u32 = u32::MAX;
/// Cost of moving one number of a boundary into place, in floating-point operations that take as long (measured: 20 to
/// 30 for both number formats).
const GATHER_FLOPS: f64 = 24.0;

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

impl Wanted {
    fn any(self) -> bool {
        self.column || self.always || self.supports
    }
}

/// A supernode, or a condensed subtree.
#[derive(Clone, Debug)]
pub struct Node {
    /// Its kept rows.
    pub rows: Range<usize>,
    /// Its boundary: part of [`Tree::boundaries`].
    pub boundary: Range<usize>,
    /// Node of the first boundary row, or [`NONE`].
    pub parent: u32,
    /// The supernodes it is made of: one, or a subtree with its root last.
    pub supernodes: Range<usize>,
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
    /// Whether each position is needed when no subtree is condensed; the condensation itself reads these.
    pub needed: Vec<bool>,
}

/// Sizes of a supernode and of the subtree under it, from which costs are counted.
#[derive(Clone, Copy, Default)]
struct Count {
    needed: f64,
    boundary: f64,
    /// Wanted rows in the subtree.
    wanted: f64,
    /// Columns whose unit force acts in the subtree.
    inside: f64,
    /// Columns that read anything in the subtree.
    readers: f64,
    /// First supernode of the subtree, and how many it has.
    first: usize,
    supernodes: usize,
}

impl Tree {
    /// Cuts the tree down to the `wanted` positions; `condense` allows subtrees to become one node.
    pub fn new(supernodes: &SymbolicSupernodalCholesky<usize>, wanted: &[Wanted], condense: bool) -> Self {
        let needed = needed_rows(supernodes, wanted);
        let (counts, parents) = count(supernodes, wanted, &needed);
        let condensed = if condense { cheaper_condensed(&counts, &parents) } else { vec![false; counts.len()] };
        let mut tree = Self {
            nodes: Vec::new(),
            boundaries: Vec::new(),
            row_of_position: vec![NONE; wanted.len()],
            node_of_row: Vec::new(),
            needed,
        };
        // From the root down, so that a subtree is emitted once, at its highest condensed node; then turned round.
        let mut covered_from = counts.len();
        let mut emitted = Vec::new();
        for s in (0..counts.len()).rev() {
            if s >= covered_from || counts[s].needed == 0.0 {
                continue;
            }
            let first = if condensed[s] { counts[s].first } else { s };
            covered_from = first;
            emitted.push(first..s + 1);
        }
        for supernode_range in emitted.into_iter().rev() {
            tree.emit(supernodes, wanted, supernode_range);
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

    /// Number of nodes that stand for more than a supernode.
    pub fn condensed_count(&self) -> usize {
        self.nodes.iter().filter(|n| n.supernodes.len() > 1).count()
    }

    fn emit(
        &mut self,
        supernodes: &SymbolicSupernodalCholesky<usize>,
        wanted: &[Wanted],
        supernode_range: Range<usize>,
    ) {
        let begin = supernodes.supernode_begin()[supernode_range.start];
        let end = supernodes.supernode_end()[supernode_range.end - 1];
        let whole = supernode_range.len() > 1;
        let first = self.node_of_row.len();
        for position in begin..end {
            if if whole { wanted[position].any() } else { self.needed[position] } {
                self.row_of_position[position] = self.node_of_row.len() as u32;
                self.node_of_row.push(self.nodes.len() as u32);
            }
        }
        self.nodes.push(Node {
            rows: first..self.node_of_row.len(),
            boundary: 0..0,
            parent: NONE,
            supernodes: supernode_range,
            last_wanted: 0,
        });
    }

    /// Boundaries, parents and last wanted rows, once every row has its number.
    fn link(&mut self, supernodes: &SymbolicSupernodalCholesky<usize>, wanted: &[Wanted]) {
        for node in &mut self.nodes {
            let root = node.supernodes.end - 1;
            let start = self.boundaries.len();
            let pattern = supernodes.supernode(root).pattern();
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
    let mut needed: Vec<bool> = wanted.iter().map(|w| w.any()).collect();
    for s in 0..supernodes.n_supernodes() {
        if needed[supernodes.supernode_begin()[s]..supernodes.supernode_end()[s]].contains(&true) {
            for &row in supernodes.supernode(s).pattern() {
                needed[row] = true;
            }
        }
    }
    needed
}

fn count(
    supernodes: &SymbolicSupernodalCholesky<usize>,
    wanted: &[Wanted],
    needed: &[bool],
) -> (Vec<Count>, Vec<Option<usize>>) {
    let supernode_count = supernodes.n_supernodes();
    let mut supernode_of = vec![0; wanted.len()];
    let mut counts: Vec<Count> =
        (0..supernode_count).map(|s| Count { first: s, supernodes: 1, ..Count::default() }).collect();
    let mut parents = vec![None; supernode_count];
    let mut columns_so_far = 0.0;
    let all_columns = wanted.iter().filter(|w| w.column).count() as f64;
    for s in 0..supernode_count {
        let range = supernodes.supernode_begin()[s]..supernodes.supernode_end()[s];
        supernode_of[range.clone()].fill(s);
        let number = |test: &dyn Fn(usize) -> bool| range.clone().filter(|&p| test(p)).count() as f64;
        let own_columns = number(&|p| wanted[p].column);
        columns_so_far += own_columns;
        let c = &mut counts[s];
        c.needed = number(&|p| needed[p]);
        c.boundary = supernodes.supernode(s).pattern().len() as f64;
        c.wanted += number(&|p| wanted[p].any());
        c.inside += own_columns;
        let always = range.clone().any(|p| wanted[p].always);
        c.readers = c.readers.max(if always { all_columns } else { columns_so_far });
    }
    for s in 0..supernode_count {
        if let Some(&row) = supernodes.supernode(s).pattern().first() {
            let (parent, child) = (supernode_of[row], counts[s]);
            parents[s] = Some(parent);
            let p = &mut counts[parent];
            p.wanted += child.wanted;
            p.inside += child.inside;
            p.readers = p.readers.max(child.readers);
            p.first = p.first.min(child.first);
            p.supernodes += child.supernodes;
        }
    }
    (counts, parents)
}

/// For each supernode, whether its subtree is cheaper as one node.
///
/// A node of `n` rows with `b` boundary rows costs a column that acts inside `2 n (n + 2b)` operations and one that only
/// reads it `2 n b`, beside moving the boundary. Condensing costs a walk of the subtree for each of its wanted and
/// boundary rows, once.
fn cheaper_condensed(counts: &[Count], parents: &[Option<usize>]) -> Vec<bool> {
    let cost = |c: &Count, rows: f64| {
        let read = 2.0 * rows * c.boundary + GATHER_FLOPS * c.boundary;
        c.readers * read + c.inside * (read + GATHER_FLOPS * c.boundary + 2.0 * rows * rows)
    };
    let mut walked = vec![0.0; counts.len()];
    let mut one_walk = vec![0.0; counts.len()];
    let mut condensed = vec![false; counts.len()];
    for (s, c) in counts.iter().enumerate() {
        if c.needed > 0.0 {
            walked[s] += cost(c, c.needed);
            one_walk[s] += 2.0 * c.needed * (c.boundary + c.needed) + GATHER_FLOPS * c.boundary;
            let whole = cost(c, c.wanted) + 2.0 * one_walk[s] * (c.wanted + c.boundary);
            // A leaf is one node either way; a subtree is cut out as a range, so nothing else may stand in between.
            let is_range = c.supernodes == s + 1 - c.first;
            if c.first < s && is_range && whole < walked[s] {
                (walked[s], condensed[s]) = (whole, true);
            }
        }
        if let Some(parent) = parents[s] {
            let (below, walk) = (walked[s], one_walk[s]);
            walked[parent] += below;
            one_walk[parent] += walk;
        }
    }
    condensed
}
