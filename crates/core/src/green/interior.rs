//! Displacements inside the body from those of its surface, for drawing and for strain and stress.
//!
//! The equilibrium of the inner dofs `I` given the surface dofs `S` and the reference loads is `K_II u_I = F_I - K_IS u_S`:
//! the finite element solution itself, for any contact and any supports on the surface. It costs one sparse solve with
//! a factor smaller than that of the body, far too long for the force loop, short enough for a frame.

use faer::Par;

use super::Extension;
use crate::fem::{Supports, SymmetricCsc};
use crate::solver::Factor;
use crate::{Error, Result};

/// Extension of surface displacements to all nodes.
pub struct Interior {
    surface_nodes: Vec<u32>,
    /// Rows `K_IS` by inner dof: start of each, then (surface dof as mesh dof, value).
    coupling_start: Vec<usize>,
    coupling: Vec<(u32, f64)>,
    /// Inner dofs that are free, mesh numbering.
    inner: Vec<u32>,
    /// Reference loads on the inner dofs, N.
    loads: Vec<f64>,
    factor: Option<Factor>,
    dof_count: usize,
}

impl Interior {
    /// Factorises the inner part of the stiffness (all dofs) of a body with these supports, surface nodes (mesh indices,
    /// ascending) and reference loads on all dofs, N (empty for none).
    ///
    /// # Errors
    /// An inner block that is not positive definite: degenerate elements.
    pub fn new(stiffness: &SymmetricCsc, supports: &Supports, surface_nodes: &[u32], loads: &[f64]) -> Result<Self> {
        let dof_count = stiffness.dimension;
        let mut held: Vec<u32> = surface_nodes.iter().flat_map(|&n| [3 * n, 3 * n + 1, 3 * n + 2]).collect();
        held.extend(supports.fixed.iter().copied());
        held.sort_unstable();
        held.dedup();
        let mut interior = Self {
            surface_nodes: surface_nodes.to_vec(),
            coupling_start: vec![0],
            coupling: Vec::new(),
            inner: Vec::new(),
            loads: Vec::new(),
            factor: None,
            dof_count,
        };
        if held.len() == dof_count {
            return Ok(interior);
        }
        let supports = Supports::new(dof_count, held)?;
        interior.factor = Some(Factor::new(stiffness, &supports, Par::rayon(0))?);
        let is_surface = |dof: u32| surface_nodes.binary_search(&(dof / 3)).is_ok();
        for &dof in &supports.free {
            // The matrix is symmetric: the row is the column.
            interior.coupling.extend(stiffness.column(dof as usize).filter(|&(row, _)| is_surface(row)));
            interior.coupling_start.push(interior.coupling.len());
        }
        interior.loads = match loads.is_empty() {
            true => vec![0.0; supports.free.len()],
            false => supports.free.iter().map(|&dof| loads[dof as usize]).collect(),
        };
        interior.inner = supports.free;
        Ok(interior)
    }

    fn extended(&self, fields: &[f64], loaded: bool) -> Vec<f64> {
        let count = fields.len() / (3 * self.surface_nodes.len());
        let mut all = vec![0.0; count * self.dof_count];
        for (field, surface) in all.chunks_exact_mut(self.dof_count).zip(fields.chunks_exact(fields.len() / count)) {
            for (&node, u) in self.surface_nodes.iter().zip(surface.chunks_exact(3)) {
                field[3 * node as usize..3 * node as usize + 3].copy_from_slice(u);
            }
        }
        let Some(factor) = &self.factor else { return all };
        let rows = self.inner.len();
        let mut right = vec![0.0; count * rows];
        for (field, right) in all.chunks_exact(self.dof_count).zip(right.chunks_exact_mut(rows)) {
            self.load(field, loaded, right);
        }
        // One solve for all fields: the factor, which is larger than the caches, is read once.
        let mut memory = factor.solve_scratch(count);
        factor.solve_in_place(&mut right, &mut memory);
        for (field, right) in all.chunks_exact_mut(self.dof_count).zip(right.chunks_exact(rows)) {
            for (&dof, &u) in self.inner.iter().zip(right) {
                field[dof as usize] = u;
            }
        }
        all
    }

    /// `F_I - K_IS u_S`, of a response without `F_I`.
    fn load(&self, field: &[f64], loaded: bool, right: &mut [f64]) {
        for ((range, &own), right) in self.coupling_start.windows(2).zip(&self.loads).zip(right) {
            let row = &self.coupling[range[0]..range[1]];
            let load = if loaded { own } else { 0.0 };
            *right = load - row.iter().map(|&(dof, k)| k * field[dof as usize]).sum::<f64>();
        }
    }
}

impl Extension for Interior {
    fn extend(&self, surface: &[f64]) -> Result<Vec<f64>> {
        let rows = 3 * self.surface_nodes.len();
        if surface.len() != rows {
            let (count, given) = (self.surface_nodes.len(), surface.len());
            return Err(Error::Invalid(format!(
                "displacements of {count} surface nodes are needed, got {given} numbers"
            )));
        }
        Ok(self.extended(surface, true))
    }

    fn extend_responses(&self, fields: &[f64]) -> Result<Vec<f64>> {
        let rows = 3 * self.surface_nodes.len();
        if fields.is_empty() || !fields.len().is_multiple_of(rows) {
            let given = fields.len();
            return Err(Error::Invalid(format!("fields of {rows} surface dofs are needed, got {given} numbers")));
        }
        Ok(self.extended(fields, false))
    }

    fn surface_count(&self) -> usize {
        self.surface_nodes.len()
    }

    fn dof_count(&self) -> usize {
        self.dof_count
    }
}
