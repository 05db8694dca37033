//! Assembly of the stiffness and mass matrices, in parallel and with the same bits for any number of threads.
//!
//! Each node's three columns are summed by one task from the elements around the node, in element order: no atomics,
//! and no sum depends on scheduling.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::Isotropic;
use crate::mesh::TetMesh;

/// A symmetric matrix with both triangles stored, compressed by columns, rows ascending.
#[derive(Clone, Debug)]
pub struct SymmetricCsc {
    /// Number of rows and columns.
    pub dimension: usize,
    /// Start of each column; `dimension + 1` entries.
    pub column_start: Vec<usize>,
    /// Row of each entry.
    pub rows: Vec<u32>,
    /// Value of each entry.
    pub values: Vec<f64>,
}

impl SymmetricCsc {
    /// The `(row, value)` pairs of a column.
    pub fn column(&self, j: usize) -> impl Iterator<Item = (u32, f64)> + '_ {
        let range = self.column_start[j]..self.column_start[j + 1];
        self.rows[range.clone()].iter().copied().zip(self.values[range].iter().copied())
    }
}

/// Stiffness matrix of all dofs, N/m.
///
/// With constant gradients `g` the element block is
/// `K_ab = V [ lambda g_a g_b^T + mu g_b g_a^T + mu (g_a . g_b) I ]`, which is `V B_a^T D B_b` (paper 2.10) written out.
pub fn stiffness(mesh: &TetMesh, materials: &[Isotropic]) -> SymmetricCsc {
    let elements: Vec<([DVec3; 4], f64, f64, f64)> = (0..mesh.tets.len())
        .into_par_iter()
        .map(|e| {
            let (lambda, mu) = materials[e].lame();
            (mesh.shape_gradients(e), mesh.volume(e), lambda, mu)
        })
        .collect();
    assemble(mesh, |e, a, b| {
        let (gradients, volume, lambda, mu) = &elements[e];
        let (ga, gb) = (gradients[a], gradients[b]);
        volume * (outer(ga, gb) * *lambda + outer(gb, ga) * *mu + DMat3::from_diagonal(DVec3::splat(mu * ga.dot(gb))))
    })
}

/// Mass matrix of all dofs, kg: consistent `rho V (1 + delta_ab) / 20`, or lumped `rho V / 4` on the diagonal.
pub fn mass(mesh: &TetMesh, materials: &[Isotropic], lumped: bool) -> SymmetricCsc {
    assemble(mesh, |e, a, b| {
        let element_mass = materials[e].density * mesh.volume(e);
        let share = match (lumped, a == b) {
            (true, true) => 0.25,
            (true, false) => 0.0,
            (false, true) => 0.1,
            (false, false) => 0.05,
        };
        DMat3::from_diagonal(DVec3::splat(element_mass * share))
    })
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// Sums `block(element, row corner, column corner)` over the elements.
fn assemble(mesh: &TetMesh, block: impl Fn(usize, usize, usize) -> DMat3 + Sync) -> SymmetricCsc {
    let (start, around) = mesh.node_elements();
    let columns: Vec<(Vec<u32>, Vec<DMat3>)> = (0..mesh.nodes.len())
        .into_par_iter()
        .map(|node| {
            let elements = &around[start[node]..start[node + 1]];
            let mut rows: Vec<u32> = elements.iter().flat_map(|&(e, _)| mesh.tets[e as usize]).collect();
            rows.sort_unstable();
            rows.dedup();
            let mut blocks = vec![DMat3::ZERO; rows.len()];
            for &(e, b) in elements {
                for (a, row) in mesh.tets[e as usize].iter().enumerate() {
                    let at = rows.partition_point(|r| r < row);
                    blocks[at] += block(e as usize, a, b as usize);
                }
            }
            (rows, blocks)
        })
        .collect();
    expand(&columns)
}

/// Block columns of 3x3 blocks to scalar columns.
fn expand(columns: &[(Vec<u32>, Vec<DMat3>)]) -> SymmetricCsc {
    let dimension = 3 * columns.len();
    let entries: usize = columns.iter().map(|(rows, _)| 9 * rows.len()).sum();
    let mut matrix = SymmetricCsc {
        dimension,
        column_start: Vec::with_capacity(dimension + 1),
        rows: Vec::with_capacity(entries),
        values: Vec::with_capacity(entries),
    };
    matrix.column_start.push(0);
    for (rows, blocks) in columns {
        for axis in 0..3 {
            for (row, block) in rows.iter().zip(blocks) {
                let column = block.col(axis).to_array();
                for (k, value) in column.into_iter().enumerate() {
                    matrix.rows.push(3 * row + k as u32);
                    matrix.values.push(value);
                }
            }
            matrix.column_start.push(matrix.rows.len());
        }
    }
    matrix
}
