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

use pulp::Arch;

use super::columns_file::ColumnsFile;
use super::node_order::NodeOrder;
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
    pub(super) rows: usize,
    /// Numbers of a column that are in memory: all, or those of the touchable nodes.
    pub(super) resident: usize,
    pub(super) numbers: Numbers,
    /// Bound `s_i` of each stored row, `|Psi_ij| <= s_i s_j`; empty where nothing is computed yet.
    pub(super) magnitude: Vec<f64>,
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
    pub(super) fn add_columns(&self, columns: &[(usize, f64)], sums: &mut [f64]) {
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
