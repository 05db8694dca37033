//! Measure of strain by the elements of a packed body.

use std::sync::Arc;

use glam::DVec3;
use palpate_core::fem::{Isotropic, Supports, stiffness};
use palpate_core::green::{GreensFunction, Interior};
use palpate_core::mesh::{TetMesh, Tets};
use palpate_core::strain::{GradientOperator, StrainMeasure};
use palpate_core::{Error, Result};
use safetensors::tensor::Dtype;

use super::arrays::Arrays;

/// By the elements, whose stiffness is assembled and factorised here; of a body of which only the store was there, by its
/// surface.
pub fn strain(arrays: &Arrays, green: &GreensFunction) -> Result<StrainMeasure> {
    let Some(nodes) = arrays.optional::<[f64; 3]>("nodes", Dtype::F64, 3)? else {
        return Ok(StrainMeasure::of_surface(&green.surface));
    };
    let nodes: Vec<DVec3> = nodes.into_iter().map(DVec3::from).collect();
    let tets = match arrays.width("tets")? {
        10 => Tets::Quadratic(arrays.numbers("tets", Dtype::U32, 10)?),
        _ => Tets::Linear(arrays.numbers("tets", Dtype::U32, 4)?),
    };
    let mesh = TetMesh::new(nodes, tets)?;
    let materials: Vec<[f64; 3]> = arrays.numbers("materials", Dtype::F64, 3)?;
    if materials.len() != mesh.tets.len() {
        return Err(Error::Invalid(format!("{} materials for {} elements", materials.len(), mesh.tets.len())));
    }
    let isotropic = |[youngs, poissons, density]: [f64; 3]| Isotropic::new(youngs, poissons, density);
    let materials = materials.into_iter().map(isotropic).collect::<Result<Vec<_>>>()?;
    let supports = Supports::new(3 * mesh.nodes.len(), green.fixed_dofs.clone())?;
    let matrix = stiffness(&mesh, &materials);
    let interior = Arc::new(Interior::new(&matrix, &supports, &green.surface_nodes, &green.loads)?);
    let start: Vec<u64> = arrays.numbers("gradient_start", Dtype::U64, 1)?;
    let gradients = GradientOperator::from_parts(
        start.into_iter().map(|entry| entry as usize).collect(),
        arrays.numbers("gradient_nodes", Dtype::U32, 1)?,
        arrays.numbers("gradients", Dtype::F64, 3)?,
        mesh.nodes.len(),
    )?;
    Ok(StrainMeasure::of_gradients(gradients, interior))
}
