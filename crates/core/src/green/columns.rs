//! Columns of `Psi`: which there are, in which order and blocks they are solved, and the solution of a block.

use super::factor::Symbolic;
use super::key::content_key;
use super::number::Number;
use super::operator::Precision;
use super::panels::Block;
use super::sweep::{Reach, Scratch, Source, Sweep, reaches};
use super::tree::{NONE, Tree, Wanted};
use crate::fem::{Isotropic, Supports, SymmetricCsc};
use crate::mesh::{Surface, TetMesh};
use crate::{Error, Result};

/// The reference problem (paper 3.1): a supported body without loads.
pub struct Problem {
    /// The body.
    pub mesh: TetMesh,
    /// One material an element.
    pub materials: Vec<Isotropic>,
    /// Its supports.
    pub supports: Supports,
    /// Mesh indices of the surface nodes, ascending.
    pub surface_nodes: Vec<u32>,
    /// Outward surface triangles, mesh indices.
    pub surface_triangles: Vec<[u32; 3]>,
    /// Touchable surface nodes as ascending ranks in `surface_nodes`.
    pub touch: Vec<u32>,
}

impl Problem {
    /// Content key of the Green's function with this precision.
    pub fn key(&self, precision: Precision) -> String {
        content_key(self, precision)
    }

    pub(super) fn surface(&self) -> Result<Surface> {
        let local = |n: u32| self.surface_nodes.binary_search(&n).map(|i| i as u32);
        let mut triangles = Vec::with_capacity(self.surface_triangles.len());
        for t in &self.surface_triangles {
            match (local(t[0]), local(t[1]), local(t[2])) {
                (Ok(a), Ok(b), Ok(c)) => triangles.push([a, b, c]),
                _ => {
                    return Err(Error::Invalid(format!(
                        "surface triangle {t:?} names a node that is not on the surface"
                    )));
                }
            }
        }
        Surface::new(self.surface_nodes.iter().map(|&n| self.mesh.nodes[n as usize]).collect(), triangles)
    }

    /// Dof of every row: the surface's, then the supported ones inside.
    pub(super) fn row_dofs(&self) -> Vec<u32> {
        let mut dofs: Vec<u32> = self.surface_nodes.iter().flat_map(|&n| [3 * n, 3 * n + 1, 3 * n + 2]).collect();
        let inside = |d: &u32| self.surface_nodes.binary_search(&(d / 3)).is_err();
        dofs.extend(self.supports.fixed.iter().copied().filter(inside));
        dofs
    }

    pub(super) fn common_youngs_modulus(&self) -> Option<f64> {
        let first = self.materials.first()?.youngs_modulus;
        self.materials.iter().all(|m| m.youngs_modulus == first).then_some(first)
    }
}

/// The rows and columns of the operator, and the order in which they are solved.
pub struct Layout {
    /// Dof of each row.
    pub row_dofs: Vec<u32>,
    /// Rows of the columns in the order in which they are solved: moved supports first, then by elimination.
    pub order: Vec<u32>,
    /// How many of them are moved supports.
    pub supported: usize,
    /// Rows that have no column.
    pub extra: Vec<u32>,
    /// For each row its place in a line: a place in `order`, then the extra rows.
    pub place_of_row: Vec<u32>,
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
        let mut order: Vec<u32> = problem.touch.iter().flat_map(|&t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        // Neighbouring supports together: their forces act on the same few supernodes.
        order.sort_by_cached_key(|&row| {
            let dof = row_dofs[row as usize];
            let neighbours = || stiffness.column(dof as usize).filter_map(|(other, _)| at(other)).min();
            at(dof).map_or_else(|| (0, neighbours(), row), |position| (1, Some(position), row))
        });
        let is_fixed = |row: u32| supports.is_fixed(row_dofs[row as usize]);
        let supported = order.partition_point(|&row| is_fixed(row));
        let mut place_of_row = vec![NONE; row_dofs.len()];
        for (place, &row) in order.iter().enumerate() {
            place_of_row[row as usize] = place as u32;
        }
        let extra: Vec<u32> = (0..row_dofs.len() as u32).filter(|&row| place_of_row[row as usize] == NONE).collect();
        for (k, &row) in extra.iter().enumerate() {
            place_of_row[row as usize] = (order.len() + k) as u32;
        }
        let mut wanted = vec![Wanted::default(); positions.len()];
        for &row in &order[supported..] {
            if let Some(position) = at(row_dofs[row as usize]) {
                wanted[position as usize].column = true;
            }
        }
        // Extra rows are read by every column, and so is what their reactions and those of moved supports are made of.
        for &row in extra.iter().chain(&order[..supported]) {
            let dof = row_dofs[row as usize];
            match at(dof) {
                Some(position) => wanted[position as usize].always = true,
                None => {
                    for position in stiffness.column(dof as usize).filter_map(|(other, _)| at(other)) {
                        wanted[position as usize].always |= place_of_row[row as usize] as usize >= order.len();
                        wanted[position as usize].supports = true;
                    }
                }
            }
        }
        Self { row_dofs, order, supported, extra, place_of_row, positions, wanted }
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.order.len()
    }

    /// Numbers in a line: a column with its rows in solving order.
    pub fn line(&self) -> usize {
        self.row_dofs.len()
    }

    /// Blocks of at most `width` columns, none of them with both moved supports and forces.
    pub fn blocks(&self, width: usize) -> Vec<Block> {
        let cut = |from: usize, to: usize| {
            (from..to).step_by(width).map(move |first| Block {
                first,
                width: width.min(to - first),
                rows: self.columns() - first + self.extra.len(),
            })
        };
        cut(0, self.supported).chain(cut(self.supported, self.columns())).collect()
    }

    /// Dof of the column at a place in the order.
    pub fn dof(&self, place: usize) -> u32 {
        self.row_dofs[self.order[place] as usize]
    }

    /// Kept row of a dof, if it is free.
    fn kept(&self, tree: &Tree, supports: &Supports, dof: u32) -> Option<u32> {
        match supports.free_rank[dof as usize] {
            NONE => None,
            rank => Some(tree.row_of_position[self.positions[rank as usize] as usize]),
        }
    }

    /// Right-hand sides of a block, and the columns that concern each node. A column is a unit force on a free dof, or
    /// `-K_Nj` for a unit displacement of support `j`.
    pub fn right_hand_sides(
        &self,
        stiffness: &SymmetricCsc,
        supports: &Supports,
        tree: &Tree,
        block: &Block,
    ) -> (Vec<Source>, Vec<Reach>) {
        let mut sources = Vec::new();
        let mut rows = Vec::new();
        for k in 0..block.width {
            let (dof, column) = (self.dof(block.first + k), k as u32);
            if let Some(row) = self.kept(tree, supports, dof) {
                rows.push(row);
                sources.push(Source { row, column, value: 1.0 });
                continue;
            }
            for (other, value) in stiffness.column(dof as usize) {
                if let Some(row) = self.kept(tree, supports, other) {
                    sources.push(Source { row, column, value: -value });
                }
            }
        }
        // A moved support is felt everywhere, and read by the reactions of all others.
        let read_from = (block.first >= self.supported).then_some(rows.as_slice());
        let reached = reaches(tree, block.width, &sources, read_from);
        (sources, reached)
    }
}

/// Everything a block of columns is solved with.
pub struct Columns<'a, C> {
    /// Stiffness of all dofs.
    pub stiffness: &'a SymmetricCsc,
    /// The supports.
    pub supports: &'a Supports,
    /// Rows and columns.
    pub layout: &'a Layout,
    /// The tree.
    pub sweep: Sweep<C>,
}

impl<C: Number> Columns<'_, C> {
    /// Solves a block into its panel: displacements of free rows, and on supported rows the reactions `K_DN u_N`, with
    /// `K_Dj` for moved supports.
    pub fn solve<T: Number>(&self, block: &Block, scratch: &mut Scratch<C>, panel: &mut Vec<T>) {
        let tree = &self.sweep.tree;
        let (sources, reached) = self.layout.right_hand_sides(self.stiffness, self.supports, tree, block);
        self.sweep.solve(scratch, &sources, &reached);
        panel.clear();
        let rows = self.layout.order[block.first..].iter().chain(&self.layout.extra);
        let mut sums = Vec::new();
        for &row in rows {
            let dof = self.layout.row_dofs[row as usize];
            if let Some(kept) = self.layout.kept(tree, self.supports, dof) {
                let values = &scratch.x[kept as usize * scratch.stride..][..block.width];
                panel.extend(values.iter().map(|value| T::from_f64(value.to_f64())));
            } else {
                self.reactions(dof, block, scratch, &mut sums);
                panel.extend(sums.iter().map(|&sum| T::from_f64(sum)));
            }
        }
    }

    fn reactions(&self, dof: u32, block: &Block, scratch: &Scratch<C>, sums: &mut Vec<f64>) {
        sums.clear();
        sums.resize(block.width, 0.0);
        for (other, stiffness) in self.stiffness.column(dof as usize) {
            if let Some(kept) = self.layout.kept(&self.sweep.tree, self.supports, other) {
                let values = &scratch.x[kept as usize * scratch.stride..][..block.width];
                sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += stiffness * value.to_f64());
            } else if let Some(k) = (0..block.width).find(|&k| self.layout.dof(block.first + k) == other) {
                sums[k] += stiffness;
            }
        }
    }
}
