//! The surface nodes along a Hilbert curve through their rest positions, so that a patch is a few short runs.

use glam::DVec3;

/// Bits of a coordinate along the curve: 2^-16 of the body is finer than any mesh.
const BITS: u32 = 16;

/// Ranks of the nodes at `positions` in spatial order, those of `touch` (ascending ranks) first.
pub fn spatial_order(positions: &[DVec3], touch: &[u32]) -> Vec<u32> {
    let (low, high) =
        positions.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
    // Equal steps along all axes, so that the curve's cells are cubes.
    let scale = f64::from((1 << BITS) - 1) / (high - low).max_element().max(f64::MIN_POSITIVE);
    let curve = |node: u32| hilbert_index(((positions[node as usize] - low) * scale).to_array().map(|x| x as u32));
    let mut nodes: Vec<u32> = (0..positions.len() as u32).collect();
    nodes.sort_by_cached_key(|&node| (touch.binary_search(&node).is_err(), curve(node), node));
    nodes
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
    fn touchable_nodes_come_first_and_neighbours_stay_together() {
        let positions: Vec<DVec3> = (0..64u32).map(|i| DVec3::new(f64::from(i * 23 % 64), 0.0, 0.0)).collect();
        let touch: Vec<u32> = (0..64).filter(|i| i % 4 != 1).collect();
        let order = spatial_order(&positions, &touch);
        let (first, last) = order.split_at(touch.len());
        assert!(first.iter().all(|node| touch.contains(node)) && !last.iter().any(|node| touch.contains(node)));
        let mut all = order.clone();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..64));
        // On a line the curve leaves no half before it has seen all of it.
        let halves: Vec<bool> = first.iter().map(|&node| positions[node as usize].x < 31.5).collect();
        assert_eq!(halves.windows(2).filter(|pair| pair[0] != pair[1]).count(), 1);
    }
}
