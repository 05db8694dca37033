//! 4-node tetrahedra: connectivity and the gradients of the linear shape functions.

use glam::DVec3;

use crate::{Error, Result};

/// Nodes (m) and positively oriented 4-node tetrahedra.
#[derive(Clone, Debug)]
pub struct TetMesh {
    /// Rest positions, m.
    pub nodes: Vec<DVec3>,
    /// Node indices of each element; `(b-a) x (c-a) . (d-a) > 0`.
    pub tets: Vec<[u32; 4]>,
}

impl TetMesh {
    /// Checks indices and orientation.
    ///
    /// # Errors
    /// An index out of range, a coordinate that is not finite, an element without positive volume, each by index.
    pub fn new(nodes: Vec<DVec3>, tets: Vec<[u32; 4]>) -> Result<Self> {
        if let Some(i) = nodes.iter().position(|p| !p.is_finite()) {
            return Err(Error::Invalid(format!("node {i} has a coordinate that is not finite")));
        }
        let count = nodes.len();
        if let Some(e) = tets.iter().position(|t| t.iter().any(|&n| n as usize >= count)) {
            return Err(Error::Invalid(format!("tetrahedron {e} names a node beyond the {count} nodes")));
        }
        let mesh = Self { nodes, tets };
        if let Some(e) = (0..mesh.tets.len()).find(|&e| mesh.volume(e) <= 0.0) {
            return Err(Error::Invalid(format!("tetrahedron {e} has no positive volume")));
        }
        Ok(mesh)
    }

    /// Corner positions of element `e`, m.
    pub fn corners(&self, e: usize) -> [DVec3; 4] {
        self.tets[e].map(|n| self.nodes[n as usize])
    }

    /// Volume of element `e`, m^3.
    pub fn volume(&self, e: usize) -> f64 {
        let [a, b, c, d] = self.corners(e);
        (b - a).cross(c - a).dot(d - a) / 6.0
    }

    /// Gradients of the four linear shape functions of element `e`, 1/m.
    ///
    /// `grad N_i` is the inward area vector of the face opposite node `i` over three volumes.
    pub fn shape_gradients(&self, e: usize) -> [DVec3; 4] {
        let [a, b, c, d] = self.corners(e);
        let (u, v, w) = (b - a, c - a, d - a);
        let six_volumes = u.cross(v).dot(w);
        let (gb, gc, gd) = (v.cross(w) / six_volumes, w.cross(u) / six_volumes, u.cross(v) / six_volumes);
        [-(gb + gc + gd), gb, gc, gd]
    }

    /// Elements around each node, as offsets and a flat list of `(element, local corner)`.
    pub fn node_elements(&self) -> (Vec<usize>, Vec<(u32, u8)>) {
        let mut start = vec![0usize; self.nodes.len() + 1];
        for &n in self.tets.iter().flatten() {
            start[n as usize + 1] += 1;
        }
        for i in 1..start.len() {
            start[i] += start[i - 1];
        }
        let mut cursor = start.clone();
        let mut list = vec![(0, 0); start[self.nodes.len()]];
        for (e, tet) in self.tets.iter().enumerate() {
            for (corner, &n) in tet.iter().enumerate() {
                list[cursor[n as usize]] = (e as u32, corner as u8);
                cursor[n as usize] += 1;
            }
        }
        (start, list)
    }
}
