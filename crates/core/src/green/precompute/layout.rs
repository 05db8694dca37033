//! Rows and columns of `Psi`, and the order in which they are solved.
//!
//! A row has a rank: those with columns come first, moved supports before the others, which are by elimination; then
//! those without. The columns are solved stage by stage, in a stage by rank: what is solved `k`-th has the place `k`. A
//! panel holds the rows of its own columns and then all that are solved later or never, by rank: its rows are the same
//! however the columns after it are put into stages.

use std::ops::Range;

use super::problem::Problem;
use super::sweep::Source;
use super::tree::{NONE, PositionRequest, Tree};
use crate::fem::{Supports, SymmetricCsc};
use crate::solver::Symbolic;

/// The rows and columns of the operator, and the order in which they are solved.
#[derive(Clone)]
pub struct Layout {
    /// Dof of each row.
    pub row_dofs: Vec<u32>,
    /// Row of each rank.
    pub row_of_rank: Vec<u32>,
    /// How many rows have columns.
    pub columns: usize,
    /// How many of the columns are moved supports: those of the first ranks.
    pub supported: usize,
    /// Rank of each place.
    ranks: Vec<u32>,
    /// Place of each rank with a column.
    places: Vec<u32>,
    /// The columns by stages, in their order.
    pub stages: Vec<Stage>,
    /// For each dof its rank, or [`NONE`].
    rank_of_dof: Vec<u32>,
    /// Permuted position of each free dof.
    positions: Vec<u32>,
    /// Request of each position.
    pub requests: Vec<PositionRequest>,
}

/// Columns that are solved before all later ones, by their places.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stage {
    /// Moved supports.
    pub supports: Range<usize>,
    /// The others, directly after them.
    pub forces: Range<usize>,
}

/// A block of columns that are solved together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// First column, in the order of elimination.
    pub first: usize,
    /// Number of columns.
    pub width: usize,
    /// Rows of its panel.
    pub rows: usize,
}

impl Block {
    /// Numbers in its panel.
    pub fn len(&self) -> usize {
        self.rows * self.width
    }
}

impl Layout {
    /// Rows and columns of a problem whose free dofs are ordered by `symbolic`, in one stage.
    pub fn new(problem: &Problem, stiffness: &SymmetricCsc, symbolic: &Symbolic) -> Self {
        let supports = &problem.supports;
        let row_dofs = problem.row_dofs();
        let positions = symbolic.positions();
        let at = |dof: u32| positions.get(supports.free_rank[dof as usize] as usize).copied();
        let mut has_column = vec![false; row_dofs.len()];
        for row in problem.touch.iter().flat_map(|&t| [3 * t, 3 * t + 1, 3 * t + 2]) {
            has_column[row as usize] = true;
        }
        let mut row_of_rank: Vec<u32> = (0..row_dofs.len() as u32).collect();
        row_of_rank.sort_by_cached_key(|&row| {
            let dof = row_dofs[row as usize];
            // Neighbouring supports together: their loads act on the same few supernodes.
            let neighbours = || stiffness.column(dof as usize).filter_map(|(other, _)| at(other)).min();
            (!has_column[row as usize], at(dof).is_some(), at(dof).or_else(neighbours), row)
        });
        let columns = row_of_rank.partition_point(|&row| has_column[row as usize]);
        let supported = row_of_rank[..columns].partition_point(|&row| at(row_dofs[row as usize]).is_none());
        let mut rank_of_dof = vec![NONE; stiffness.dimension];
        for (rank, &row) in row_of_rank.iter().enumerate() {
            rank_of_dof[row_dofs[row as usize] as usize] = rank as u32;
        }
        let (ranks, places) = ((0..columns as u32).collect(), (0..columns as u32).collect());
        let stages = vec![Stage { supports: 0..supported, forces: supported..columns }];
        let requests = Vec::new();
        let mut layout =
            Self { row_dofs, row_of_rank, columns, supported, ranks, places, stages, rank_of_dof, positions, requests };
        layout.find_requests(stiffness, supports);
        layout
    }

    /// Keeps the first `kept` places, which end where a block does, and solves the other columns by stages of nodes (ranks
    /// among the surface nodes), each of which stands in one of them.
    pub fn arrange(&mut self, prefix: usize, nodes: &[Vec<u32>], stiffness: &SymmetricCsc, supports: &Supports) {
        let until = |part: &Range<usize>| part.start.min(prefix)..part.end.min(prefix);
        for stage in &mut self.stages {
            *stage = Stage { supports: until(&stage.supports), forces: until(&stage.forces) };
        }
        let mut stage_of_row = vec![NONE; self.row_dofs.len()];
        // The remaining columns of partly solved nodes come first.
        let cut: Vec<u32> = (0..prefix).map(|place| self.row(place) as u32 / 3).collect();
        let first = std::iter::once((0, &cut));
        for (stage, nodes) in nodes.iter().enumerate().chain(first) {
            for row in nodes.iter().flat_map(|&node| [3 * node, 3 * node + 1, 3 * node + 2]) {
                stage_of_row[row as usize] = stage as u32;
            }
        }
        let stage_of_rank = |rank: u32| stage_of_row[self.row_of_rank[rank as usize] as usize];
        self.ranks[prefix..].sort_unstable_by_key(|&rank| (stage_of_rank(rank), rank));
        let mut first = prefix;
        while first < self.columns {
            let stage = stage_of_rank(self.ranks[first]);
            let behind = &self.ranks[first..];
            let end = first + behind.partition_point(|&rank| stage_of_rank(rank) == stage);
            let cut = first + behind[..end - first].partition_point(|&rank| (rank as usize) < self.supported);
            self.stages.push(Stage { supports: first..cut, forces: cut..end });
            first = end;
        }
        self.stages.retain(|stage| stage.supports.start < stage.forces.end);
        self.find_places(stiffness, supports);
    }

    /// Takes over the beginning of another order: the rows of blocks, each of which is a stage of its own.
    pub fn put_blocks_first(&mut self, blocks: &[Vec<u32>], stiffness: &SymmetricCsc, supports: &Supports) {
        let mut ranks = Vec::with_capacity(self.columns);
        self.stages.clear();
        for rows in blocks {
            let first = ranks.len();
            ranks.extend(rows.iter().map(|&row| self.rank_of_dof[self.row_dofs[row as usize] as usize]));
            let cut = if (ranks[first] as usize) < self.supported { ranks.len() } else { first };
            self.stages.push(Stage { supports: first..cut, forces: cut..ranks.len() });
        }
        let mut taken = vec![false; self.columns];
        ranks.iter().for_each(|&rank| taken[rank as usize] = true);
        ranks.extend((0..self.columns as u32).filter(|&rank| !taken[rank as usize]));
        self.ranks = ranks;
        self.find_places(stiffness, supports);
    }

    /// Whether the columns of the first places are all the columns of some nodes.
    pub fn covers_whole_nodes(&self, columns: usize) -> bool {
        let mut count = vec![0u8; self.row_dofs.len() / 3 + 1];
        (0..columns).for_each(|place| count[self.row(place) / 3] += 1);
        count.iter().all(|&count| count % 3 == 0)
    }

    /// Nodes some of whose columns are not among the first places, ascending ranks among the surface nodes.
    pub fn waiting_nodes(&self, columns: usize) -> Vec<u32> {
        let mut nodes: Vec<u32> = (columns..self.columns).map(|place| self.row(place) as u32 / 3).collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    fn find_places(&mut self, stiffness: &SymmetricCsc, supports: &Supports) {
        for (place, &rank) in self.ranks.iter().enumerate() {
            self.places[rank as usize] = place as u32;
        }
        self.find_requests(stiffness, supports);
    }

    /// Sets the readers of each position: a row with a column is read by its own stage and those before it.
    fn find_requests(&mut self, stiffness: &SymmetricCsc, supports: &Supports) {
        let mut requests = vec![PositionRequest::NOTHING; self.positions.len()];
        let stage_of = |rank: usize| self.places.get(rank).map_or(NONE, |&place| self.stage_of(place as usize) as u32);
        for (rank, &row) in self.row_of_rank.iter().enumerate() {
            let (dof, stage) = (self.row_dofs[row as usize], stage_of(rank));
            if let Some(position) = self.position(supports, dof) {
                requests[position].stage = stage;
                requests[position].before = requests[position].before.max(stage);
                continue;
            }
            // Positions that enter reactions: every column before their own reads them.
            for position in stiffness.column(dof as usize).filter_map(|(other, _)| self.position(supports, other)) {
                requests[position].supports = true;
                requests[position].before = requests[position].before.max(stage);
            }
        }
        self.requests = requests;
    }

    /// Data that determine the order in which rows and columns are solved.
    pub fn order(&self) -> [&[u32]; 3] {
        [&self.row_dofs, &self.row_of_rank, &self.ranks]
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.row_of_rank.len()
    }

    /// Stage of a place.
    pub fn stage_of(&self, place: usize) -> usize {
        self.stages.partition_point(|stage| stage.forces.end <= place)
    }

    /// Blocks of at most `width` columns, none of them in two stages, or with both moved supports and forces.
    pub fn blocks(&self, width: usize) -> Vec<Block> {
        let cut = |part: &Range<usize>| {
            let end = part.end;
            let block = move |first| Block { first, width: width.min(end - first), rows: self.rows() - first };
            part.clone().step_by(width).map(block)
        };
        self.stages.iter().flat_map(|stage| cut(&stage.supports).chain(cut(&stage.forces))).collect()
    }

    /// Whether a place is a moved support.
    pub fn is_support(&self, place: usize) -> bool {
        self.rank(place) < self.supported
    }

    /// Whether the columns of a block are moved supports.
    pub fn moves_supports(&self, block: &Block) -> bool {
        self.is_support(block.first)
    }

    /// Rank of a place.
    pub fn rank(&self, place: usize) -> usize {
        self.ranks[place] as usize
    }

    /// Ranks of the columns of a block, ascending.
    pub fn ranks(&self, block: &Block) -> &[u32] {
        &self.ranks[block.first..block.first + block.width]
    }

    /// Ranks of the rows of a block's panel: those of its columns, then all that are solved later or never.
    pub fn panel_rows(&self, block: &Block) -> Vec<Range<usize>> {
        let end = block.first + block.width;
        let later = |rank: &u32| self.places.get(*rank as usize).is_none_or(|&place| place as usize >= end);
        let others = (0..self.rows() as u32).filter(later);
        runs(self.ranks(block).iter().copied().chain(others))
    }

    /// Place of a rank that has a column.
    pub fn place_of_rank(&self, rank: usize) -> Option<usize> {
        self.places.get(rank).map(|&place| place as usize)
    }

    /// Row of a place.
    pub fn row(&self, place: usize) -> usize {
        self.row_of_rank[self.rank(place)] as usize
    }

    /// Dof of a place.
    pub fn dof(&self, place: usize) -> u32 {
        self.row_dofs[self.row(place)]
    }

    /// Place of a dof that has a column.
    pub fn place_of_dof(&self, dof: u32) -> Option<usize> {
        self.place_of_rank(self.rank_of_dof[dof as usize] as usize)
    }

    /// Kept row of a dof, if it is free.
    pub fn tree_row(&self, tree: &Tree, supports: &Supports, dof: u32) -> Option<u32> {
        self.position(supports, dof).map(|position| tree.row_of_position[position])
    }

    /// Permuted position of a dof, if it is free.
    fn position(&self, supports: &Supports, dof: u32) -> Option<usize> {
        self.positions.get(supports.free_rank[dof as usize] as usize).map(|&position| position as usize)
    }

    /// Loads of the places of a block: a unit force on a free dof, `-K_Nj` for a unit displacement of support `j`.
    pub fn loads(&self, stiffness: &SymmetricCsc, supports: &Supports, tree: &Tree, block: &Block) -> Vec<Source> {
        let mut sources = Vec::new();
        for k in 0..block.width {
            let (dof, column) = (self.dof(block.first + k), k as u32);
            if let Some(row) = self.tree_row(tree, supports, dof) {
                sources.push(Source { row, column, value: 1.0 });
                continue;
            }
            for (other, value) in stiffness.column(dof as usize) {
                if let Some(row) = self.tree_row(tree, supports, other) {
                    sources.push(Source { row, column, value: -value });
                }
            }
        }
        sources
    }
}

/// Joins numbers that follow each other.
pub fn runs(numbers: impl Iterator<Item = u32>) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for number in numbers {
        let number = number as usize;
        match runs.last_mut() {
            Some(run) if run.end == number => run.end += 1,
            _ => runs.push(number..number + 1),
        }
    }
    runs
}

#[cfg(test)]
impl Layout {
    /// Rows that all have columns, solved in this order.
    pub fn of_rows(rows: &[u32]) -> Self {
        let count = rows.len() as u32;
        let mut places = vec![0; rows.len()];
        rows.iter().zip(0..).for_each(|(&row, place)| places[row as usize] = place);
        Self {
            row_dofs: (0..count).collect(),
            row_of_rank: (0..count).collect(),
            columns: rows.len(),
            supported: 0,
            ranks: rows.to_vec(),
            places,
            stages: vec![Stage { supports: 0..0, forces: 0..rows.len() }],
            rank_of_dof: (0..count).collect(),
            positions: Vec::new(),
            requests: Vec::new(),
        }
    }
}
