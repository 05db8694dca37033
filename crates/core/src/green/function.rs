//! The precomputed operator `Psi` of a body, and queries on it.

use std::path::PathBuf;

use glam::DVec3;

use super::accuracy::Accuracy;
use super::entries::Entries;
use super::node_order::TouchNode;
use super::precision::Precision;
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

    /// The columns of surface node `node`; `None` if it may not be touched.
    pub fn touchable(&self, node: usize) -> Option<TouchNode> {
        self.entries.node_order().touchable(node)
    }

    /// One for each axis along which surface node `node` is free, zero for one along which it is supported.
    pub fn free_axes(&self, node: usize) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|axis| if self.row_is_fixed[3 * node + axis] { 0.0 } else { 1.0 }))
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
}
