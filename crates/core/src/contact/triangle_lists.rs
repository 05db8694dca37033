//! For each drawn triangle what lies near it.

use std::collections::BTreeSet;

use glam::DVec3;

use super::SurfaceQuery;
use crate::memory::Ranges;
use crate::mesh::Surface;

/// Ranks of things near each drawn triangle, in ascending order.
pub struct TriangleLists {
    /// For each triangle the start of its ranks; one more for the end.
    offsets: Vec<u32>,
    ranks: Vec<u32>,
}

impl TriangleLists {
    /// Lists each thing at the triangles whose boxes meet its own, given by two corners, m, in the order of the ranks.
    pub fn new(surface: &Surface, query: &SurfaceQuery, boxes: impl Iterator<Item = [DVec3; 2]>) -> Self {
        let mut lists = vec![BTreeSet::new(); surface.triangles.len()];
        for (rank, [low, high]) in boxes.enumerate() {
            query.for_each_within(low, high, |triangle| {
                lists[triangle as usize].insert(rank as u32);
            });
        }
        let (mut offsets, mut ranks) = (vec![0], Vec::new());
        for list in lists {
            ranks.extend(list);
            offsets.push(ranks.len() as u32);
        }
        Self { offsets, ranks }
    }

    /// The ranks at a triangle.
    pub fn at(&self, triangle: u32) -> &[u32] {
        let [from, to] = [0, 1].map(|next| self.offsets[triangle as usize + next] as usize);
        &self.ranks[from..to]
    }

    /// Adds the memory that a tick reads.
    pub(crate) fn add_memory(&self, ranges: &mut Ranges) {
        ranges.add(&self.offsets);
        ranges.add(&self.ranks);
    }
}
