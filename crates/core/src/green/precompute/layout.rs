//! The rows and columns of `Psi`: which there are, in which order they are solved, and where they are stored.

use crate::solver::Symbolic;
use glam::DVec3;

use super::block::Block;
use super::problem::Problem;
use super::spatial_order::spatial_order;
use super::sweep::Source;
use super::tree::{NONE, Tree, Wanted};
use crate::fem::{Supports, SymmetricCsc};
use crate::green::places::Places;

/// The rows and columns of the operator, and the order in which they are solved.
pub struct Layout {
    /// Dof of each row.
    pub row_dofs: Vec<u32>,
    /// All rows in solving order: those with columns (moved supports first, then by elimination), then those without.
    pub order: Vec<u32>,
    /// How many rows have columns.
    pub columns: usize,
    /// How many of the columns are moved supports.
    pub supported: usize,
    /// Where the store keeps the surface nodes.
    pub places: Places,
    /// For each row of the store its place in `order`.
    pub place_of_stored: Vec<u32>,
    /// For each dof its place in `order`, or [`NONE`].
    pub place_of_dof: Vec<u32>,
    /// Permuted position of each free dof.
    positions: Vec<u32>,
    /// What is wanted of each position.
    pub wanted: Vec<Wanted>,
}

impl Layout {
    /// Rows and columns of a problem whose free dofs are ordered by `symbolic`.
    pub fn new(problem: &Problem, stiffness: &SymmetricCsc, symbolic: &Symbolic) -> Self {
        let supports = &problem.supports;
        let row_dofs = problem.row_dofs();
        let positions = symbolic.positions();
        let at = |dof: u32| match supports.free_rank[dof as usize] {
            NONE => None,
            rank => Some(positions[rank as usize]),
        };
        let mut has_column = vec![false; row_dofs.len()];
        for row in problem.touch.iter().flat_map(|&t| [3 * t, 3 * t + 1, 3 * t + 2]) {
            has_column[row as usize] = true;
        }
        let mut order: Vec<u32> = (0..row_dofs.len() as u32).collect();
        order.sort_by_cached_key(|&row| {
            let dof = row_dofs[row as usize];
            // Neighbouring supports together: their loads act on the same few supernodes.
            let neighbours = || stiffness.column(dof as usize).filter_map(|(other, _)| at(other)).min();
            (!has_column[row as usize], at(dof).is_some(), at(dof).or_else(neighbours), row)
        });
        let columns = order.partition_point(|&row| has_column[row as usize]);
        let supported = order[..columns].partition_point(|&row| at(row_dofs[row as usize]).is_none());
        let positions_of_surface: Vec<DVec3> =
            problem.surface_nodes.iter().map(|&n| problem.mesh.nodes[n as usize]).collect();
        let places = Places::new(spatial_order(&positions_of_surface, &problem.touch), problem.touch.len());
        let mut place_of_stored = vec![NONE; row_dofs.len()];
        let mut place_of_dof = vec![NONE; stiffness.dimension];
        for (place, &row) in order.iter().enumerate() {
            place_of_stored[places.stored_row(row as usize)] = place as u32;
            place_of_dof[row_dofs[row as usize] as usize] = place as u32;
        }
        let mut wanted = vec![Wanted::default(); positions.len()];
        for (place, &row) in order.iter().enumerate() {
            let dof = row_dofs[row as usize];
            let has_column = place < columns;
            if let Some(position) = at(dof) {
                wanted[position as usize].column |= has_column;
                wanted[position as usize].always |= !has_column;
                continue;
            }
            // What reactions are made of: those without a column are asked of every column.
            for position in stiffness.column(dof as usize).filter_map(|(other, _)| at(other)) {
                wanted[position as usize].supports = true;
                wanted[position as usize].always |= !has_column;
            }
        }
        Self { row_dofs, order, columns, supported, places, place_of_stored, place_of_dof, positions, wanted }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.order.len()
    }

    /// Blocks of at most `width` columns, none of them with both moved supports and forces.
    pub fn blocks(&self, width: usize) -> Vec<Block> {
        let cut = |from: usize, to: usize| {
            let block = move |first| Block { first, width: width.min(to - first), rows: self.rows() - first };
            (from..to).step_by(width).map(block)
        };
        cut(0, self.supported).chain(cut(self.supported, self.columns)).collect()
    }

    /// Row of the store, and column where it has one, of a place in the order.
    pub fn stored(&self, place: usize) -> usize {
        self.places.stored_row(self.order[place] as usize)
    }

    /// Dof of a place in the order.
    pub fn dof(&self, place: usize) -> u32 {
        self.row_dofs[self.order[place] as usize]
    }

    /// Kept row of a dof, if it is free.
    pub fn kept(&self, tree: &Tree, supports: &Supports, dof: u32) -> Option<u32> {
        match supports.free_rank[dof as usize] {
            NONE => None,
            rank => Some(tree.row_of_position[self.positions[rank as usize] as usize]),
        }
    }

    /// Loads of the places of a block: a unit force on a free dof, `-K_Nj` for a unit displacement of support `j`.
    pub fn loads(&self, stiffness: &SymmetricCsc, supports: &Supports, tree: &Tree, block: &Block) -> Vec<Source> {
        let mut sources = Vec::new();
        for k in 0..block.width {
            let (dof, column) = (self.dof(block.first + k), k as u32);
            if let Some(row) = self.kept(tree, supports, dof) {
                sources.push(Source { row, column, value: 1.0 });
                continue;
            }
            for (other, value) in stiffness.column(dof as usize) {
                if let Some(row) = self.kept(tree, supports, other) {
                    sources.push(Source { row, column, value: -value });
                }
            }
        }
        sources
    }
}
