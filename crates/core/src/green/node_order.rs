//! Order of the surface nodes in a store: neighbours in space are neighbours in memory.
//!
//! Touchable nodes come first, then the other surface nodes, both in spatial order (`precompute::spatial_order`). The
//! columns are those of the touchable nodes in the same order. The square of touchable rows and columns, all that a force
//! tick reads, is then the head of every column, and a patch is a few short runs in it.

/// Rank of a touchable node in its store: proof that `Psi` has columns for it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct TouchNode(u32);

impl TouchNode {
    /// Its place among all nodes, which is its rank among the columns, three each.
    pub(super) fn place(self) -> usize {
        self.0 as usize
    }
}

/// Places of the surface nodes in the store.
#[derive(Clone, Debug)]
pub struct NodeOrder {
    /// Surface node (rank among the ascending surface nodes) at each place.
    nodes: Vec<u32>,
    /// Place of each surface node.
    places: Vec<u32>,
    touchable: usize,
}

impl NodeOrder {
    /// The order that a store has written down: the surface node at each place. `None` unless it holds every node
    /// once, those of `touch` first.
    pub fn from_nodes(nodes: Vec<u32>, touch: &[u32]) -> Option<Self> {
        let mut seen = vec![false; nodes.len()];
        for &node in &nodes {
            if std::mem::replace(seen.get_mut(node as usize)?, true) {
                return None;
            }
        }
        let head = nodes.get(..touch.len())?;
        let touchable = head.iter().all(|node| touch.binary_search(node).is_ok());
        touchable.then(|| Self::new(nodes, touch.len()))
    }

    /// Keeps `nodes`, each surface node once, in this order, the first `touchable` ones being those with columns.
    pub fn new(nodes: Vec<u32>, touchable: usize) -> Self {
        let mut places = vec![0; nodes.len()];
        for (place, &node) in nodes.iter().enumerate() {
            places[node as usize] = place as u32;
        }
        Self { nodes, places, touchable }
    }

    /// Surface node at each place.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes
    }

    /// Number of touchable nodes.
    pub fn touchable_count(&self) -> usize {
        self.touchable
    }

    /// The place of a surface node.
    pub fn place(&self, node: usize) -> usize {
        self.places[node] as usize
    }

    /// The columns of a surface node, if it has any.
    pub fn touchable(&self, node: usize) -> Option<TouchNode> {
        self.places.get(node).copied().filter(|&place| (place as usize) < self.touchable).map(TouchNode)
    }

    /// Row of the store for a row in the user's order: surface dofs first, then supported dofs inside, which stay.
    pub fn stored_row(&self, row: usize) -> usize {
        match self.places.get(row / 3) {
            Some(&place) => 3 * place as usize + row % 3,
            None => row,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn touchable_nodes_come_first_and_rows_there_and_back_agree() {
        let touch: Vec<u32> = (0..50).filter(|i| i % 3 == 1).collect();
        let mut nodes: Vec<u32> = (0..50).map(|i| i * 7 % 50).collect();
        nodes.sort_by_key(|node| !touch.contains(node));
        let places = NodeOrder::new(nodes, touch.len());
        for node in 0..50 {
            assert_eq!(places.touchable(node).is_some(), touch.contains(&(node as u32)));
            assert_eq!(places.nodes()[places.place(node)], node as u32);
        }
        let mut stored: Vec<usize> = (0..160).map(|row| places.stored_row(row)).collect();
        assert_eq!(stored[155], 155, "supported dofs inside stay");
        stored.sort_unstable();
        assert!(stored.into_iter().eq(0..160));
        assert_eq!(places.touchable(50), None);
        // What a store has written down is believed only if it is such an order.
        assert!(NodeOrder::from_nodes(places.nodes().to_vec(), &touch).is_some());
        assert!(NodeOrder::from_nodes((0..50).collect(), &touch).is_none());
        assert!(NodeOrder::from_nodes(vec![1; 50], &touch).is_none());
    }
}
