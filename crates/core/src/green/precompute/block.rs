//! A block of columns that are solved together.

/// Columns of a block.
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
