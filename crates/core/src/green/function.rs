//! The precomputed operator `Psi` of a body, and queries on it.

use std::path::PathBuf;

use glam::DVec3;

use super::accuracy::Accuracy;
use super::columns_file::ColumnsFile;
use super::entries::Entries;
use super::node_order::TouchNode;
use super::numbers::One;
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

    /// The columns of surface node `node`; `None` if it may not be touched.
    pub fn touchable(&self, node: usize) -> Option<TouchNode> {
        self.entries.node_order.touchable(node)
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

    /// Bound `s_i` of a row: `|Psi_ij| <= s_i s_j`; the root of a compliance, and of a stiffness on supported rows.
    pub fn magnitude(&self, row: usize) -> f64 {
        let entries = &self.entries;
        entries.magnitude.get(entries.node_order.stored_row(row)).copied().unwrap_or(0.0)
    }

    /// Whether the rows of surface node `node` are in memory, so that a tick may ask for them; those of touchable nodes are.
    pub fn is_resident(&self, node: usize) -> bool {
        3 * self.entries.node_order.place(node) < self.entries.resident
    }

    /// Whether everything can still be read: `false` once somebody has cut the file short. Costs a call of the system.
    pub fn is_intact(&self) -> bool {
        self.entries.file.as_ref().is_none_or(ColumnsFile::is_intact)
    }

    /// To be called before whole columns are read ([`Self::add_forces`], [`Self::add_column`], rows of nodes that are
    /// not resident): they are NaN where the file has been cut short.
    ///
    /// # Errors
    /// [`crate::Error::Store`] for a file that was cut short while in use.
    pub fn require_intact(&self) -> Result<()> {
        self.entries.file.as_ref().map_or(Ok(()), ColumnsFile::require_intact)
    }

    /// Entry of row `row` and column `column`.
    pub fn entry(&self, row: usize, column: usize) -> f64 {
        let entries = &self.entries;
        let (row, column) = (entries.node_order.stored_row(row), self.stored_column(column));
        let value = if row < entries.resident {
            entries.numbers.run(entries.arch, One(column * entries.resident + row))
        } else {
            entries.read_from_file::<1>(row, column)[0]
        };
        // The product of the scales first: it is the same for the mirrored entry.
        entries.scale_of(row) * entries.scale_of(column) * value
    }

    /// `out += factor * Psi(:, column)`, on all rows.
    pub fn add_column(&self, column: usize, factor: f64, out: &mut [f64]) {
        let (entries, column) = (&self.entries, self.stored_column(column));
        let mut sums = vec![0.0; entries.rows];
        entries.add_columns(&[(column, factor * entries.scale_of(column))], &mut sums);
        let (surface, inside) = sums.split_at(3 * entries.free.len());
        for (place, (&node, sums)) in entries.node_order.nodes().iter().zip(surface.chunks_exact(3)).enumerate() {
            for (axis, sum) in sums.iter().enumerate() {
                out[3 * node as usize + axis] += entries.scale_of(3 * place + axis) * sum;
            }
        }
        for (row, sum) in (surface.len()..).zip(inside) {
            out[row] += entries.scale_of(row) * sum;
        }
    }

    /// Adds `Psi f` to the displacements (m) of all surface dofs (3s) for forces on nodes, N; supported dofs take no force
    /// and do not move. Made for frames: each column is read once, in the order of the store.
    pub fn add_forces(&self, forces: &[(TouchNode, DVec3)], out: &mut [f64]) {
        let entries = &self.entries;
        let of_node = |&(node, force): &(TouchNode, DVec3)| {
            let free = entries.free[node.place()];
            (0..3).map(move |axis| (3 * node.place() + axis, free[axis] * force[axis]))
        };
        let columns: Vec<(usize, f64)> = forces.iter().flat_map(of_node).filter(|&(_, factor)| factor != 0.0).collect();
        let mut sums = vec![0.0; 3 * entries.free.len()];
        entries.add_columns(&columns, &mut sums);
        for (place, (&node, sums)) in entries.node_order.nodes().iter().zip(sums.chunks_exact(3)).enumerate() {
            for axis in 0..3 {
                out[3 * node as usize + axis] += entries.free[place][axis] * sums[axis];
            }
        }
    }

    /// Column of the store for a column in the user's order.
    fn stored_column(&self, column: usize) -> usize {
        self.entries.node_order.stored_row(self.row_of_column(column))
    }
}
