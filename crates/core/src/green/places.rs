//! The order in which a store keeps the surface nodes: neighbours in space are neighbours in memory.
//!
//! Touchable nodes come first, then the other surface nodes, both along a Hilbert curve through the rest positions. The
//! columns are those of the touchable nodes in the same order. The square of touchable rows and columns, all that a force
//! tick reads, is then the head of every column, and a patch is a few short runs in it.

use glam::DVec3;

/// Bits of a coordinate along the curve: 2^-16 of the body is finer than any mesh.
const BITS: u32 = 16;

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
pub struct Places {
    /// Surface node (rank among the ascending surface nodes) at each place.
    nodes: Vec<u32>,
    /// Place of each surface node.
    places: Vec<u32>,
    touchable: usize,
}

impl Places {
    /// Spatial order of the nodes at `positions`, those of `touch` (ascending ranks) first.
    pub fn new(positions: &[DVec3], touch: &[u32]) -> Self {
        let (low, high) =
            positions.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
        // Equal steps along all axes, so that the curve's cells are cubes.
        let scale = f64::from((1 << BITS) - 1) / (high - low).max_element().max(f64::MIN_POSITIVE);
        let curve = |node: u32| hilbert_index(((positions[node as usize] - low) * scale).to_array().map(|x| x as u32));
        let mut nodes: Vec<u32> = (0..positions.len() as u32).collect();
        nodes.sort_by_cached_key(|&node| (touch.binary_search(&node).is_err(), curve(node), node));
        Self::inverted(nodes, touch.len())
    }

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
        touchable.then(|| Self::inverted(nodes, touch.len()))
    }

    fn inverted(nodes: Vec<u32>, touchable: usize) -> Self {
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

    /// The columns of a surface node that is touchable.
    pub(super) fn touch_node(&self, node: u32) -> TouchNode {
        TouchNode(self.places[node as usize])
    }

    /// Row of the store for a row in the user's order: surface dofs first, then supported dofs inside, which stay.
    pub fn stored_row(&self, row: usize) -> usize {
        match self.places.get(row / 3) {
            Some(&place) => 3 * place as usize + row % 3,
            None => row,
        }
    }
}

/// Index of a cell of the grid along Hilbert's curve in three dimensions (Skilling, AIP Conf. Proc. 707, 2004): undo the
/// rotations from the coarsest level down, Gray-encode, interleave the bits.
fn hilbert_index(mut x: [u32; 3]) -> u64 {
    for level in (1..BITS).rev() {
        let (bit, below) = (1 << level, (1 << level) - 1);
        for axis in 0..3 {
            if x[axis] & bit != 0 {
                x[0] ^= below;
            } else {
                let exchanged = (x[0] ^ x[axis]) & below;
                x[0] ^= exchanged;
                x[axis] ^= exchanged;
            }
        }
    }
    x[1] ^= x[0];
    x[2] ^= x[1];
    let flips = (1..BITS).filter(|level| x[2] & (1 << level) != 0).fold(0, |flips, level| flips ^ ((1 << level) - 1));
    let x = x.map(|coordinate| coordinate ^ flips);
    (0..BITS).rev().flat_map(|bit| x.map(|coordinate| u64::from(coordinate >> bit & 1))).fold(0, |i, bit| i << 1 | bit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_goes_from_cell_to_neighbouring_cell() {
        let cells = (0..16u32).flat_map(|x| (0..16).flat_map(move |y| (0..16).map(move |z| [x, y, z])));
        let mut cells: Vec<(u64, [u32; 3])> = cells.map(|cell| (hilbert_index(cell), cell)).collect();
        cells.sort_unstable();
        for (index, pair) in cells.windows(2).enumerate() {
            // The cube at the origin is the curve's beginning, every cell visited once.
            assert_eq!(pair[0].0, index as u64);
            let steps: u32 = pair[0].1.into_iter().zip(pair[1].1).map(|(a, b)| a.abs_diff(b)).sum();
            assert_eq!(steps, 1, "from {:?} to {:?}", pair[0].1, pair[1].1);
        }
    }

    #[test]
    fn touchable_nodes_come_first_and_rows_there_and_back_agree() {
        let positions: Vec<DVec3> =
            (0..50).map(|i| DVec3::new(f64::from(i * 7 % 50), f64::from(i * 13 % 50), 0.0)).collect();
        let touch: Vec<u32> = (0..50).filter(|i| i % 3 == 1).collect();
        let places = Places::new(&positions, &touch);
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
        assert!(Places::from_nodes(places.nodes().to_vec(), &touch).is_some());
        assert!(Places::from_nodes((0..50).collect(), &touch).is_none());
        assert!(Places::from_nodes(vec![1; 50], &touch).is_none());
    }
}
