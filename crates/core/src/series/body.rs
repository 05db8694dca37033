//! A hyperelastic body, factorised at rest, and the series of its displacement under loads on patches.

use std::sync::Arc;

use faer::Par;
use faer::dyn_stack::MemBuffer;
use glam::DVec3;

use super::internal::Elements;
use crate::contact::local::StrainLaw;
use crate::fem;
use crate::green::Problem;
use crate::solver::Factor;
use crate::{Error, Result};

/// A body with its factor.
pub struct HyperelasticBody {
    problem: Arc<Problem>,
    laws: Arc<[StrainLaw]>,
    factor: Factor,
}

/// A force of 1 N spread over mesh nodes by weights, along a unit vector.
#[derive(Clone, Debug)]
pub struct PatchLoad {
    /// Mesh nodes and weights, which sum to one.
    pub weights: Vec<(u32, f64)>,
    /// Direction.
    pub direction: DVec3,
    /// Mesh node in its middle.
    pub middle: u32,
}

/// Weighted displacements under a patch by order.
#[derive(Clone, Copy, Debug, Default)]
pub struct SeriesAt {
    /// `q_1` (m/N), `q_2` (m/N^2), `q_3` (m/N^3).
    pub displacements: [DVec3; 3],
    /// `U_5` of 1 N, J/N^5.
    pub fifth: f64,
    /// `U_6` (J/N^6) and `U_7` (J/N^7) of a body that hardens.
    pub last: [f64; 2],
    /// `u_1`, `u_2`, `u_3` in the middle of the patch.
    pub middle: [DVec3; 3],
}

impl HyperelasticBody {
    /// Factorises the body.
    ///
    /// # Errors
    /// A law for each element is missing, or a body that is not held.
    pub fn new(problem: Arc<Problem>, laws: Arc<[StrainLaw]>) -> Result<Self> {
        let Problem { mesh, materials, supports, .. } = &*problem;
        if laws.len() != materials.len() {
            return Err(Error::Invalid(format!("{} laws for {} elements", laws.len(), materials.len())));
        }
        let factor = Factor::new(&fem::stiffness(mesh, materials), supports, Par::rayon(0))?;
        Ok(Self { problem, laws, factor })
    }

    /// Memory of [`Self::series`] for so many loads.
    pub fn scratch(&self, loads: usize) -> MemBuffer {
        self.factor.solve_scratch(loads)
    }

    /// The series under each load.
    pub fn series(&self, loads: &[PatchLoad], memory: &mut MemBuffer) -> Vec<SeriesAt> {
        let Problem { mesh, materials, .. } = &*self.problem;
        let nodes = mesh.nodes.len();
        let elements = Elements { mesh, materials, laws: &self.laws };
        let mut first: Vec<_> = loads.iter().map(|load| load.forces(nodes)).collect();
        self.solve(&mut first, memory);
        let mut second = vec![vec![DVec3::ZERO; nodes]; loads.len()];
        elements.second_order(&first, &mut second);
        second.iter_mut().flatten().for_each(|force| *force = -*force);
        self.solve(&mut second, memory);
        let mut third = vec![vec![DVec3::ZERO; nodes]; loads.len()];
        let fifth = elements.third_order(&first, &second, &mut third);
        third.iter_mut().flatten().for_each(|force| *force = -*force);
        self.solve(&mut third, memory);
        let at = |(k, load): (usize, &PatchLoad)| {
            let fields = [&first[k][..], &second[k], &third[k]];
            let displacements = fields.map(|field| load.mean_displacement(field));
            let hardens = displacements[2].dot(load.direction) < 0.0;
            let last = if hardens { elements.last_orders(fields) } else { [0.0; 2] };
            SeriesAt { displacements, fifth: fifth[k], last, middle: fields.map(|field| field[load.middle as usize]) }
        };
        loads.iter().enumerate().map(at).collect()
    }

    /// Replaces forces by the displacements under them.
    fn solve(&self, fields: &mut [Vec<DVec3>], memory: &mut MemBuffer) {
        let rows = self.factor.dimension();
        let mut right = Vec::with_capacity(rows * fields.len());
        for field in &*fields {
            let dofs: &[f64] = bytemuck::cast_slice(field);
            right.extend(self.problem.supports.free.iter().map(|&dof| dofs[dof as usize]));
        }
        self.factor.solve_in_place(&mut right, memory);
        for (field, solution) in fields.iter_mut().zip(right.chunks_exact(rows)) {
            let dofs: &mut [f64] = bytemuck::cast_slice_mut(field);
            dofs.fill(0.0);
            for (&dof, &value) in self.problem.supports.free.iter().zip(solution) {
                dofs[dof as usize] = value;
            }
        }
    }
}

impl PatchLoad {
    fn forces(&self, nodes: usize) -> Vec<DVec3> {
        let mut forces = vec![DVec3::ZERO; nodes];
        for &(node, weight) in &self.weights {
            forces[node as usize] += self.direction * weight;
        }
        forces
    }

    fn mean_displacement(&self, field: &[DVec3]) -> DVec3 {
        self.weights.iter().map(|&(node, weight)| field[node as usize] * weight).sum()
    }
}
