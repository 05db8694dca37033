//! A scene: bodies and tools, put together or read.
#![allow(unsafe_code)] // called from C with raw pointers
#![allow(clippy::missing_safety_doc)] // palpate.h states at its top what holds for all pointers

use std::ffi::c_char;
use std::sync::atomic::{AtomicU64, Ordering};

use palpate_core::contact::Moduli;
use palpate_scene::{Body, BodyId, Scene, ToolId, placement};

use crate::arguments::{exclusive, free_handle, path, shared, store_handle};
use crate::options::{BodyOptions, DeviceOptions, SceneOptions, ToolOptions};
use crate::status::{Outcome, Refusal, Status, catching_panics};
use crate::store::Store;
use crate::versioned_struct;

/// How far from one the length of an orientation may be.
const UNIT_LENGTH: f64 = 1e-6;

/// What to touch, and with what. One thread at a time may use it.
pub struct SceneGraph {
    pub(crate) scene: Scene,
    /// Of this scene alone, for as long as the program runs.
    pub(crate) number: u64,
}

impl SceneGraph {
    fn new(scene: Scene) -> Self {
        static LATEST: AtomicU64 = AtomicU64::new(0);
        Self { scene, number: LATEST.fetch_add(1, Ordering::Relaxed) }
    }
}

/// Makes a scene without bodies and tools.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_scene_new(scene: *mut *mut SceneGraph) -> Status {
    // SAFETY: the caller's pointer.
    catching_panics(|| unsafe { store_handle(SceneGraph::new(Scene::default()), scene, "scene") })
}

/// Reads a scene that `palpate pack` has written (the folder), or a bare store (.palpate) with a tool that suits it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_scene_load(file: *const c_char, scene: *mut *mut SceneGraph) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointer.
        let file = unsafe { path(file, "file") }?;
        let loaded = Scene::load(file)?;
        // SAFETY: the caller's pointer.
        unsafe { store_handle(SceneGraph::new(loaded), scene, "scene") }
    })
}

/// Frees a scene; loops made of it go on. Null is nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_scene_free(scene: *mut SceneGraph) {
    // SAFETY: the caller's pointer.
    catching_panics(|| unsafe { free_handle(scene) });
}

/// Adds a body made of a store, four at most. `options` may be null: at the origin. `body` gets its handle, or is null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_scene_add_body(
    scene: *mut SceneGraph,
    store: *const Store,
    options: *const BodyOptions,
    body: *mut u32,
) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointers.
        let (scene, store, handle) = unsafe { (exclusive(scene, "scene")?, shared(store, "store")?, body.as_mut()) };
        // SAFETY: the caller's pointer.
        let options = unsafe { versioned_struct::read_or_default(options) }?;
        let mut body = Body::of_store(store.green.clone())?;
        require_place(options.position, options.orientation)?;
        body.placement = placement(options.position, options.orientation);
        if options.youngs_modulus != 0.0 {
            let all = |value| vec![value; store.green.surface_count()];
            let (youngs, poissons) = (all(options.youngs_modulus), all(options.poissons_ratio));
            body.moduli = Some(Moduli::linear(youngs, poissons, true));
        }
        let id = scene.scene.add_body(body)?;
        handle.into_iter().for_each(|handle| *handle = id.0);
        Ok(())
    })
}

/// Moves a body of the scene: position, m, and orientation, a unit quaternion w x y z.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_scene_place_body(
    scene: *mut SceneGraph,
    body: u32,
    position: *const f64,
    orientation: *const f64,
) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointers, to three and four numbers.
        let (scene, position, orientation) = unsafe {
            (
                exclusive(scene, "scene")?,
                shared(position.cast::<[f64; 3]>(), "position")?,
                shared(orientation.cast::<[f64; 4]>(), "orientation")?,
            )
        };
        require_place(*position, *orientation)?;
        match scene.scene.place_body(BodyId(body), placement(*position, *orientation)) {
            true => Ok(()),
            false => Err(unknown("body", body)),
        }
    })
}

/// Takes a body out of the scene; loops that were made before keep it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_scene_remove_body(scene: *mut SceneGraph, body: u32) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointer.
        let scene = unsafe { exclusive(scene, "scene") }?;
        scene.scene.remove_body(BodyId(body)).ok_or_else(|| unknown("body", body))?;
        Ok(())
    })
}

/// Adds a tool, four at most. `options` may be null: a ball that suits the bodies. `tool` gets its handle, or is null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_scene_add_tool(
    scene: *mut SceneGraph,
    options: *const ToolOptions,
    tool: *mut u32,
) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointers.
        let (scene, options, handle) =
            unsafe { (exclusive(scene, "scene")?, versioned_struct::read_or_default(options)?, tool.as_mut()) };
        // SAFETY: the caller's vertices and triangles.
        let id = scene.scene.add_tool(unsafe { options.tool() }?)?;
        handle.into_iter().for_each(|handle| *handle = id.0);
        Ok(())
    })
}

/// Takes a tool out of the scene; loops that were made before keep it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_scene_remove_tool(scene: *mut SceneGraph, tool: u32) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointer.
        let scene = unsafe { exclusive(scene, "scene") }?;
        scene.scene.remove_tool(ToolId(tool)).ok_or_else(|| unknown("tool", tool))?;
        Ok(())
    })
}

/// States what the device of a tool can render: the safety stage keeps it, and a tool that is stiffer is refused by
/// palpate_loop_new.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_scene_set_device(
    scene: *mut SceneGraph,
    tool: u32,
    limits: *const DeviceOptions,
) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointers.
        let (scene, limits) = unsafe { (exclusive(scene, "scene")?, versioned_struct::read(limits)?) };
        match scene.scene.set_device(ToolId(tool), limits.limits()) {
            true => Ok(()),
            false => Err(unknown("tool", tool)),
        }
    })
}

/// Reads limits and scheduling of a scene. Set struct_size before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_scene_get_options(scene: *const SceneGraph, options: *mut SceneOptions) -> Status {
    // SAFETY: the caller's pointers.
    catching_panics(|| unsafe { versioned_struct::write(&SceneOptions::of(&shared(scene, "scene")?.scene), options) })
}

/// Changes limits and scheduling of a scene, for loops that are made from now on.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_scene_set_options(scene: *mut SceneGraph, options: *const SceneOptions) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointers.
        let (scene, options) = unsafe { (exclusive(scene, "scene")?, versioned_struct::read(options)?) };
        options.apply_to(&mut scene.scene)
    })
}

/// How many bodies and tools a scene has; either place may be null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_scene_get_counts(
    scene: *const SceneGraph,
    bodies: *mut usize,
    tools: *mut usize,
) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointers.
        let (scene, bodies, tools) = unsafe { (&shared(scene, "scene")?.scene, bodies.as_mut(), tools.as_mut()) };
        bodies.into_iter().for_each(|count| *count = scene.bodies().count());
        tools.into_iter().for_each(|count| *count = scene.tools().count());
        Ok(())
    })
}

fn unknown(what: &str, handle: u32) -> Refusal {
    Refusal::argument(format!("the scene has no {what} of the handle {handle}"))
}

fn require_place(position: [f64; 3], orientation: [f64; 4]) -> Outcome {
    if !position.iter().all(|x| x.is_finite()) {
        return Err(Refusal::argument(format!("position is {position:?}, it must be finite")));
    }
    let length = orientation.iter().map(|x| x * x).sum::<f64>().sqrt();
    if (length - 1.0).abs() <= UNIT_LENGTH {
        return Ok(());
    }
    Err(Refusal::argument(format!("orientation must be a unit quaternion w x y z, got {orientation:?}")))
}
