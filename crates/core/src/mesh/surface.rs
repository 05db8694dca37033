//! The touchable boundary: rest positions, outward triangles, and who is next to whom.

use glam::DVec3;

use crate::{Error, Result};

/// A closed, outward-oriented triangle surface. Indices are local to the surface.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Rest positions, m; row `i` is `mesh.surface_nodes[i]`.
    pub positions: Vec<DVec3>,
    /// Local node indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Unit outward normal of each triangle.
    pub normals: Vec<DVec3>,
    /// For each triangle and each of its edges `(i, i+1)`: the triangle across, or `u32::MAX`.
    pub neighbours: Vec<[u32; 3]>,
}

impl Surface {
    /// Builds normals and adjacency.
    ///
    /// # Errors
    /// A triangle that names a missing node.
    pub fn new(positions: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Result<Self> {
        let count = positions.len();
        if let Some(t) = triangles.iter().position(|t| t.iter().any(|&n| n as usize >= count)) {
            return Err(Error::Invalid(format!("surface triangle {t} names a node beyond the {count} surface nodes")));
        }
        let normals = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|n| positions[n as usize]);
                (b - a).cross(c - a).normalize_or_zero()
            })
            .collect();
        let neighbours = edge_neighbours(&triangles);
        Ok(Self { positions, triangles, normals, neighbours })
    }

    /// Corner positions of triangle `t`, m.
    pub fn corners(&self, t: u32) -> [DVec3; 3] {
        self.triangles[t as usize].map(|n| self.positions[n as usize])
    }
}

/// Pairs triangles over shared edges. Where more than two meet (bodies that touch along an edge) the pair that runs in
/// opposite directions first in the list is joined.
fn edge_neighbours(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut edges: Vec<(u32, u32, u32, u8)> = Vec::with_capacity(3 * triangles.len());
    for (t, tri) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (tri[k], tri[(k + 1) % 3]);
            edges.push((a.min(b), a.max(b), t as u32, k as u8));
        }
    }
    edges.sort_unstable();
    let mut neighbours = vec![[u32::MAX; 3]; triangles.len()];
    for pair in edges.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        for two in pair.chunks_exact(2) {
            let (first, second) = (two[0], two[1]);
            neighbours[first.2 as usize][first.3 as usize] = second.2;
            neighbours[second.2 as usize][second.3 as usize] = first.2;
        }
    }
    neighbours
}
