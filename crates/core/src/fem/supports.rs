//! Which dofs are fixed, and the numbering of the free ones.

use crate::{Error, Result};

/// Partition of the dofs into free ones `N` and fixed ones `D`.
#[derive(Clone, Debug)]
pub struct Supports {
    /// Fixed dofs, ascending.
    pub fixed: Vec<u32>,
    /// Free dofs, ascending.
    pub free: Vec<u32>,
    /// For each dof its rank among the free ones, or `u32::MAX`.
    pub free_rank: Vec<u32>,
}

impl Supports {
    /// Partition of `dof_count` dofs.
    ///
    /// # Errors
    /// A fixed dof out of range, none at all, or no free dof left.
    pub fn new(dof_count: usize, mut fixed: Vec<u32>) -> Result<Self> {
        fixed.sort_unstable();
        fixed.dedup();
        if fixed.last().is_some_and(|&d| d as usize >= dof_count) {
            return Err(Error::Invalid(format!("a fixed dof lies beyond the {dof_count} dofs")));
        }
        if fixed.is_empty() {
            return Err(Error::Invalid("the body has no support: fix some nodes, or it flies away".into()));
        }
        if fixed.len() == dof_count {
            return Err(Error::Invalid("every node is fixed: nothing is left to deform".into()));
        }
        let mut free_rank = vec![0u32; dof_count];
        for &d in &fixed {
            free_rank[d as usize] = u32::MAX;
        }
        let mut free = Vec::with_capacity(dof_count - fixed.len());
        for (dof, rank) in free_rank.iter_mut().enumerate() {
            if *rank != u32::MAX {
                *rank = free.len() as u32;
                free.push(dof as u32);
            }
        }
        Ok(Self { fixed, free, free_rank })
    }

    /// Whether `dof` is fixed.
    pub fn is_fixed(&self, dof: u32) -> bool {
        self.free_rank[dof as usize] == u32::MAX
    }
}
