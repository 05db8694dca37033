//! Stages of nodes: a region first, then the nodes around it by distance.
//!
//! Each stage is about as large as all before it together. The number of stages is then the logarithm of the number of
//! nodes, and stores written at the end of each stage add up to less than twice the last.

use glam::DVec3;

/// A stage is no smaller than this, in nodes: three blocks of the widest kind.
const FEWEST_NODES: usize = 192;

/// The nodes of `touch` (ascending ranks among the surface nodes at `positions`) in stages: those of `first`, then the
/// others by their distance from the closest of those; `ready` nodes are computed before them. One stage where `first` holds
/// none of them, or all.
pub fn stages(positions: &[DVec3], touch: &[u32], first: &[u32], ready: usize) -> Vec<Vec<u32>> {
    let (first, mut others): (Vec<u32>, Vec<u32>) = touch.iter().partition(|node| first.contains(node));
    if first.is_empty() || others.is_empty() {
        return vec![touch.to_vec()];
    }
    by_distance(positions, &mut others, &first);
    let before = ready + first.len();
    std::iter::once(first).chain(split_growing(others, before)).collect()
}

/// Sorts nodes by their distance from the closest node of a region.
fn by_distance(positions: &[DVec3], nodes: &mut [u32], region: &[u32]) {
    let distance = |node: &u32| -> f64 {
        let distances = region.iter().map(|&of| positions[of as usize].distance_squared(positions[*node as usize]));
        distances.fold(f64::INFINITY, f64::min)
    };
    let mut keyed: Vec<(f64, u32)> = nodes.iter().map(|node| (distance(node), *node)).collect();
    keyed.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    nodes.iter_mut().zip(keyed).for_each(|(node, (_, sorted))| *node = sorted);
}

/// Cuts sorted nodes into stages, each about as large as what is before it.
fn split_growing(mut nodes: Vec<u32>, mut before: usize) -> Vec<Vec<u32>> {
    let mut stages = Vec::new();
    while !nodes.is_empty() {
        let size = before.max(FEWEST_NODES);
        // A remainder of less than half a stage is added to this one.
        let size = if nodes.len() < size + size / 2 { nodes.len() } else { size };
        let rest = nodes.split_off(size);
        before += size;
        stages.push(std::mem::replace(&mut nodes, rest));
    }
    stages
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_hold_every_node_once_and_grow_outwards() {
        let positions: Vec<DVec3> = (0..4000u32).map(|i| DVec3::new(f64::from(i * 7 % 4000), 0.0, 0.0)).collect();
        let touch: Vec<u32> = (0..4000).filter(|i| i % 3 != 0).collect();
        let first: Vec<u32> = (0..4000).filter(|&i| positions[i as usize].x < 90.0).collect();
        let stages = stages(&positions, &touch, &first, 0);
        let mut all: Vec<u32> = stages.iter().flatten().copied().collect();
        all.sort_unstable();
        assert_eq!(all, touch);
        assert!(stages[0].iter().all(|node| first.contains(node)) && stages.len() <= 6, "{} stages", stages.len());
        let mut before = stages[0].len();
        for pair in stages.windows(2) {
            let x = |stage: &[u32]| -> Vec<f64> { stage.iter().map(|&node| positions[node as usize].x).collect() };
            let farthest = x(&pair[0]).into_iter().fold(0.0, f64::max);
            assert!(x(&pair[1]).into_iter().all(|x| x > farthest));
            // The last is at least half of the one before, which is half of what is there then.
            assert!(4 * pair[1].len() >= before, "{} after {before}", pair[1].len());
            before += pair[1].len();
        }
    }

    #[test]
    fn a_region_that_holds_nothing_or_everything_is_one_stage() {
        let positions = vec![DVec3::ZERO; 5];
        assert_eq!(stages(&positions, &[1, 3, 4], &[], 0), [[1, 3, 4]]);
        assert_eq!(stages(&positions, &[1, 3, 4], &[0, 1, 3, 4], 0), [[1, 3, 4]]);
    }
}
