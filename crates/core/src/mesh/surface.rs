//! The touchable boundary: rest positions, outward faces and the triangles they are drawn by, and which are neighbours.

use glam::DVec3;

use crate::element::{Face, Tri3, Tri6};
use crate::memory::Ranges;
use crate::{Error, Result};

/// The elements' faces on the boundary; node indices, counter-clockwise seen from outside.
#[derive(Clone, Debug)]
pub enum Faces {
    /// Faces of 4-node tetrahedra.
    Linear(Vec<[u32; 3]>),
    /// Faces of 10-node tetrahedra: corners, then the middles of the edges 01, 12, 20.
    Quadratic(Vec<[u32; 6]>),
}

impl From<Vec<[u32; 3]>> for Faces {
    fn from(faces: Vec<[u32; 3]>) -> Self {
        Faces::Linear(faces)
    }
}

impl From<Vec<[u32; 6]>> for Faces {
    fn from(faces: Vec<[u32; 6]>) -> Self {
        Faces::Quadratic(faces)
    }
}

impl Faces {
    /// Nodes of all faces, one face after the other.
    pub fn as_flattened(&self) -> &[u32] {
        match self {
            Faces::Linear(faces) => faces.as_flattened(),
            Faces::Quadratic(faces) => faces.as_flattened(),
        }
    }

    /// Nodes a face.
    pub fn nodes_per_face(&self) -> usize {
        match self {
            Faces::Linear(_) => 3,
            Faces::Quadratic(_) => 6,
        }
    }

    /// The same faces with other node numbers.
    ///
    /// # Errors
    /// The first node without a number.
    pub fn renumbered(&self, number: impl Fn(u32) -> Option<u32>) -> Result<Self> {
        fn rows<const N: usize>(faces: &[[u32; N]], number: impl Fn(u32) -> Option<u32>) -> Result<Vec<[u32; N]>> {
            let missing = |n| Error::Invalid(format!("a surface face names node {n}, which is not on the surface"));
            let mut renumbered = faces.to_vec();
            for n in renumbered.as_flattened_mut() {
                *n = number(*n).ok_or_else(|| missing(*n))?;
            }
            Ok(renumbered)
        }
        Ok(match self {
            Faces::Linear(faces) => Faces::Linear(rows(faces, number)?),
            Faces::Quadratic(faces) => Faces::Quadratic(rows(faces, number)?),
        })
    }

    /// The flat triangles of all faces, in order.
    fn triangles(&self) -> Vec<[u32; 3]> {
        fn parts<F: Face<N>, const N: usize>(faces: &[[u32; N]]) -> Vec<[u32; 3]> {
            faces.iter().flat_map(|face| F::PARTS.iter().map(|part| part.map(|k| face[k]))).collect()
        }
        match self {
            Faces::Linear(faces) => parts::<Tri3, 3>(faces),
            Faces::Quadratic(faces) => parts::<Tri6, 6>(faces),
        }
    }
}

/// A closed, outward-oriented surface. Indices are local to the surface.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Rest positions, m; row `i` is `mesh.surface_nodes[i]`.
    pub positions: Vec<DVec3>,
    /// The elements' faces, on which contact weights are integrated.
    pub faces: Faces,
    /// The flat triangles of the faces, in order, by which the surface is drawn and searched.
    pub triangles: Vec<[u32; 3]>,
    /// Unit outward normal of each triangle.
    pub normals: Vec<DVec3>,
    /// For each triangle and each of its edges `(i, i+1)`: the triangle across, or `u32::MAX`.
    pub neighbours: Vec<[u32; 3]>,
}

impl Surface {
    /// Adds the memory that a tick reads.
    pub(crate) fn add_memory(&self, ranges: &mut Ranges) {
        ranges.add(&self.positions);
        match &self.faces {
            Faces::Linear(faces) => ranges.add(faces),
            Faces::Quadratic(faces) => ranges.add(faces),
        }
        ranges.add(&self.triangles);
        ranges.add(&self.normals);
        ranges.add(&self.neighbours);
    }

    /// Builds triangles, normals and adjacency.
    ///
    /// # Errors
    /// A face that names a missing node.
    pub fn new(positions: Vec<DVec3>, faces: Faces) -> Result<Self> {
        let count = positions.len();
        if let Some(at) = faces.as_flattened().iter().position(|&n| n as usize >= count) {
            let face = at / faces.nodes_per_face();
            return Err(Error::Invalid(format!("surface face {face} names a node beyond the {count} surface nodes")));
        }
        let triangles = faces.triangles();
        let normals = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|n| positions[n as usize]);
                (b - a).cross(c - a).normalize_or_zero()
            })
            .collect();
        let neighbours = edge_neighbours(&triangles);
        Ok(Self { positions, faces, triangles, normals, neighbours })
    }

    /// Corner positions of triangle `t`, m.
    pub fn corners(&self, t: u32) -> [DVec3; 3] {
        self.triangles[t as usize].map(|n| self.positions[n as usize])
    }
}

/// Whether faces with these normals turn away from each other at an edge `along` which the first has on its left.
pub fn is_convex(first: DVec3, second: DVec3, along: DVec3) -> bool {
    first.cross(second).dot(along) > 0.0
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
