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
    /// `U_5` (J/N^5), `U_6` (J/N^6) and `U_7` (J/N^7).
    pub energies: [f64; 3],
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
        elements.third_order(&first, &second, &mut third);
        third.iter_mut().flatten().for_each(|force| *force = -*force);
        self.solve(&mut third, memory);
        let fields: Vec<_> = (0..loads.len()).map(|k| [&first[k][..], &second[k], &third[k]]).collect();
        let at = |((load, fields), energies): ((&PatchLoad, &[&[DVec3]; 3]), [f64; 3])| {
            let displacements = fields.map(|field| load.mean_displacement(field));
            SeriesAt { displacements, energies, middle: fields.map(|field| field[load.middle as usize]) }
        };
        loads.iter().zip(&fields).zip(elements.energies(&fields)).map(at).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::{Isotropic, Supports};
    use crate::mesh::TetMesh;
    use crate::series::coefficients::coefficients;

    /// One tetrahedron on a clamped base, `nu = 0`, pressed at its tip: the stretch `1 - q` is uniform, and `6 F/E = (1/(1 - q) - (1 - q))/2`.
    /// So with `x = 6 F/E` the displacement is `q = 1 + x - sqrt(1 + x^2) = x - x^2/2 + x^4/8 - x^6/16 + ..`.
    #[test]
    fn a_neo_hookean_bar_has_its_closed_form() {
        let modulus = 6.0;
        let nodes = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let problem = Problem {
            mesh: TetMesh::new(nodes, vec![[0, 1, 2, 3]]).expect("a valid mesh"),
            materials: vec![Isotropic::new(modulus, 0.0, 1.0).expect("a valid material")],
            supports: Supports::new(12, (0..9).collect()).expect("valid supports"),
            surface_nodes: (0..4).collect(),
            surface_faces: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]].into(),
            touch: vec![3],
            loads: Vec::new(),
        };
        let body =
            HyperelasticBody::new(Arc::new(problem), Arc::new([StrainLaw::NeoHookean])).expect("a supported body");
        let load = PatchLoad { weights: vec![(3, 1.0)], direction: -DVec3::Z, middle: 3 };
        let [at] = body.series(&[load], &mut body.scratch(1))[..] else { panic!("one load") };
        for (found, expected) in at.displacements.iter().zip([1.0, -0.5, 0.0]) {
            assert!((-found.z - expected).abs() < 1e-12, "{found}");
        }
        for (energy, expected) in at.energies.iter().zip([0.125 / 5.0, 0.0, -0.0625 / 7.0]) {
            assert!((energy - expected).abs() < 1e-12, "{at:?}");
        }
        let fields = coefficients(&at, -DVec3::Z, [0.0, 0.0, 0.0, 0.025]);
        // Less that of a half-space.
        assert!((5.0 * fields[9] - 0.1).abs() < 1e-12, "{fields:?}");
    }
}
