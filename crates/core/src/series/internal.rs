//! Parts of the internal forces by order, summed over the elements.

use glam::{DMat3, DVec3};

use super::stress::{Gradients, energy, stress};
use super::truncated::DEGREE;
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
    /// `r_2` of fields `u_1`, added to the `forces` of each, N.
    pub fn second_order(&self, first: &[Vec<DVec3>], forces: &mut [Vec<DVec3>]) {
        let fields: Vec<_> = first.iter().map(|first| [&first[..], &[], &[]]).collect();
        self.each_stress(&fields, |load, [_, _, second], at| at.add_forces(second, &mut forces[load]));
    }

    /// `r_3` of fields `u_1`, `u_2`, added to the `forces` of each, N.
    pub fn third_order(&self, first: &[Vec<DVec3>], second: &[Vec<DVec3>], forces: &mut [Vec<DVec3>]) {
        let fields: Vec<_> = first.iter().zip(second).map(|(first, second)| [&first[..], &second[..], &[]]).collect();
        self.each_stress(&fields, |load, [_, _, _, third], at| at.add_forces(third, &mut forces[load]));
    }

    /// `U_5`, `U_6` and `U_7` of fields `u_1`, `u_2`, `u_3`: the whole energy is stationary, so that the error of a sum of three orders,
    /// of order 4, changes it in order 8. Of the orders 5 to 7 it is that of the strain.
    pub fn energies(&self, fields: &[[&[DVec3]; DEGREE]]) -> Vec<[f64; 3]> {
        let mut found = vec![[0.0; 3]; fields.len()];
        self.each_gradient(fields, |load, element, gradients, at| {
            let orders: [f64; 8] = energy(&self.laws[element], &self.materials[element], gradients);
            found[load].iter_mut().zip(&orders[5..]).for_each(|(found, order)| *found -= at.weight * order);
        });
        found
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

    /// Calls `use_stress` at each point of quadrature of elements that are not linear, for each load, by its rank, with the first `O`
    /// coefficients of the stress. An empty field is zero.
    fn each_stress<const O: usize>(
        &self,
        fields: &[[&[DVec3]; DEGREE]],
        mut use_stress: impl FnMut(usize, &[DMat3; O], &At<'_>),
    ) {
        self.each_gradient(fields, |load, element, gradients, at| {
            if self.laws[element] != StrainLaw::Linear {
                use_stress(load, &stress(&self.laws[element], &self.materials[element], gradients), at);
            }
        });
    }

    /// Calls `use_gradients` at each point of quadrature for each load, by its rank and the element's, with the displacement gradients.
    fn each_gradient(
        &self,
        fields: &[[&[DVec3]; DEGREE]],
        use_gradients: impl FnMut(usize, usize, &Gradients, &At<'_>),
    ) {
        match &self.mesh.tets {
            Tets::Linear(tets) => self.each_gradient_of::<Tet4, 4>(tets, fields, use_gradients),
            Tets::Quadratic(tets) => self.each_gradient_of::<Tet10, 10>(tets, fields, use_gradients),
        }
    }

    fn each_gradient_of<E: Tetrahedron<N>, const N: usize>(
        &self,
        tets: &[[u32; N]],
        fields: &[[&[DVec3]; DEGREE]],
        mut use_gradients: impl FnMut(usize, usize, &Gradients, &At<'_>),
    ) {
        for (element, nodes) in tets.iter().enumerate() {
            let places = positions(&self.mesh.nodes, nodes);
            for point in E::stiffness_rule(&places) {
                let (slopes, weight) = gradients::<E, N>(&places, point);
                let at = At { nodes, slopes: &slopes, weight };
                for (load, &fields) in fields.iter().enumerate() {
                    use_gradients(load, element, &fields.map(|field| at.gradient(field)), &at);
                }
            }
        }
    }
}

/// A point of quadrature: the element's nodes, the gradients of their shape functions, and the point's volume.
struct At<'a> {
    nodes: &'a [u32],
    slopes: &'a [DVec3],
    weight: f64,
}

impl At<'_> {
    fn gradient(&self, field: &[DVec3]) -> DMat3 {
        if field.is_empty() {
            return DMat3::ZERO;
        }
        self.nodes.iter().zip(self.slopes).map(|(&node, &slope)| outer(field[node as usize], slope)).sum()
    }

    /// Adds the forces of a stress to those of the element's nodes.
    fn add_forces(&self, stress: &DMat3, forces: &mut [DVec3]) {
        let weighted = *stress * self.weight;
        for (&node, &slope) in self.nodes.iter().zip(self.slopes) {
            forces[node as usize] += weighted * slope;
        }
    }
}
