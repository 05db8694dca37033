//! A store: the Green's function of a body.
#![allow(unsafe_code)] // called from C with raw pointers
#![allow(clippy::missing_safety_doc)] // palpate.h states at its top what holds for all pointers

use std::ffi::c_char;
use std::sync::Arc;

use palpate_core::green::GreensFunction;
use palpate_core::mesh::Surface;
use palpate_scene::moduli_of_store;

use crate::arguments::{array_mut, free_handle, path, require_count, shared, store_handle};
use crate::status::{Outcome, Status, catching_panics};
use crate::versioned_struct::{self, VersionedStruct};

/// A Green's function in memory. It never changes: any threads may use it at the same time.
pub struct Store {
    pub(crate) green: Arc<GreensFunction>,
}

/// What a store holds. Set struct_size before it is filled.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct StoreInfo {
    /// sizeof(palpate_store_info).
    pub struct_size: u32,
    /// Nodes on the surface.
    pub nodes: u32,
    /// Triangles that the surface is drawn by.
    pub triangles: u32,
    /// Nodes that may be touched.
    pub touchable_nodes: u32,
    /// Lower corner of the box around the body at rest, m.
    pub lowest: [f64; 3],
    /// Upper corner of that box, m.
    pub highest: [f64; 3],
    /// Young's modulus, Pa, if the whole body has one and no loads; else 0.
    pub youngs_modulus: f64,
    /// Estimated relative error of the force on a pressed patch.
    pub touch_error: f64,
    /// Whether the elastic constants at the surface are known, as the local contact law needs them.
    pub knows_surface: u32,
    /// 0.
    pub reserved: u32,
}

impl Default for StoreInfo {
    fn default() -> Self {
        versioned_struct::zeroed()
    }
}

// SAFETY: numbers only; the size comes first.
unsafe impl VersionedStruct for StoreInfo {
    const NAME: &str = "palpate_store_info";
    const FIRST_SIZE: usize = 88;
}

/// Reads a store (.palpate) and verifies every block of it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_store_load(file: *const c_char, store: *mut *mut Store) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointer.
        let file = unsafe { path(file, "file") }?;
        let green = Arc::new(GreensFunction::load(file, None)?);
        // SAFETY: the caller's pointer.
        unsafe { store_handle(Store { green }, store, "store") }
    })
}

/// Frees a store; bodies made of it keep what they need. Null is nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_store_free(store: *mut Store) {
    // SAFETY: the caller's pointer.
    catching_panics(|| unsafe { free_handle(store) });
}

/// Says what a store holds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_store_get_info(store: *const Store, info: *mut StoreInfo) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointer.
        let green = &unsafe { shared(store, "store") }?.green;
        let positions = &green.surface.positions;
        let first = positions.first().copied().unwrap_or_default();
        let (lowest, highest) = positions.iter().fold((first, first), |(l, h), &p| (l.min(p), h.max(p)));
        let filled = StoreInfo {
            nodes: positions.len() as u32,
            triangles: green.surface.triangles.len() as u32,
            touchable_nodes: green.touch.len() as u32,
            lowest: lowest.to_array(),
            highest: highest.to_array(),
            youngs_modulus: green.youngs_modulus.unwrap_or(0.0),
            touch_error: green.accuracy.touch,
            knows_surface: u32::from(moduli_of_store(green)?.is_some()),
            ..StoreInfo::default()
        };
        // SAFETY: the caller's pointer.
        unsafe { versioned_struct::write(&filled, info) }
    })
}

/// Rest positions of the surface nodes, x y z of each, m, in the body's own frame.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_store_get_positions(store: *const Store, positions: *mut f64, nodes: usize) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointer.
        let rest = &unsafe { shared(store, "store") }?.green.surface.positions;
        require_count("nodes", nodes, rest.len())?;
        // SAFETY: the caller's pointer, to `nodes` of three numbers.
        let out = unsafe { array_mut(positions, 3 * nodes, "positions") }?;
        out.iter_mut().zip(rest.iter().flat_map(|p| p.to_array())).for_each(|(to, x)| *to = x);
        Ok(())
    })
}

/// Triangles that the surface is drawn by, outward, three numbers of surface nodes each.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_store_get_triangles(store: *const Store, nodes: *mut u32, triangles: usize) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointer.
        let surface = &unsafe { shared(store, "store") }?.green.surface;
        // SAFETY: the caller's pointer.
        unsafe { put_triangles(surface, nodes, triangles) }
    })
}

/// Writes the triangles of a surface.
///
/// # Safety
/// The pointer is null or points to `triangles` of three numbers.
pub unsafe fn put_triangles(surface: &Surface, nodes: *mut u32, triangles: usize) -> Outcome {
    require_count("triangles", triangles, surface.triangles.len())?;
    // SAFETY: the caller's.
    unsafe { array_mut(nodes, 3 * triangles, "nodes") }?.copy_from_slice(surface.triangles.as_flattened());
    Ok(())
}
