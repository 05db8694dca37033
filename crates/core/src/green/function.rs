//! The precomputed operator `Psi` of a body, and queries on it.

use std::path::PathBuf;

use glam::{DMat3, DVec3};

use super::accuracy::Accuracy;
use super::entries::Entries;
use super::node_order::TouchNode;
use super::precision::Precision;
use crate::Result;
use crate::memory::Ranges;
use crate::mesh::Surface;

/// Green's function of a body: columns of touchable surface dofs, rows of surface dofs and then of supported dofs inside.
///
/// Nodes are ranks in `surface_nodes`. Rows and columns count in ascending order of the nodes, whatever the order in which
/// they are stored.
pub struct GreensFunction {
    /// Mesh indices of the surface nodes, ascending (s).
    pub surface_nodes: Vec<u32>,
    /// The surface in its own numbering.
    pub surface: Surface,
    /// Touchable surface nodes as ascending ranks in `surface_nodes` (t); three columns each.
    pub touch: Vec<u32>,
    /// Fixed dofs of the mesh, ascending.
    pub fixed_dofs: Vec<u32>,
    /// For each fixed dof its row.
    pub fixed_rows: Vec<u32>,
    /// Number of rows.
    pub rows: usize,
    /// Whether each row's known is a displacement (a supported dof).
    pub row_is_fixed: Vec<bool>,
    /// The numbers.
    pub(super) entries: Entries,
    /// How far they are from those of the body.
    pub accuracy: Accuracy,
    /// Reference loads on all dofs of the mesh, N; empty for none.
    pub loads: Vec<f64>,
    /// What the reference loads alone do, on the rows: displacements, m, and `K u` on supported rows, N; empty for none.
    pub free_response: Vec<f64>,
    /// Content key.
    pub key: String,
    /// Young's modulus if the whole body has one and no loads, Pa: then it only scales forces.
    pub youngs_modulus: Option<f64>,
    /// What the file was made from, in JSON, for people.
    pub description: String,
    /// The file behind it, if any.
    pub path: Option<PathBuf>,
}

impl GreensFunction {
    /// Adds the memory that a tick reads.
    pub(crate) fn add_memory(&self, ranges: &mut Ranges) {
        self.entries.add_memory(ranges);
        self.surface.add_memory(ranges);
        ranges.add(&self.surface_nodes);
        ranges.add(&self.row_is_fixed);
        ranges.add(&self.free_response);
    }

    /// Number of surface nodes.
    pub fn surface_count(&self) -> usize {
        self.surface_nodes.len()
    }

    /// Number format of the entries.
    pub fn precision(&self) -> Precision {
        self.entries.precision()
    }

    /// Bound `s_i` of a row: `|Psi_ij| <= s_i s_j`; the root of a compliance, and of a stiffness on supported rows.
    pub fn magnitude(&self, row: usize) -> f64 {
        self.entries.magnitude(row)
    }

    /// The columns of surface node `node`; `None` if it may not be touched.
    pub fn touchable(&self, node: usize) -> Option<TouchNode> {
        self.entries.node_order().touchable(node)
    }

    /// One for each axis along which surface node `node` is free, zero for one along which it is supported.
    pub fn free_axes(&self, node: usize) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|axis| if self.row_is_fixed[3 * node + axis] { 0.0 } else { 1.0 }))
    }

    /// Whether the rows of surface node `node` are in memory, so that a tick may ask for them; those of touchable nodes are.
    pub fn is_resident(&self, node: usize) -> bool {
        self.entries.is_resident(node)
    }

    /// Whether everything can still be read: `false` once somebody has cut the file short. Costs a call of the system.
    pub fn is_intact(&self) -> bool {
        self.entries.is_intact()
    }

    /// To be called before whole columns are read ([`Self::add_forces`], [`Self::add_column`], rows of nodes that are
    /// not resident): they are NaN where the file has been cut short.
    ///
    /// # Errors
    /// [`crate::Error::Store`] for a file that was cut short while in use.
    pub fn require_intact(&self) -> Result<()> {
        self.entries.require_intact()
    }

    /// `W^T Psi W` of one patch, m/N: mean displacement per unit force, both weighted. `nodes[i]` and `columns[i]` are the
    /// same node. Each pair of nodes is read once; supported dofs contribute nothing; the result is symmetric to the bit.
    /// Never allocates.
    pub fn symmetric_block(&self, nodes: &[u32], columns: &[TouchNode], weights: &[f64]) -> DMat3 {
        debug_assert!(nodes.iter().zip(columns).all(|(&n, &c)| self.touchable(n as usize) == Some(c)));
        self.entries.symmetric_block(columns, weights)
    }

    /// `W_a^T Psi W_b`, m/N: mean displacement of the nodes `a` (any of the surface) per unit force spread over the columns
    /// `b`, axis of the force by column. Supported dofs contribute nothing. Never allocates while the nodes are resident.
    pub fn weighted_block(
        &self,
        nodes: &[u32],
        node_weights: &[f64],
        columns: &[TouchNode],
        column_weights: &[f64],
    ) -> DMat3 {
        self.entries.weighted_block(nodes, node_weights, columns, column_weights)
    }

    /// Copies the entries of row nodes and column nodes to `out`: columns contiguous, `3 rows` by `3 columns`, three a
    /// node. Supported dofs stand there with their own entries.
    pub fn block(&self, rows: &[u32], columns: &[TouchNode], out: &mut [f64]) {
        self.entries.block(rows, columns, out);
    }

    /// Entry of row `row` and column `column`.
    pub fn entry(&self, row: usize, column: usize) -> f64 {
        self.entries.entry(row, self.node_of_column(column), column % 3)
    }

    /// `out += factor * Psi(:, column)`, on all rows.
    pub fn add_column(&self, column: usize, factor: f64, out: &mut [f64]) {
        self.entries.add_column(self.node_of_column(column), column % 3, factor, out);
    }

    /// Adds `Psi f` to the displacements (m) of all surface dofs (3s) for forces on nodes, N; supported dofs take no force
    /// and do not move. Made for frames: each column is read once, in the order of the store.
    pub fn add_forces(&self, forces: &[(TouchNode, DVec3)], out: &mut [f64]) {
        self.entries.add_forces(forces, out);
    }

    /// Reference load on the dof of surface row `row`, N.
    pub fn load_on_row(&self, row: usize) -> f64 {
        let dof = 3 * self.surface_nodes[row / 3] as usize + row % 3;
        self.loads.get(dof).copied().unwrap_or(0.0)
    }

    /// Displacements of the surface dofs (3s) under the reference loads alone, m.
    pub fn free_displacements(&self) -> Vec<f64> {
        let mut u = vec![0.0; 3 * self.surface_count()];
        for (row, (u, &response)) in u.iter_mut().zip(&self.free_response).enumerate() {
            if !self.row_is_fixed[row] {
                *u = response;
            }
        }
        u
    }

    /// Row of the dof in column `column`.
    pub fn row_of_column(&self, column: usize) -> usize {
        3 * self.touch[column / 3] as usize + column % 3
    }

    fn node_of_column(&self, column: usize) -> TouchNode {
        self.entries.node_order().touch_node(self.touch[column / 3])
    }
}
