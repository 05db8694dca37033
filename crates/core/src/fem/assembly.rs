//! Assembly of the stiffness and mass matrices, in parallel and with the same bits for any number of threads.
//!
//! Each node's three columns are summed by one task from the elements around the node, in element order: no atomics,
//! and no sum depends on scheduling.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::Isotropic;
use crate::element::{Tet4, Tet10, Tetrahedron, determinant, gradients};
use crate::mesh::{TetMesh, Tets, node_elements, positions};
use crate::tensor::outer;

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

    /// Entry of the diagonal.
    pub fn diagonal(&self, dof: u32) -> f64 {
        self.column(dof as usize).find(|&(row, _)| row == dof).map_or(0.0, |(_, value)| value)
    }
}

/// Stiffness matrix of all dofs, N/m.
///
/// With the gradients `g` at a point of quadrature that stands for the volume `V`, the element block is the sum of
/// `K_ab = V [ lambda g_a g_b^T + mu g_b g_a^T + mu (g_a . g_b) I ]`, which is `V B_a^T D B_b` (paper 2.10) written out.
pub fn stiffness(mesh: &TetMesh, materials: &[Isotropic]) -> SymmetricCsc {
    match &mesh.tets {
        Tets::Linear(tets) => stiffness_of::<Tet4, 4>(&mesh.nodes, tets, materials),
        Tets::Quadratic(tets) => stiffness_of::<Tet10, 10>(&mesh.nodes, tets, materials),
    }
}

/// Mass matrix of all dofs, kg: consistent `int rho N_a N_b dV`, or lumped to the diagonal.
///
/// The lumped mass of a node is its diagonal entry of the consistent matrix, scaled so that the element keeps its mass
/// (E. Hinton, T. Rock and O. C. Zienkiewicz, 1976): positive for every element, a quarter each for four nodes.
pub fn mass(mesh: &TetMesh, materials: &[Isotropic], lumped: bool) -> SymmetricCsc {
    match (&mesh.tets, lumped) {
        (Tets::Linear(tets), false) => mass_of::<Tet4, 4>(&mesh.nodes, tets, materials),
        (Tets::Quadratic(tets), false) => mass_of::<Tet10, 10>(&mesh.nodes, tets, materials),
        (Tets::Linear(tets), true) => lumped_mass_of::<Tet4, 4>(&mesh.nodes, tets, materials),
        (Tets::Quadratic(tets), true) => lumped_mass_of::<Tet10, 10>(&mesh.nodes, tets, materials),
    }
}

fn stiffness_of<E: Tetrahedron<N>, const N: usize>(
    nodes: &[DVec3],
    tets: &[[u32; N]],
    materials: &[Isotropic],
) -> SymmetricCsc {
    assemble(nodes.len(), tets, |e, column| {
        let places = positions(nodes, &tets[e]);
        let (lambda, mu) = materials[e].lame();
        let mut blocks = [DMat3::ZERO; N];
        for point in E::stiffness_rule(&places) {
            let (gradients, volume) = gradients::<E, N>(&places, point);
            let gb = gradients[column];
            for (block, ga) in blocks.iter_mut().zip(gradients) {
                let shear = DMat3::from_diagonal(DVec3::splat(mu * ga.dot(gb)));
                *block += volume * (outer(ga, gb) * lambda + outer(gb, ga) * mu + shear);
            }
        }
        blocks
    })
}

fn mass_of<E: Tetrahedron<N>, const N: usize>(
    nodes: &[DVec3],
    tets: &[[u32; N]],
    materials: &[Isotropic],
) -> SymmetricCsc {
    assemble(nodes.len(), tets, |e, column| {
        let places = positions(nodes, &tets[e]);
        let mut entries = [0.0; N];
        for point in E::mass_rule(&places) {
            let shapes = E::shapes(point.xi);
            let mass = materials[e].density * point.weight * determinant::<E, N>(&places, point.xi);
            for (entry, shape) in entries.iter_mut().zip(shapes) {
                *entry += mass * (shape * shapes[column]);
            }
        }
        entries.map(|m| DMat3::from_diagonal(DVec3::splat(m)))
    })
}

fn lumped_mass_of<E: Tetrahedron<N>, const N: usize>(
    nodes: &[DVec3],
    tets: &[[u32; N]],
    materials: &[Isotropic],
) -> SymmetricCsc {
    let mut of_node = vec![0.0; nodes.len()];
    for (tet, material) in tets.iter().zip(materials) {
        let places = positions(nodes, tet);
        let (mut squares, mut volume) = ([0.0; N], 0.0);
        for point in E::mass_rule(&places) {
            let part = point.weight * determinant::<E, N>(&places, point.xi);
            volume += part;
            for (square, shape) in squares.iter_mut().zip(E::shapes(point.xi)) {
                *square += part * shape * shape;
            }
        }
        let scale = material.density * volume / squares.iter().sum::<f64>();
        for (&node, square) in tet.iter().zip(squares) {
            of_node[node as usize] += scale * square;
        }
    }
    let dimension = 3 * nodes.len();
    SymmetricCsc {
        dimension,
        column_start: (0..=dimension).collect(),
        rows: (0..dimension as u32).collect(),
        values: of_node.iter().flat_map(|&m| [m; 3]).collect(),
    }
}

/// Sums the columns of blocks `column_of(element, local node)` over the elements around each node.
///
/// An element's geometry is worked out anew for each of its nodes: that costs less than the blocks themselves, and no
/// memory.
fn assemble<const N: usize>(
    node_count: usize,
    tets: &[[u32; N]],
    column_of: impl Fn(usize, usize) -> [DMat3; N] + Sync,
) -> SymmetricCsc {
    let (start, around) = node_elements(node_count, tets);
    let columns: Vec<(Vec<u32>, Vec<DMat3>)> = (0..node_count)
        .into_par_iter()
        .map(|node| {
            let elements = &around[start[node]..start[node + 1]];
            let mut rows: Vec<u32> = elements.iter().flat_map(|&(e, _)| tets[e as usize]).collect();
            rows.sort_unstable();
            rows.dedup();
            let mut blocks = vec![DMat3::ZERO; rows.len()];
            for &(e, local) in elements {
                for (row, block) in tets[e as usize].iter().zip(column_of(e as usize, local as usize)) {
                    blocks[rows.partition_point(|r| r < row)] += block;
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
