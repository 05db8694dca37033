//! Blocks of `Psi` between nodes, and their weighted sums: the compliance of contact patches.
//!
//! A tick asks for these. They allocate nothing as long as the rows are resident, and a sum's order depends on nothing but
//! the patch.

use glam::{DMat3, DVec3};

use super::entries::Entries;
use super::function::GreensFunction;
use super::node_order::TouchNode;
use super::numbers::{Gather, Kernel, Stored, WeightedRow, column_sums};

/// Nodes whose weighted rows are prepared at a time, on the stack.
const TILE: usize = 64;

impl GreensFunction {
    /// `W^T Psi W` of one patch, m/N: mean displacement per unit force, both weighted. `nodes[i]` and `columns[i]` are the
    /// same node. Each pair of nodes is read once; supported dofs contribute nothing; the result is symmetric to the bit.
    /// Never allocates.
    pub fn symmetric_block(&self, nodes: &[u32], columns: &[TouchNode], weights: &[f64]) -> DMat3 {
        debug_assert!(nodes.iter().zip(columns).all(|(&n, &c)| self.touchable(n as usize) == Some(c)));
        let entries = &self.entries;
        let half = entries.numbers.run(entries.arch, SymmetricHalf { entries, columns, weights });
        half + half.transpose()
    }

    /// `W_a^T Psi W_b`, m/N: mean displacement of the nodes `a` (any of the surface) per unit force spread over the columns
    /// `b`, axis of the force by column. Supported dofs contribute nothing. Never allocates while the nodes are resident.
    pub fn weighted_block(
        &self,
        nodes: &[u32],
        node_weights: &[f64],
        columns: &[TouchNode],
        column_weights: &[f64],
    ) -> DMat3 {
        let entries = &self.entries;
        let block = Weighted { entries, nodes, node_weights, columns, column_weights };
        let mut sum = entries.numbers.run(entries.arch, block);
        if entries.resident < 3 * entries.free.len() {
            sum += self.weighted_from_file(nodes, node_weights, columns, column_weights);
        }
        sum
    }

    /// The part of [`Self::weighted_block`] whose rows are not in memory.
    fn weighted_from_file(
        &self,
        nodes: &[u32],
        node_weights: &[f64],
        columns: &[TouchNode],
        column_weights: &[f64],
    ) -> DMat3 {
        let (entries, mut sum) = (&self.entries, DMat3::ZERO);
        for (&node, &weight) in nodes.iter().zip(node_weights).filter(|(node, _)| !self.is_resident(**node as usize)) {
            let place = entries.node_order.place(node as usize);
            let [x, y, z, _] = entries.free[place];
            for (column, &other) in columns.iter().zip(column_weights) {
                let factors = entries.free[column.place()];
                for axis in 0..3 {
                    let numbers = DVec3::from(entries.read_from_file::<3>(3 * place, 3 * column.place() + axis));
                    *sum.col_mut(axis) += factors[axis] * weight * other * (DVec3::new(x, y, z) * numbers);
                }
            }
        }
        sum
    }

    /// Copies the entries of row nodes and column nodes to `out`: columns contiguous, `3 rows` by `3 columns`, three a
    /// node. Supported dofs stand there with their own entries.
    pub fn block(&self, rows: &[u32], columns: &[TouchNode], out: &mut [f64]) {
        let entries = &self.entries;
        let places: Vec<usize> = rows.iter().map(|&node| 3 * entries.node_order.place(node as usize)).collect();
        let columns: Vec<usize> = columns.iter().flat_map(|c| (0..3).map(|axis| 3 * c.place() + axis)).collect();
        let starts: Vec<usize> = columns.iter().map(|column| column * entries.resident).collect();
        // Rows that are not in memory: first the column's head, which is, in their place.
        let at: Vec<usize> = places.iter().map(|&row| if row < entries.resident { row } else { 0 }).collect();
        entries.numbers.run(entries.arch, Gather { rows: &at, starts: &starts, out });
        if entries.scale.is_empty() && entries.file.is_none() {
            return;
        }
        for (out, &column) in out.chunks_exact_mut(3 * places.len()).zip(&columns) {
            for (out, &row) in out.chunks_exact_mut(3).zip(&places) {
                if row >= entries.resident {
                    out.copy_from_slice(&entries.read_from_file::<3>(row, column));
                }
                for (k, value) in out.iter_mut().enumerate() {
                    *value *= entries.scale_of(row + k) * entries.scale_of(column);
                }
            }
        }
    }
}

impl Entries {
    fn starts(&self, column: TouchNode) -> [usize; 3] {
        [0, 1, 2].map(|axis| (3 * column.place() + axis) * self.resident)
    }

    fn weighted_row(&self, place: usize, weight: f64) -> WeightedRow {
        WeightedRow { at: 3 * place, weights: self.free[place].map(|free| weight * free) }
    }
}

/// `S` with `W^T Psi W = S + S^T`: of the square's entries those above the diagonal, and half of those on it.
struct SymmetricHalf<'a> {
    entries: &'a Entries,
    columns: &'a [TouchNode],
    weights: &'a [f64],
}

impl SymmetricHalf<'_> {
    /// The weighted rows of a tile of the patch.
    #[inline(always)]
    fn tile(&self, tile: usize, rows: &mut [WeightedRow; TILE]) -> usize {
        let from = tile * TILE;
        let nodes = self.columns[from..].iter().zip(&self.weights[from..]).take(TILE);
        let count = nodes.len();
        for (row, (column, &weight)) in rows.iter_mut().zip(nodes) {
            *row = self.entries.weighted_row(column.place(), weight);
        }
        count
    }
}

impl Kernel for SymmetricHalf<'_> {
    type Output = DMat3;
    #[inline(always)]
    fn run<T: Stored>(self, numbers: &[T]) -> DMat3 {
        let mut half = [[0.0; 4]; 3];
        let (mut above, mut own) = ([WeightedRow::default(); TILE], [WeightedRow::default(); TILE]);
        for (tile, columns) in self.columns.chunks(TILE).enumerate() {
            let count = self.tile(tile, &mut own);
            for earlier in 0..tile {
                self.tile(earlier, &mut above);
                for (&column, row) in columns.iter().zip(&own) {
                    add_weighted(&mut half, row, column_sums(numbers, self.entries.starts(column), &above));
                }
            }
            for (k, &column) in columns.iter().enumerate().take(count) {
                let row = own[k];
                // Half of the diagonal block, as the last row of its column.
                own[k].weights = row.weights.map(|weight| 0.5 * weight);
                add_weighted(&mut half, &row, column_sums(numbers, self.entries.starts(column), &own[..=k]));
                own[k] = row;
            }
        }
        matrix(half)
    }
}

/// Rows that are in memory, times columns.
struct Weighted<'a> {
    entries: &'a Entries,
    nodes: &'a [u32],
    node_weights: &'a [f64],
    columns: &'a [TouchNode],
    column_weights: &'a [f64],
}

impl Kernel for Weighted<'_> {
    type Output = DMat3;
    #[inline(always)]
    fn run<T: Stored>(self, numbers: &[T]) -> DMat3 {
        let mut sum = [[0.0; 4]; 3];
        let mut rows = [WeightedRow::default(); TILE];
        for (nodes, weights) in self.nodes.chunks(TILE).zip(self.node_weights.chunks(TILE)) {
            let mut count = 0;
            for (&node, &weight) in nodes.iter().zip(weights) {
                let place = self.entries.node_order.place(node as usize);
                if 3 * place < self.entries.resident {
                    rows[count] = self.entries.weighted_row(place, weight);
                    count += 1;
                }
            }
            for (&column, &weight) in self.columns.iter().zip(self.column_weights) {
                let own = self.entries.weighted_row(column.place(), weight);
                let sums = column_sums(numbers, self.entries.starts(column), &rows[..count]);
                add_weighted(&mut sum, &own, sums);
            }
        }
        matrix(sum)
    }
}

/// `sum += column weights * sums`, one column an axis of the force.
#[inline(always)]
fn add_weighted(sum: &mut [[f64; 4]; 3], column: &WeightedRow, sums: [[f64; 4]; 3]) {
    for axis in 0..3 {
        for k in 0..4 {
            sum[axis][k] += column.weights[axis] * sums[axis][k];
        }
    }
}

fn matrix(columns: [[f64; 4]; 3]) -> DMat3 {
    DMat3::from_cols_array_2d(&columns.map(|[x, y, z, _]| [x, y, z]))
}
