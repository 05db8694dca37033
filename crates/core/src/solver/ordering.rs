//! Fill-reducing order by nested dissection (METIS), on the node graph so that a node's dofs stay together.
//! Through `metis-sys`: the safe `metis` crate does not offer nested dissection.
#![allow(unsafe_code)] // METIS is a C library.

use std::sync::{Mutex, PoisonError};

use metis_sys::{METIS_NodeND, idx_t, rstatus_et_METIS_OK};

/// METIS draws from the C library's one generator, which each call seeds: two at once would get each other's numbers, and an
/// order, with it the last bits of a store, that depends on when they came.
static GENERATOR: Mutex<()> = Mutex::new(());

/// Nested-dissection order of a graph in compressed adjacency form (no self loops): `order[new] = old`, postordered.
///
/// Falls back to the identity where METIS declines (it then only costs fill, never correctness).
pub fn nested_dissection(start: &[usize], adjacency: &[u32]) -> Vec<u32> {
    let count = start.len() - 1;
    let identity = || (0..count as u32).collect();
    if adjacency.is_empty() {
        return identity();
    }
    let mut vertices = count as idx_t;
    let mut xadj: Vec<idx_t> = start.iter().map(|&s| s as idx_t).collect();
    let mut adjncy: Vec<idx_t> = adjacency.iter().map(|&a| a as idx_t).collect();
    let mut order = vec![0 as idx_t; count];
    let mut rank = vec![0 as idx_t; count];
    let alone = GENERATOR.lock().unwrap_or_else(PoisonError::into_inner);
    // SAFETY: the arrays have the lengths METIS documents (count + 1, xadj[count], count, count) and outlive the call;
    // null weights and options ask for the defaults.
    let status = unsafe {
        METIS_NodeND(
            &mut vertices,
            xadj.as_mut_ptr(),
            adjncy.as_mut_ptr(),
            std::ptr::null_mut(),
            std::ptr::null_mut(),
            order.as_mut_ptr(),
            rank.as_mut_ptr(),
        )
    };
    drop(alone);
    if status != rstatus_et_METIS_OK {
        return identity();
    }
    let order: Vec<u32> = order.into_iter().map(|i| i as u32).collect();
    let rank: Vec<u32> = rank.into_iter().map(|i| i as u32).collect();
    postorder(&elimination_parents(&order, &rank, start, adjacency)).into_iter().map(|i| order[i as usize]).collect()
}

/// Parent of each place in the elimination tree of an order, or its own place for a root: for each place in turn, the
/// roots above its earlier neighbours become its children (Liu, 1990, with path compression).
fn elimination_parents(order: &[u32], rank: &[u32], start: &[usize], adjacency: &[u32]) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..order.len() as u32).collect();
    let mut ancestor = parent.clone();
    for (place, &vertex) in order.iter().enumerate() {
        let place = place as u32;
        for &neighbour in &adjacency[start[vertex as usize]..start[vertex as usize + 1]] {
            let mut at = rank[neighbour as usize];
            while at < place {
                let above = std::mem::replace(&mut ancestor[at as usize], place);
                if above == at {
                    parent[at as usize] = place;
                }
                at = if above == at { place } else { above };
            }
        }
    }
    parent
}

/// Places in an equivalent order in which every subtree is consecutive: METIS leaves its smallest parts unordered so,
/// which splits supernodes.
fn postorder(parent: &[u32]) -> Vec<u32> {
    let count = parent.len();
    let mut size = vec![1u32; count];
    for (place, &above) in parent.iter().enumerate() {
        if above as usize != place {
            size[above as usize] += size[place];
        }
    }
    // From the roots down: a subtree ends where its parent says, and hands the room before itself to its children.
    let mut end = vec![0u32; count];
    let mut room = count as u32;
    let mut result = vec![0u32; count];
    for place in (0..count).rev() {
        let above = parent[place] as usize;
        let last = if above == place { &mut room } else { &mut end[above] };
        let own_end = *last;
        *last -= size[place];
        end[place] = own_end - 1;
        result[own_end as usize - 1] = place as u32;
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid of `wide` x `high` vertices.
    fn grid(wide: i32, high: i32) -> (Vec<usize>, Vec<u32>) {
        let (mut start, mut adjacency) = (vec![0], Vec::new());
        for i in 0..wide * high {
            let (x, y) = (i % wide, i / wide);
            let neighbours = [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)];
            let inside = neighbours.into_iter().filter(|&(a, b)| (0..wide).contains(&a) && (0..high).contains(&b));
            adjacency.extend(inside.map(|(a, b)| (wide * b + a) as u32));
            start.push(adjacency.len());
        }
        (start, adjacency)
    }

    #[test]
    fn orders_made_at_once_are_those_made_one_by_one() {
        let (start, adjacency) = grid(90, 80);
        let order = nested_dissection(&start, &adjacency);
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| assert!((0..5).all(|_| nested_dissection(&start, &adjacency) == order)));
            }
        });
    }

    #[test]
    fn order_is_a_permutation_in_which_subtrees_are_consecutive() {
        let (start, adjacency) = grid(9, 8);
        let order = nested_dissection(&start, &adjacency);
        let mut rank = vec![u32::MAX; 72];
        for (place, &vertex) in order.iter().enumerate() {
            rank[vertex as usize] = place as u32;
        }
        assert!(rank.iter().all(|&r| r != u32::MAX));
        let parent = elimination_parents(&order, &rank, &start, &adjacency);
        let mut first: Vec<u32> = (0..72).collect();
        let mut size = vec![1; 72];
        for place in 0..72 {
            assert_eq!(first[place] as usize, place + 1 - size[place], "subtree of {place}");
            let above = parent[place] as usize;
            if above != place {
                assert!(above > place);
                first[above] = first[above].min(first[place]);
                size[above] += size[place];
            }
        }
    }
}
