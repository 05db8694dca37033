//! The reference problem: a supported body, and the key of its Green's function.

use glam::DVec3;

use crate::Result;
use crate::fem::{Isotropic, Supports};
use crate::green::key::{FORMAT_VERSION, add_sections};
use crate::green::precision::Precision;
use crate::mesh::{Faces, Surface, TetMesh};

/// The reference problem (paper 3.1): a supported body, with its own loads if it has any.
pub struct Problem {
    /// The body.
    pub mesh: TetMesh,
    /// One material an element.
    pub materials: Vec<Isotropic>,
    /// Its supports.
    pub supports: Supports,
    /// Mesh indices of the surface nodes, ascending.
    pub surface_nodes: Vec<u32>,
    /// Outward faces of the surface, mesh indices.
    pub surface_faces: Faces,
    /// Touchable surface nodes as ascending ranks in `surface_nodes`.
    pub touch: Vec<u32>,
    /// Reference loads on all dofs, N; empty for none.
    pub loads: Vec<f64>,
}

impl Problem {
    /// Content key (hexadecimal, BLAKE3) of the Green's function with this precision (`None`: chosen by the body): mesh, materials, supports,
    /// loads, touch region.
    ///
    /// The order of the columns and the width of the blocks are no part of it. Both depend on the nodes requested first and on the
    /// available memory, and change the last bits only, below the stated accuracy. Otherwise a store of hours would be rejected for
    /// another order of touching.
    pub fn key(&self, precision: Option<Precision>) -> String {
        self.key_of_touch(precision).of(&self.touch)
    }

    /// The keys of this problem for any touch region.
    pub fn key_of_touch(&self, precision: Option<Precision>) -> TouchKey {
        let (element, precision) = (self.mesh.tets.element_name(), precision.map_or("chosen", Precision::name));
        let mut key = blake3::Hasher::new();
        key.update(format!("palpate green {FORMAT_VERSION} {element} {precision}").as_bytes());
        let mesh: [&[u8]; 2] =
            [bytemuck::cast_slice(&self.mesh.nodes), bytemuck::cast_slice(self.mesh.tets.as_flattened())];
        add_sections(&mut key, mesh);
        for material in &self.materials {
            // Density does not enter the static answer.
            let constants = [material.youngs_modulus, material.poissons_ratio];
            add_sections(&mut key, [bytemuck::cast_slice(&constants)]);
        }
        add_sections(&mut key, [&self.supports.fixed, &self.surface_nodes].map(|part| bytemuck::cast_slice(part)));
        TouchKey { before: key, loads: self.loads.clone() }
    }

    /// Rest positions of the surface nodes, m.
    pub fn surface_positions(&self) -> Vec<DVec3> {
        self.surface_nodes.iter().map(|&n| self.mesh.nodes[n as usize]).collect()
    }

    /// The surface in its own numbering.
    ///
    /// # Errors
    /// Faces of nodes that are not on the surface.
    pub fn surface(&self) -> Result<Surface> {
        let local = |n: u32| self.surface_nodes.binary_search(&n).ok().map(|i| i as u32);
        Surface::new(self.surface_positions(), self.surface_faces.renumbered(local)?)
    }

    /// Dof of every row: the surface's, then the supported ones inside.
    pub fn row_dofs(&self) -> Vec<u32> {
        let mut dofs: Vec<u32> = self.surface_nodes.iter().flat_map(|&n| [3 * n, 3 * n + 1, 3 * n + 2]).collect();
        let inside = |d: &u32| self.surface_nodes.binary_search(&(d / 3)).is_err();
        dofs.extend(self.supports.fixed.iter().copied().filter(inside));
        dofs
    }

    /// The modulus of the whole body if it only scales forces: not under loads, for they do not scale with it.
    pub fn common_youngs_modulus(&self) -> Option<f64> {
        if !self.loads.is_empty() {
            return None;
        }
        let first = self.materials.first()?.youngs_modulus;
        self.materials.iter().all(|m| m.youngs_modulus == first).then_some(first)
    }
}

/// Data of the key of a problem, without its touch region.
pub struct TouchKey {
    before: blake3::Hasher,
    loads: Vec<f64>,
}

impl TouchKey {
    /// The key with these touchable nodes, ascending ranks among the surface nodes.
    pub fn of(&self, touch: &[u32]) -> String {
        let mut key = self.before.clone();
        add_sections(&mut key, [bytemuck::cast_slice(touch)]);
        if !self.loads.is_empty() {
            add_sections(&mut key, [bytemuck::cast_slice(&self.loads)]);
        }
        key.finalize().to_hex().to_string()
    }
}
