//! Order of rows and columns in a store of the nodes computed so far.

use glam::DVec3;

use super::layout::Layout;
use super::spatial_order::spatial_order;
use crate::green::node_order::NodeOrder;

/// Rows and columns of a store.
pub struct Arrangement {
    /// Touchable nodes, ascending ranks among the surface nodes.
    pub touch: Vec<u32>,
    /// Storage order of the surface nodes.
    pub node_order: NodeOrder,
    /// Rank in the layout of each row of the store.
    pub rank_of_stored: Vec<u32>,
}

impl Arrangement {
    /// Of a store of the first `columns` places, which are all the columns of some of the surface nodes at `positions`.
    pub fn new(positions: &[DVec3], layout: &Layout, columns: usize) -> Self {
        let mut touch: Vec<u32> = (0..columns).map(|place| layout.row(place) as u32 / 3).collect();
        touch.sort_unstable();
        touch.dedup();
        let node_order = NodeOrder::new(spatial_order(positions, &touch), touch.len());
        let mut rank_of_stored = vec![0; layout.rows()];
        for (rank, &row) in layout.row_of_rank.iter().enumerate() {
            rank_of_stored[node_order.stored_row(row as usize)] = rank as u32;
        }
        Self { touch, node_order, rank_of_stored }
    }

    /// Column of the store of a place of the layout.
    pub fn column(&self, layout: &Layout, place: usize) -> usize {
        self.node_order.stored_row(layout.row(place))
    }
}
