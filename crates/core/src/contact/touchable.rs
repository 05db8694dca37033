//! A patch that may be touched: all of its nodes have columns of `Psi`. Where one has none, that is an outcome, not a zero.

use glam::{DMat3, DVec3};

use super::patch::{MAX_PATCH_NODES, Patch};
use super::refusal::Refusal;
use crate::green::{GreensFunction, TouchNode};

/// A patch with the columns of its nodes.
#[derive(Clone, Debug)]
pub struct TouchPatch {
    patch: Patch,
    columns: [TouchNode; MAX_PATCH_NODES],
}

impl Default for TouchPatch {
    fn default() -> Self {
        Self { patch: Patch::default(), columns: [TouchNode::default(); MAX_PATCH_NODES] }
    }
}

impl TouchPatch {
    /// Becomes `patch`; on an error it is empty.
    ///
    /// # Errors
    /// The first node that may not be touched.
    pub fn admit(&mut self, green: &GreensFunction, patch: &Patch) -> Result<(), Refusal> {
        self.patch.count = 0;
        for (column, (node, _)) in self.columns.iter_mut().zip(patch.iter()) {
            *column = green.touchable(node).ok_or(Refusal::NotTouchable(node as u32))?;
        }
        self.patch.copy_from(patch);
        Ok(())
    }

    /// Becomes the part of `patch` that may be touched, its weights raised so that they sum to what those of the whole do.
    pub fn admit_touchable(&mut self, green: &GreensFunction, patch: &Patch) {
        let (mut kept, mut all) = (0.0, 0.0);
        self.patch.count = 0;
        for (node, weight) in patch.iter() {
            all += weight;
            if let Some(column) = green.touchable(node) {
                self.columns[self.patch.count] = column;
                self.patch.push(node as u32, weight);
                kept += weight;
            }
        }
        self.patch.scale(if kept > 0.0 { all / kept } else { 0.0 });
    }

    /// Becomes these touchable nodes with their weights; a node that comes twice has the sum.
    pub fn blend(&mut self, green: &GreensFunction, nodes: impl Iterator<Item = (u32, f64)>) {
        self.patch.clear();
        for (node, weight) in nodes {
            let (place, column) = (self.patch.count, green.touchable(node as usize));
            if let Some(column) = column
                && self.patch.add(node, weight)
                && self.patch.count > place
            {
                self.columns[place] = column;
            }
        }
    }

    /// Finds the columns of the same nodes in another store of the same surface: whether all of them have some.
    pub fn find_columns(&mut self, green: &GreensFunction) -> bool {
        let nodes = self.patch.nodes().iter().zip(&mut self.columns);
        nodes
            .map(|(&node, column)| green.touchable(node as usize).map(|found| *column = found))
            .all(|found| found.is_some())
    }

    /// Nodes and weights.
    pub fn patch(&self) -> &Patch {
        &self.patch
    }

    fn columns(&self) -> &[TouchNode] {
        &self.columns[..self.patch.count]
    }

    /// `W^T Psi W`: mean displacement of the patch per unit force spread over it, m/N. Supported dofs do not move.
    pub fn own_compliance(&self, green: &GreensFunction) -> DMat3 {
        green.symmetric_block(self.patch.nodes(), self.columns(), self.patch.weights())
    }

    /// `W^T Psi W_other`: mean displacement of this patch per unit force spread over the other, m/N.
    pub fn compliance_with(&self, green: &GreensFunction, other: &TouchPatch) -> DMat3 {
        let (nodes, weights) = (self.patch.nodes(), self.patch.weights());
        green.weighted_block(nodes, weights, other.columns(), other.patch.weights())
    }

    /// Displacement of any surface node per unit force spread over the patch, m/N.
    pub fn compliance_at(&self, green: &GreensFunction, node: usize) -> DMat3 {
        green.weighted_block(&[node as u32], &[1.0], self.columns(), self.patch.weights())
    }

    /// Adds `Psi W f` to the displacements of all surface dofs (3s), m.
    pub fn add_response(&self, green: &GreensFunction, force: DVec3, displacements: &mut [f64]) {
        let forces: Vec<(TouchNode, DVec3)> = self
            .columns()
            .iter()
            .zip(self.patch.weights())
            .map(|(&column, &weight)| (column, weight * force))
            .collect();
        green.add_forces(&forces, displacements);
    }

    /// Becomes a copy of another; only the entries in use are copied.
    pub fn copy_from(&mut self, other: &TouchPatch) {
        self.patch.copy_from(&other.patch);
        self.columns[..other.patch.count].copy_from_slice(other.columns());
    }
}
