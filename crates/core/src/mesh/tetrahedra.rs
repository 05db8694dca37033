//! Nodes and the tetrahedra between them.

use glam::DVec3;
use rayon::prelude::*;

use crate::element::{Tet4, Tet10, determinant_range, volume};
use crate::{Error, Result};

/// Node indices of each element, in VTK's order.
#[derive(Clone, Debug)]
pub enum Tets {
    /// 4-node tetrahedra; `(b-a) x (c-a) . (d-a) > 0`.
    Linear(Vec<[u32; 4]>),
    /// 10-node tetrahedra: corners, then the middles of the edges 01, 12, 02, 03, 13, 23.
    Quadratic(Vec<[u32; 10]>),
}

/// Nodes (m) and positively oriented tetrahedra.
#[derive(Clone, Debug)]
pub struct TetMesh {
    /// Rest positions, m.
    pub nodes: Vec<DVec3>,
    /// The elements.
    pub tets: Tets,
}

impl From<Vec<[u32; 4]>> for Tets {
    fn from(tets: Vec<[u32; 4]>) -> Self {
        Tets::Linear(tets)
    }
}

impl From<Vec<[u32; 10]>> for Tets {
    fn from(tets: Vec<[u32; 10]>) -> Self {
        Tets::Quadratic(tets)
    }
}

impl Tets {
    /// Number of elements.
    pub fn len(&self) -> usize {
        match self {
            Tets::Linear(tets) => tets.len(),
            Tets::Quadratic(tets) => tets.len(),
        }
    }

    /// Whether there is no element.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Name of the element, part of the content key.
    pub fn element_name(&self) -> &'static str {
        match self {
            Tets::Linear(_) => "tet4",
            Tets::Quadratic(_) => "tet10",
        }
    }

    /// Nodes of all elements, one element after the other.
    pub fn as_flattened(&self) -> &[u32] {
        match self {
            Tets::Linear(tets) => tets.as_flattened(),
            Tets::Quadratic(tets) => tets.as_flattened(),
        }
    }

    /// Nodes an element.
    pub fn nodes_per_element(&self) -> usize {
        match self {
            Tets::Linear(_) => 4,
            Tets::Quadratic(_) => 10,
        }
    }

    /// Refuses an element that names a node beyond `count`.
    fn check_indices(&self, count: usize) -> Result<()> {
        match self.as_flattened().iter().position(|&n| n as usize >= count) {
            Some(at) => Err(Error::Invalid(format!(
                "tetrahedron {} names a node beyond the {count} nodes",
                at / self.nodes_per_element()
            ))),
            None => Ok(()),
        }
    }

    /// Least and largest determinant of the map from the reference element, over nodes and points of quadrature, of each
    /// element, m^3.
    ///
    /// # Errors
    /// An index out of range.
    pub fn determinant_ranges(&self, nodes: &[DVec3]) -> Result<Vec<[f64; 2]>> {
        self.check_indices(nodes.len())?;
        Ok(match self {
            Tets::Linear(tets) => of_each(nodes, tets, determinant_range::<Tet4, 4>),
            Tets::Quadratic(tets) => of_each(nodes, tets, determinant_range::<Tet10, 10>),
        })
    }

    /// Volume of each element, m^3.
    ///
    /// # Errors
    /// An index out of range.
    pub fn volumes(&self, nodes: &[DVec3]) -> Result<Vec<f64>> {
        self.check_indices(nodes.len())?;
        Ok(match self {
            Tets::Linear(tets) => of_each(nodes, tets, volume::<Tet4, 4>),
            Tets::Quadratic(tets) => of_each(nodes, tets, volume::<Tet10, 10>),
        })
    }
}

impl TetMesh {
    /// Checks indices and orientation.
    ///
    /// # Errors
    /// An index out of range, a coordinate that is not finite, an element without volume or inverted anywhere, each by
    /// index.
    pub fn new(nodes: Vec<DVec3>, tets: impl Into<Tets>) -> Result<Self> {
        let tets = tets.into();
        if let Some(i) = nodes.iter().position(|p| !p.is_finite()) {
            return Err(Error::Invalid(format!("node {i} has a coordinate that is not finite")));
        }
        if let Some(e) = tets.determinant_ranges(&nodes)?.iter().position(|&[least, _]| least <= 0.0) {
            return Err(Error::Invalid(format!("tetrahedron {e} has no volume, or is inverted")));
        }
        Ok(Self { nodes, tets })
    }
}

/// Positions of an element's nodes, m.
pub fn positions<const N: usize>(nodes: &[DVec3], tet: &[u32; N]) -> [DVec3; N] {
    tet.map(|n| nodes[n as usize])
}

fn of_each<T: Send, const N: usize>(
    nodes: &[DVec3],
    tets: &[[u32; N]],
    measure: impl Fn(&[DVec3; N]) -> T + Sync,
) -> Vec<T> {
    tets.par_iter().map(|tet| measure(&positions(nodes, tet))).collect()
}

/// Elements around each node, as offsets and a flat list of `(element, local node)`.
pub fn node_elements<const N: usize>(node_count: usize, tets: &[[u32; N]]) -> (Vec<usize>, Vec<(u32, u8)>) {
    let mut start = vec![0usize; node_count + 1];
    for &n in tets.as_flattened() {
        start[n as usize + 1] += 1;
    }
    for i in 1..start.len() {
        start[i] += start[i - 1];
    }
    let mut cursor = start.clone();
    let mut list = vec![(0, 0); start[node_count]];
    for (e, tet) in tets.iter().enumerate() {
        for (local, &n) in tet.iter().enumerate() {
            list[cursor[n as usize]] = (e as u32, local as u8);
            cursor[n as usize] += 1;
        }
    }
    (start, list)
}
