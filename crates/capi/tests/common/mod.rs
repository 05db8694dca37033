//! A cube in a store, and its scene by way of the C interface.
#![allow(dead_code)] // each test file uses its part
#![allow(unsafe_code)] // calls what C calls

use std::ffi::{CStr, CString};
use std::path::PathBuf;
use std::ptr::{null, null_mut};

use palpate::force_loop::{Loop, palpate_loop_new};
use palpate::library::palpate_last_error;
use palpate::options::{SceneOptions, ToolOptions, palpate_tool_options_init};
use palpate::scene::{
    SceneGraph, palpate_scene_add_body, palpate_scene_add_tool, palpate_scene_get_options, palpate_scene_new,
    palpate_scene_set_options,
};
use palpate::status::Status;
use palpate::store::{Store, palpate_store_load};
use palpate::tick::{DeviceReading, DeviceWrench};
use palpate_core::green::{Precision, precompute};

#[path = "../../../core/tests/common/mod.rs"]
mod bodies;

pub const PERIOD: f64 = 1e-3;
pub const NO_WRENCH: DeviceWrench = DeviceWrench { force: [0.0; 3], torque: [0.0; 3] };

/// A cube 0.1 m wide on its lower face, in a file of its own.
pub fn store_file(name: &str) -> PathBuf {
    let green = precompute(&bodies::cube(4), Precision::F32, &|_, _| true).expect("a solvable cube");
    let path = std::env::temp_dir().join(format!("palpate-capi-{}-{name}.palpate", std::process::id()));
    green.save(&path).expect("a writable folder");
    path
}

pub fn error_text() -> String {
    // SAFETY: a text of this thread.
    unsafe { CStr::from_ptr(palpate_last_error()) }.to_str().expect("UTF-8").to_string()
}

#[track_caller]
pub fn done(status: Status) {
    assert_eq!(status, Status::PalpateOk, "{}", error_text());
}

#[track_caller]
pub fn refused(status: Status, wanted: Status, words: &str) {
    assert_eq!(status, wanted);
    assert!(error_text().contains(words), "{}", error_text());
}

pub fn load(path: &std::path::Path) -> *mut Store {
    let file = CString::new(path.to_str().expect("UTF-8")).expect("no zero");
    let mut store = null_mut();
    // SAFETY: a text and a place.
    done(unsafe { palpate_store_load(file.as_ptr(), &mut store) });
    store
}

/// The cube under one ball of 5 mm that sticks by a patch of 20 mm, its loop to be ticked. Strain is not limited: when it has
/// been prepared beside a loop is not the same from run to run.
pub fn scene_and_loop(store: *const Store) -> (*mut SceneGraph, *mut Loop) {
    let (mut scene, mut own) = (null_mut(), null_mut());
    let mut tool = ToolOptions::default();
    // SAFETY: living objects and places.
    unsafe {
        done(palpate_scene_new(&mut scene));
        let mut options = SceneOptions::default();
        done(palpate_scene_get_options(scene, &mut options));
        options.strain_limit = 0.0;
        done(palpate_scene_set_options(scene, &options));
        done(palpate_scene_add_body(scene, store, null(), null_mut()));
        done(palpate_tool_options_init(&mut tool, size_of::<ToolOptions>()));
        (tool.radius, tool.contact_radius, tool.law) = (0.005, 0.02, palpate::options::PALPATE_LAW_PATCH);
        done(palpate_scene_add_tool(scene, &tool, null_mut()));
        done(palpate_loop_new(scene, &mut own));
    }
    (scene, own)
}

/// A tool at a height over the middle of the upper face, m.
pub fn at(height: f64) -> DeviceReading {
    DeviceReading {
        position: [0.05, 0.05, 0.1 + height],
        orientation: [0.0; 4],
        velocity: [0.0; 3],
        angular_velocity: [0.0; 3],
        timestamp_ns: 0,
        buttons: 0,
        active: 1,
    }
}
