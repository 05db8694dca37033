//! Columns that exist: those of touchable nodes.

use glam::{DMat3, DVec3};

use super::GreensFunction;

/// A touchable node: its rank among them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TouchNode(u32);

impl GreensFunction {
    /// The columns of a surface node (a rank in `surface_nodes`), if it may be touched.
    pub fn touchable(&self, node: usize) -> Option<TouchNode> {
        self.touch_rank.get(node).copied().filter(|&rank| rank != u32::MAX).map(TouchNode)
    }

    /// `W^T Psi W` of a patch.
    pub fn symmetric_block(&self, nodes: &[u32], columns: &[TouchNode], weights: &[f64]) -> DMat3 {
        let block = self.weighted_block(nodes, weights, columns, weights);
        0.5 * (block + block.transpose())
    }

    /// `W_a^T Psi W_b`.
    pub fn weighted_block(&self, nodes: &[u32], weights: &[f64], columns: &[TouchNode], others: &[f64]) -> DMat3 {
        let mut sum = [[0.0; 3]; 3];
        for (&TouchNode(rank), source_weight) in columns.iter().zip(others) {
            for (axis, column_sum) in sum.iter_mut().enumerate() {
                let column = 3 * rank as usize + axis;
                if self.row_is_fixed[self.row_of_column(column)] {
                    continue;
                }
                for (&target, target_weight) in nodes.iter().zip(weights) {
                    let weight = source_weight * target_weight;
                    for (k, s) in column_sum.iter_mut().enumerate() {
                        let row = 3 * target as usize + k;
                        if !self.row_is_fixed[row] {
                            *s += weight * self.entry(row, column);
                        }
                    }
                }
            }
        }
        DMat3::from_cols_array_2d(&sum)
    }

    /// Adds `Psi f` to the surface displacements (3s).
    pub fn add_forces(&self, forces: &[(TouchNode, DVec3)], out: &mut [f64]) {
        for &(TouchNode(rank), force) in forces {
            for axis in 0..3 {
                let column = 3 * rank as usize + axis;
                if !self.row_is_fixed[self.row_of_column(column)] && force[axis] != 0.0 {
                    self.add_column(column, force[axis], out);
                }
            }
        }
        for (u, &fixed) in out.iter_mut().zip(&self.row_is_fixed) {
            if fixed {
                *u = 0.0;
            }
        }
    }
}
