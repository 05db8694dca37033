//! The content key: a hash of everything that determines a Green's function.

use super::columns::Problem;
use super::precision::Precision;

/// Version of the store's layout; part of the key, so that an old file is recomputed, never misread.
pub const FORMAT_VERSION: u32 = 3;

/// Hex BLAKE3 hash of mesh, materials, supports, loads, touch region, element, precision and format version.
pub fn content_key(problem: &Problem, precision: Precision) -> String {
    let element = problem.mesh.tets.element_name();
    let mut hash = blake3::Hasher::new();
    hash.update(format!("palpate green {FORMAT_VERSION} {element} {}", precision.name()).as_bytes());
    let mut section = |bytes: &[u8]| {
        hash.update(&(bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    };
    section(bytemuck::cast_slice(&problem.mesh.nodes));
    section(bytemuck::cast_slice(problem.mesh.tets.as_flattened()));
    for material in &problem.materials {
        // Density does not enter the static answer.
        section(bytemuck::cast_slice(&[material.youngs_modulus, material.poissons_ratio]));
    }
    section(bytemuck::cast_slice(&problem.supports.fixed));
    section(bytemuck::cast_slice(&problem.surface_nodes));
    section(bytemuck::cast_slice(&problem.touch));
    if !problem.loads.is_empty() {
        section(bytemuck::cast_slice(&problem.loads));
    }
    hash.finalize().to_hex().to_string()
}
