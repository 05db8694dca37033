//! A touchable patch: all of its nodes have columns of `Psi`. A node without one is a [`Refusal`], not a zero.

use glam::{DMat3, DVec3};

use super::patch::{MAX_PATCH_NODES, Patch, Refusal};
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
    /// Sets the patch; after an error it is empty.
    ///
    /// # Errors
    /// The first node that is not touchable.
    pub fn set_patch(&mut self, green: &GreensFunction, patch: &Patch) -> Result<(), Refusal> {
        self.patch.count = 0;
        for (column, (node, _)) in self.columns.iter_mut().zip(patch.iter()) {
            *column = green.touchable(node).ok_or(Refusal::NotTouchable(node as u32))?;
        }
        self.patch.copy_from(patch);
        Ok(())
    }

    /// Sets the touchable part of `patch`, with its weights scaled to the sum of those of the whole.
    pub fn set_touchable_part(&mut self, green: &GreensFunction, patch: &Patch) {
        let (mut touchable, mut all) = (0.0, 0.0);
        self.patch.count = 0;
        for (node, weight) in patch.iter() {
            all += weight;
            if let Some(column) = green.touchable(node) {
                self.columns[self.patch.count] = column;
                self.patch.push(node as u32, weight);
                touchable += weight;
            }
        }
        self.patch.scale(if touchable > 0.0 { all / touchable } else { 0.0 });
    }

    /// Empties the patch. A slot is to be emptied before another contact uses it: its columns may be those of another store.
    pub fn clear(&mut self) {
        self.patch.clear();
    }

    /// Sets the touchable ones of these nodes with their weights; repeated nodes are summed. Mostly they are the nodes that it has.
    pub fn blend(&mut self, green: &GreensFunction, nodes: impl Iterator<Item = (u32, f64)> + Clone) {
        if self.patch.replace_weights(nodes.clone()) {
            return;
        }
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

    /// Finds the columns of the same nodes in another store of the same surface; returns whether all have columns.
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

    /// Copies another one; only the entries in use are copied.
    pub fn copy_from(&mut self, other: &TouchPatch) {
        self.patch.copy_from(&other.patch);
        self.columns[..other.patch.count].copy_from_slice(other.columns());
    }
}
