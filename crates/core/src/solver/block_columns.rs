//! Lower trapezoids by columns: the part of a symmetric matrix on and below its diagonal, or the first columns of it.
//!
//! The columns are cut into blocks, each of which holds its rows from the first column's diagonal on: half of the square,
//! and pieces that the cache holds and that threads share without a rule of who takes what entering the numbers.

use faer::{MatMut, MatRef};

/// Columns of a block: a product of two blocks is long enough to run at full speed.
pub const WIDTH: usize = 256;

/// Consecutive columns, rows from that of the first one's diagonal on.
#[derive(Debug)]
pub struct BlockColumn<T> {
    /// First column.
    pub first: usize,
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// One column after the other; there may be more behind them.
    values: Vec<T>,
}

impl<T> BlockColumn<T> {
    /// With the numbers that stand in `values`.
    pub fn new(first: usize, width: usize, height: usize, values: Vec<T>) -> Self {
        debug_assert!(values.len() >= width * height);
        Self { first, width, height, values }
    }

    /// Its memory.
    pub fn into_values(self) -> Vec<T> {
        self.values
    }

    /// All of it.
    pub fn matrix(&self) -> MatRef<'_, T> {
        MatRef::from_column_major_slice(&self.values[..self.width * self.height], self.height, self.width)
    }

    /// All of it, to be changed.
    pub fn matrix_mut(&mut self) -> MatMut<'_, T> {
        let values = &mut self.values[..self.width * self.height];
        MatMut::from_column_major_slice_mut(values, self.height, self.width)
    }

    /// Rows from `from` on, counted as those of the whole matrix.
    pub fn rows_from(&self, from: usize) -> MatRef<'_, T> {
        self.matrix().split_at_row(from - self.first).1
    }

    /// The rows from its diagonal on of one of its columns, counted in the block; row `first` is the slice's first.
    pub fn column_mut(&mut self, column: usize) -> &mut [T] {
        &mut self.values[column * self.height..][..self.height]
    }

    /// A column, as [`BlockColumn::column_mut`].
    pub fn column(&self, column: usize) -> &[T] {
        &self.values[column * self.height..][..self.height]
    }
}

/// First columns and widths of the blocks of some columns: all have `WIDTH` columns but for the last.
pub fn cuts(columns: usize) -> impl ExactSizeIterator<Item = (usize, usize)> + Clone {
    (0..columns.div_ceil(WIDTH)).map(move |block| (block * WIDTH, WIDTH.min(columns - block * WIDTH)))
}

/// Numbers in a trapezoid of some columns and rows.
pub fn trapezoid_len(columns: usize, rows: usize) -> usize {
    cuts(columns).map(|(first, width)| width * (rows - first)).sum()
}
