//! Parts of the internal forces by order, summed over the elements.

use glam::{DMat3, DVec3};

use super::stress::{Gradients, stress};
use super::truncated::{DEGREE, contraction};
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
        self.each_stress(&fields, |load, [_, _, second], _, at| at.add_forces(second, &mut forces[load]));
    }

    /// `r_3` of fields `u_1`, `u_2`, added to the `forces` of each, N; returns `U_5` of each.
    pub fn third_order(&self, first: &[Vec<DVec3>], second: &[Vec<DVec3>], forces: &mut [Vec<DVec3>]) -> Vec<f64> {
        let fields: Vec<_> = first.iter().zip(second).map(|(first, second)| [&first[..], &second[..], &[]]).collect();
        let mut fifth = vec![0.0; first.len()];
        self.each_stress(&fields, |load, [_, _, _, third, fourth], [h1, h2, _], at| {
            at.add_forces(third, &mut forces[load]);
            fifth[load] -= at.weight * (contraction(fourth, h1) + 2.0 * contraction(third, h2)) / 5.0;
        });
        fifth
    }

    /// `U_6` of fields `u_1`, `u_2`, `u_3`.
    pub fn sixth_order(&self, fields: [&[DVec3]; 3]) -> f64 {
        let mut found = 0.0;
        self.each_stress(&[fields], |_, orders: &[DMat3; 6], [h1, h2, _], at| {
            found -= at.weight * (contraction(&orders[5], h1) + 2.0 * contraction(&orders[4], h2)) / 6.0;
        });
        found
    }

    /// `U_6` and `U_7` of fields `u_1`, `u_2`, `u_3`.
    pub fn last_orders(&self, fields: [&[DVec3]; 3]) -> [f64; 2] {
        let mut found = [0.0; 2];
        self.each_stress(&[fields], |_, orders: &[DMat3; 7], gradients, at| {
            let work = |order: usize, by: usize| by as f64 * contraction(&orders[order], gradients[by - 1]);
            found[0] -= at.weight * (work(5, 1) + work(4, 2)) / 6.0;
            found[1] -= at.weight * (work(6, 1) + work(5, 2) + work(4, 3)) / 7.0;
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

    /// Calls `use_stress` at each point of quadrature for each load, by its rank, with the first `O` coefficients of the stress and the
    /// displacement gradients. An empty field is zero.
    fn each_stress<const O: usize>(
        &self,
        fields: &[[&[DVec3]; DEGREE]],
        use_stress: impl FnMut(usize, &[DMat3; O], [&DMat3; DEGREE], &At<'_>),
    ) {
        match &self.mesh.tets {
            Tets::Linear(tets) => self.each_stress_of::<Tet4, 4, O>(tets, fields, use_stress),
            Tets::Quadratic(tets) => self.each_stress_of::<Tet10, 10, O>(tets, fields, use_stress),
        }
    }

    fn each_stress_of<E: Tetrahedron<N>, const N: usize, const O: usize>(
        &self,
        tets: &[[u32; N]],
        fields: &[[&[DVec3]; DEGREE]],
        mut use_stress: impl FnMut(usize, &[DMat3; O], [&DMat3; DEGREE], &At<'_>),
    ) {
        for (e, nodes) in tets.iter().enumerate() {
            if self.laws[e] == StrainLaw::Linear {
                continue;
            }
            let places = positions(&self.mesh.nodes, nodes);
            for point in E::stiffness_rule(&places) {
                let (slopes, weight) = gradients::<E, N>(&places, point);
                let at = At { nodes, slopes: &slopes, weight };
                for (load, &fields) in fields.iter().enumerate() {
                    let by_order: Gradients = fields.map(|field| at.gradient(field));
                    let orders = stress(&self.laws[e], &self.materials[e], &by_order);
                    use_stress(load, &orders, by_order.each_ref(), &at);
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
