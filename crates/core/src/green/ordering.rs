//! Fill-reducing order by nested dissection (METIS), on the node graph so that a node's dofs stay together.
#![allow(unsafe_code)] // METIS is a C library.

use metis_sys::{METIS_NodeND, idx_t, rstatus_et_METIS_OK};

/// Nested-dissection order of a graph in compressed adjacency form (no self loops): `order[new] = old`.
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
    if status != rstatus_et_METIS_OK {
        return identity();
    }
    order.into_iter().map(|i| i as u32).collect()
}
