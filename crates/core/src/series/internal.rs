//! Parts of the internal forces by order, summed over the elements.

use glam::{DMat3, DVec3};

use super::stress::{Gradients, stress};
use super::truncated::contraction;
use crate::contact::local::StrainLaw;
use crate::element::{Tet4, Tet10, Tetrahedron, gradients};
use crate::fem::Isotropic;
use crate::mesh::{TetMesh, Tets, positions};
use crate::tensor::outer;

/// Mesh and materials of each element.
#[derive(Clone, Copy)]
pub struct Elements<'a> {
    pub mesh: &'a TetMesh,
    pub materials: &'a [Isotropic],
    pub laws: &'a [StrainLaw],
}

impl Elements<'_> {
    /// `r_2` of the field `u_1`, added to `forces`, N.
    pub fn second_order(&self, first: &[DVec3], forces: &mut [DVec3]) {
        self.each_stress([first, &[]], |orders, _, weight, nodes, slopes| {
            add_forces(&orders[2], weight, (nodes, slopes), forces);
        });
    }

    /// `r_3` of the fields `u_1`, `u_2`, added to `forces`, N; returns `U_5`.
    pub fn third_order(&self, first: &[DVec3], second: &[DVec3], forces: &mut [DVec3]) -> f64 {
        let mut fifth = 0.0;
        self.each_stress([first, second], |orders, [h1, h2], weight, nodes, slopes| {
            add_forces(&orders[3], weight, (nodes, slopes), forces);
            fifth -= weight * (contraction(&orders[4], h1) + 2.0 * contraction(&orders[3], h2)) / 5.0;
        });
        fifth
    }

    /// Points of quadrature, at each of which a series is summed.
    pub fn points(&self) -> usize {
        fn of<E: Tetrahedron<N>, const N: usize>(nodes: &[DVec3], tets: &[[u32; N]], laws: &[StrainLaw]) -> usize {
            let summed = tets.iter().zip(laws).filter(|(_, law)| **law != StrainLaw::Linear);
            summed.map(|(tet, _)| E::stiffness_rule(&positions(nodes, tet)).len()).sum()
        }
        match &self.mesh.tets {
            Tets::Linear(tets) => of::<Tet4, 4>(&self.mesh.nodes, tets, self.laws),
            Tets::Quadratic(tets) => of::<Tet10, 10>(&self.mesh.nodes, tets, self.laws),
        }
    }

    /// Calls `use_stress` at each point of quadrature with the stress by order, the displacement gradients, the point's volume,
    /// the element's nodes and the gradients of their shape functions. An empty field is zero.
    fn each_stress(&self, fields: [&[DVec3]; 2], use_stress: impl FnMut(&[DMat3], [&DMat3; 2], f64, &[u32], &[DVec3])) {
        match &self.mesh.tets {
            Tets::Linear(tets) => self.each_stress_of::<Tet4, 4>(tets, fields, use_stress),
            Tets::Quadratic(tets) => self.each_stress_of::<Tet10, 10>(tets, fields, use_stress),
        }
    }

    fn each_stress_of<E: Tetrahedron<N>, const N: usize>(
        &self,
        tets: &[[u32; N]],
        fields: [&[DVec3]; 2],
        mut use_stress: impl FnMut(&[DMat3], [&DMat3; 2], f64, &[u32], &[DVec3]),
    ) {
        for (e, nodes) in tets.iter().enumerate() {
            if self.laws[e] == StrainLaw::Linear {
                continue;
            }
            let places = positions(&self.mesh.nodes, nodes);
            for point in E::stiffness_rule(&places) {
                let (slopes, weight) = gradients::<E, N>(&places, point);
                let gradient = |field: &[DVec3]| -> DMat3 {
                    if field.is_empty() {
                        return DMat3::ZERO;
                    }
                    nodes.iter().zip(&slopes).map(|(&node, &slope)| outer(field[node as usize], slope)).sum()
                };
                let [h1, h2] = fields.map(gradient);
                let by_order: Gradients = [h1, h2, DMat3::ZERO, DMat3::ZERO];
                let orders = stress(&self.laws[e], &self.materials[e], &by_order);
                use_stress(&orders, [&h1, &h2], weight, nodes, &slopes);
            }
        }
    }
}

/// Adds the forces of a stress at one point to those of the element's nodes.
fn add_forces(stress: &DMat3, weight: f64, (nodes, slopes): (&[u32], &[DVec3]), forces: &mut [DVec3]) {
    let weighted = *stress * weight;
    for (&node, &slope) in nodes.iter().zip(slopes) {
        forces[node as usize] += weighted * slope;
    }
}
