//! How a store keeps the rows, and the columns of the nodes that are ready.

use glam::DVec3;

use super::layout::Layout;
use super::spatial_order::spatial_order;
use crate::green::places::Places;

/// Rows and columns of a store.
pub struct Arrangement {
    /// Touchable nodes, ascending ranks among the surface nodes.
    pub touch: Vec<u32>,
    /// Where the surface nodes are kept.
    pub places: Places,
    /// Rank in the layout of each row of the store.
    pub rank_of_stored: Vec<u32>,
}

impl Arrangement {
    /// Of a store of the first `columns` places, which are all the columns of some of the surface nodes at `positions`.
    pub fn new(positions: &[DVec3], layout: &Layout, columns: usize) -> Self {
        let mut touch: Vec<u32> = (0..columns).map(|place| layout.row(place) as u32 / 3).collect();
        touch.sort_unstable();
        touch.dedup();
        let places = Places::new(spatial_order(positions, &touch), touch.len());
        let mut rank_of_stored = vec![0; layout.rows()];
        for (rank, &row) in layout.row_of_rank.iter().enumerate() {
            rank_of_stored[places.stored_row(row as usize)] = rank as u32;
        }
        Self { touch, places, rank_of_stored }
    }

    /// Column of the store of a place of the layout.
    pub fn column(&self, layout: &Layout, place: usize) -> usize {
        self.places.stored_row(layout.row(place))
    }
}
