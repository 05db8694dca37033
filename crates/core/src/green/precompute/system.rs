//! Solution of one block of columns, from its loads to its panel.

use super::layout::{Block, Layout};
use super::number::Number;
use super::sweep::{Scratch, Sweep, loaded};
use super::tree::Tree;
use crate::fem::{Supports, SymmetricCsc};

/// Data that every block reads.
pub struct System<'a> {
    /// Stiffness of all dofs.
    pub stiffness: &'a SymmetricCsc,
    /// The supports.
    pub supports: &'a Supports,
    /// Rows and columns.
    pub layout: &'a Layout,
}

impl System<'_> {
    /// Solves a block into its panel: displacements of free rows, and on supported rows the reactions `K_DN u_N`, with
    /// `K_Dj` for moved supports. The panel's numbers, as bytes.
    pub fn solve<'w, C: Number, T: Number>(
        &self,
        sweep: &Sweep<C>,
        block: &Block,
        scratch: &mut Scratch<C>,
        panel: &'w mut Vec<T>,
    ) -> &'w [u8] {
        let tree = &sweep.tree;
        let sources = self.layout.loads(self.stiffness, self.supports, tree, block);
        sweep.solve(scratch, &sources, &loaded(tree, block.width, &sources), &self.readers(tree, block));
        panel.clear();
        panel.reserve_exact(block.len());
        let mut sums = vec![0.0; block.width];
        for rank in self.layout.panel_rows(block).into_iter().flatten() {
            let dof = self.layout.row_dofs[self.layout.row_of_rank[rank] as usize];
            if let Some(tree_row) = self.layout.tree_row(tree, self.supports, dof) {
                panel.extend(scratch.row(tree_row, block.width).iter().map(|value| T::from_f64(value.to_f64())));
            } else {
                self.reactions(tree, dof, block, scratch, &mut sums);
                panel.extend(sums.iter().map(|&sum| T::from_f64(sum)));
            }
        }
        bytemuck::cast_slice(panel)
    }

    /// Reaction of one supported dof in every column of a block.
    fn reactions<C: Number>(&self, tree: &Tree, dof: u32, block: &Block, scratch: &Scratch<C>, sums: &mut [f64]) {
        sums.fill(0.0);
        for (other, stiffness) in self.stiffness.column(dof as usize) {
            if let Some(tree_row) = self.layout.tree_row(tree, self.supports, other) {
                let values = scratch.row(tree_row, block.width);
                sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += stiffness * value.to_f64());
                continue;
            }
            let column = self.layout.place_of_dof(other).and_then(|place| place.checked_sub(block.first));
            if let Some(sum) = column.and_then(|column| sums.get_mut(column)) {
                *sum += stiffness;
            }
        }
    }

    /// How many columns of a block read something at each node. A moved support acts everywhere, and the
    /// reactions of all others read it; a force is read from its own row on.
    pub fn readers(&self, tree: &Tree, block: &Block) -> Vec<usize> {
        if self.layout.moves_supports(block) {
            return vec![block.width; tree.nodes.len()];
        }
        let dofs = (block.first..block.first + block.width).map(|place| self.layout.dof(place));
        let rows: Vec<u32> = dofs.filter_map(|dof| self.layout.tree_row(tree, self.supports, dof)).collect();
        tree.reading.readers(self.layout.stage_of(block.first), &rows)
    }
}
