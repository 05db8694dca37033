//! Entries of `Psi` in memory or in the file, and the functions that read them.
//!
//! Rows and columns lie in the order of [`NodeOrder`]; numbers are `f32`, `f64`, or 16-bit integers `q` with
//! `Psi_ij = s_i s_j q_ij` and one scale a dof. Nobody outside sees either: every question names nodes, dispatches once
//! on the format, and is answered in f64.
//!
//! A store up to a bound is in memory as a whole. Of a larger one the square of touchable rows and columns is, which is all
//! that contacts ask for; other rows are read from the file by position. Nothing is mapped, so a file that somebody cuts
//! short can kill no reader: what cannot be read any more is NaN, and [`GreensFunction::require_intact`] says beforehand why. The
//! file's length is compared there; should it shrink between that call and the reading, the answer is NaN, which the
//! checks behind every answer refuse.

use glam::DVec3;
use pulp::Arch;

use super::columns_file::ColumnsFile;
use super::function::GreensFunction;
use super::node_order::{NodeOrder, TouchNode};
use super::numbers::{AddColumns, COLUMNS_AT_ONCE, Numbers, One};
use super::precision::Precision;
use crate::Result;
use crate::memory::Ranges;

/// Largest magnitude of a stored integer.
pub const RANGE: f64 = i16::MAX as f64;

/// Scales of rows with these bounds: `s_i / sqrt(RANGE)`, so that `|q_ij| <= RANGE`; none where the format needs none.
pub fn scales(precision: Precision, magnitude: &[f64]) -> Vec<f64> {
    let of = |s: &f64| s / RANGE.sqrt();
    if precision == Precision::F16 { magnitude.iter().map(of).collect() } else { Vec::new() }
}

/// The numbers of a Green's function.
pub struct Entries {
    pub(super) arch: Arch,
    pub(super) node_order: NodeOrder,
    /// Numbers of a column.
    rows: usize,
    /// Numbers of a column that are in memory: all, or those of the touchable nodes.
    pub(super) resident: usize,
    pub(super) numbers: Numbers,
    /// Bound `s_i` of each stored row, `|Psi_ij| <= s_i s_j`; empty where nothing is computed yet.
    magnitude: Vec<f64>,
    /// Scale of each stored row, and of the column that belongs to it; empty unless the numbers are integers.
    pub(super) scale: Vec<f64>,
    /// For each place the scales of its dofs, zero on supported ones: they neither move nor are pushed.
    pub(super) free: Vec<[f64; 4]>,
    /// The whole columns, where they are not in memory.
    pub(super) file: Option<ColumnsFile>,
}

impl Entries {
    /// Adds the memory that a tick reads.
    pub(crate) fn add_memory(&self, ranges: &mut Ranges) {
        ranges.add(self.numbers.bytes());
        ranges.add(&self.magnitude);
        ranges.add(&self.scale);
        ranges.add(&self.free);
        ranges.add(self.node_order.nodes());
    }

    /// Numbers of columns of which the first rows, as many as fit, are in memory, and all in `file` if there is one.
    ///
    /// `magnitude` is by stored row; `row_is_fixed` is in the user's order.
    pub(super) fn new(
        node_order: NodeOrder,
        row_is_fixed: &[bool],
        magnitude: Vec<f64>,
        numbers: Numbers,
        file: Option<ColumnsFile>,
    ) -> Self {
        let scale = scales(numbers.precision(), &magnitude);
        let free = |place: usize| {
            let node = node_order.nodes()[place] as usize;
            let of_axis = |axis| scale.get(3 * place + axis).copied().unwrap_or(1.0);
            let dof = |axis| if axis == 3 || row_is_fixed[3 * node + axis] { 0.0 } else { of_axis(axis) };
            std::array::from_fn(dof)
        };
        let rows = row_is_fixed.len();
        let resident = if file.is_some() { 3 * node_order.touchable_count() } else { rows };
        let free = (0..node_order.nodes().len()).map(free).collect();
        Self { arch: Arch::new(), rows, resident, numbers, magnitude, scale, free, file, node_order }
    }

    /// Number format.
    pub fn precision(&self) -> Precision {
        self.numbers.precision()
    }

    /// Where the nodes are.
    pub(super) fn node_order(&self) -> &NodeOrder {
        &self.node_order
    }

    /// Bounds of the stored rows.
    pub(super) fn magnitudes(&self) -> &[f64] {
        &self.magnitude
    }

    /// Hands the bytes of all columns to `put`, as first column and bytes.
    pub(super) fn each_bytes(&self, put: &mut dyn FnMut(usize, &[u8]) -> Result<()>) -> Result<()> {
        let Some(file) = &self.file else { return put(0, self.numbers.bytes()) };
        let mut column = vec![0; self.rows * self.precision().bytes()];
        for index in 0..3 * self.node_order.touchable_count() {
            file.read(index, 0, &mut column)?;
            put(index, &column)?;
        }
        Ok(())
    }

    /// `sums += factor * column` over the first stored rows, for stored columns and factors; NaN where the file fails.
    fn add_columns(&self, columns: &[(usize, f64)], sums: &mut [f64]) {
        let mut read = self.file.as_ref().map(|_| Numbers::zeros(self.precision(), COLUMNS_AT_ONCE * sums.len()));
        for group in columns.chunks(COLUMNS_AT_ONCE) {
            // The last group is filled up with nothing times its first column.
            let mut starts = [group[0].0 * self.resident; COLUMNS_AT_ONCE];
            let mut factors = [0.0; COLUMNS_AT_ONCE];
            for (k, &(column, factor)) in group.iter().enumerate() {
                (starts[k], factors[k]) = (column * self.resident, factor);
            }
            let mut numbers = &self.numbers;
            if let (Some(read), Some(file)) = (&mut read, &self.file) {
                let bytes = sums.len() * self.precision().bytes();
                let pieces = read.bytes_mut().chunks_exact_mut(bytes).zip(group);
                if pieces.into_iter().any(|(piece, &(column, _))| file.read(column, 0, piece).is_err()) {
                    return sums.fill(f64::NAN);
                }
                starts = std::array::from_fn(|k| if k < group.len() { k * sums.len() } else { 0 });
                numbers = read;
            }
            numbers.run(self.arch, AddColumns { starts, factors, sums });
        }
    }

    /// Stored numbers, unscaled, of a column from row `row` on, out of the file; NaN where it fails.
    pub(super) fn read_from_file<const N: usize>(&self, row: usize, column: usize) -> [f64; N] {
        let mut numbers = Numbers::zeros(self.precision(), N);
        let from = row * self.precision().bytes();
        let read = self.file.as_ref().is_some_and(|file| file.read(column, from, numbers.bytes_mut()).is_ok());
        std::array::from_fn(|k| if read { numbers.run(self.arch, One(k)) } else { f64::NAN })
    }

    /// Scale of a stored row, and of the column that belongs to it.
    pub(super) fn scale_of(&self, row: usize) -> f64 {
        self.scale.get(row).copied().unwrap_or(1.0)
    }
}

impl GreensFunction {
    /// Bound `s_i` of a row: `|Psi_ij| <= s_i s_j`; the root of a compliance, and of a stiffness on supported rows.
    pub fn magnitude(&self, row: usize) -> f64 {
        let entries = &self.entries;
        entries.magnitude.get(entries.node_order.stored_row(row)).copied().unwrap_or(0.0)
    }

    /// Whether the rows of surface node `node` are in memory, so that a tick may ask for them; those of touchable nodes are.
    pub fn is_resident(&self, node: usize) -> bool {
        3 * self.entries.node_order.place(node) < self.entries.resident
    }

    /// Whether everything can still be read: `false` once somebody has cut the file short. Costs a call of the system.
    pub fn is_intact(&self) -> bool {
        self.entries.file.as_ref().is_none_or(ColumnsFile::is_intact)
    }

    /// To be called before whole columns are read ([`Self::add_forces`], [`Self::add_column`], rows of nodes that are
    /// not resident): they are NaN where the file has been cut short.
    ///
    /// # Errors
    /// [`crate::Error::Store`] for a file that was cut short while in use.
    pub fn require_intact(&self) -> Result<()> {
        self.entries.file.as_ref().map_or(Ok(()), ColumnsFile::require_intact)
    }

    /// Entry of row `row` and column `column`.
    pub fn entry(&self, row: usize, column: usize) -> f64 {
        let entries = &self.entries;
        let (row, column) = (entries.node_order.stored_row(row), self.stored_column(column));
        let value = if row < entries.resident {
            entries.numbers.run(entries.arch, One(column * entries.resident + row))
        } else {
            entries.read_from_file::<1>(row, column)[0]
        };
        // The product of the scales first: it is the same for the mirrored entry.
        entries.scale_of(row) * entries.scale_of(column) * value
    }

    /// `out += factor * Psi(:, column)`, on all rows.
    pub fn add_column(&self, column: usize, factor: f64, out: &mut [f64]) {
        let (entries, column) = (&self.entries, self.stored_column(column));
        let mut sums = vec![0.0; entries.rows];
        entries.add_columns(&[(column, factor * entries.scale_of(column))], &mut sums);
        let (surface, inside) = sums.split_at(3 * entries.free.len());
        for (place, (&node, sums)) in entries.node_order.nodes().iter().zip(surface.chunks_exact(3)).enumerate() {
            for (axis, sum) in sums.iter().enumerate() {
                out[3 * node as usize + axis] += entries.scale_of(3 * place + axis) * sum;
            }
        }
        for (row, sum) in (surface.len()..).zip(inside) {
            out[row] += entries.scale_of(row) * sum;
        }
    }

    /// Adds `Psi f` to the displacements (m) of all surface dofs (3s) for forces on nodes, N; supported dofs take no force
    /// and do not move. Made for frames: each column is read once, in the order of the store.
    pub fn add_forces(&self, forces: &[(TouchNode, DVec3)], out: &mut [f64]) {
        let entries = &self.entries;
        let of_node = |&(node, force): &(TouchNode, DVec3)| {
            let free = entries.free[node.place()];
            (0..3).map(move |axis| (3 * node.place() + axis, free[axis] * force[axis]))
        };
        let columns: Vec<(usize, f64)> = forces.iter().flat_map(of_node).filter(|&(_, factor)| factor != 0.0).collect();
        let mut sums = vec![0.0; 3 * entries.free.len()];
        entries.add_columns(&columns, &mut sums);
        for (place, (&node, sums)) in entries.node_order.nodes().iter().zip(sums.chunks_exact(3)).enumerate() {
            for axis in 0..3 {
                out[3 * node as usize + axis] += entries.free[place][axis] * sums[axis];
            }
        }
    }

    /// Column of the store for a column in the user's order.
    fn stored_column(&self, column: usize) -> usize {
        self.entries.node_order.stored_row(self.row_of_column(column))
    }
}
