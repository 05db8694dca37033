//! Invalid calls return an error that names the argument, and change nothing.
#![allow(unsafe_code)] // calls what C calls

mod common;

use std::ptr::{null, null_mut};
use std::sync::atomic::{AtomicBool, Ordering};

use common::{NO_WRENCH, PERIOD, at, done, load, refused, scene_and_loop, store_file};
use palpate::force_loop::{
    Loop, Target, palpate_loop_change, palpate_loop_free, palpate_loop_new, palpate_loop_set_target,
    palpate_loop_start, palpate_loop_stop,
};
use palpate::frame::{Frame, palpate_loop_get_frame, palpate_loop_get_positions};
use palpate::offline::palpate_scene_run;
use palpate::options::{DeviceOptions, ToolOptions, palpate_device_limits_known};
use palpate::scene::{
    palpate_scene_add_body, palpate_scene_add_tool, palpate_scene_free, palpate_scene_load, palpate_scene_new,
    palpate_scene_set_device,
};
use palpate::settings::{palpate_loop_reset, palpate_loop_set_friction};
use palpate::statics::{Condition, palpate_store_solve, palpate_store_touch};
use palpate::status::Status;
use palpate::store::{palpate_store_free, palpate_store_get_positions, palpate_store_load};
use palpate::tick::{DeviceWrench, palpate_loop_tick};
use palpate::versioned_struct::{VersionedStruct, read, write, write_as};

const ARGUMENT: Status = Status::PalpateErrorArgument;

#[test]
fn null_pointers_lengths_and_handles_are_refused_by_name() {
    let path = store_file("refusals");
    let store = load(&path);
    let (scene, own) = scene_and_loop(store);
    let mut wrench = DeviceWrench { force: [1.0; 3], torque: [1.0; 3] };
    // SAFETY: what is not null lives.
    unsafe {
        refused(palpate_store_load(null(), null_mut()), ARGUMENT, "file is a null pointer");
        refused(palpate_store_load(c"x".as_ptr(), null_mut()), Status::PalpateErrorSystem, "x");
        refused(palpate_scene_new(null_mut()), ARGUMENT, "scene is a null pointer");
        refused(palpate_scene_add_body(scene, null(), null(), null_mut()), ARGUMENT, "store is a null pointer");
        refused(palpate_store_get_positions(store, null_mut(), 7), ARGUMENT, "nodes is 7, it must be");
        refused(palpate_loop_get_positions(own, 5, null_mut(), 0), ARGUMENT, "no body of the handle 5");
        refused(palpate_loop_set_friction(own, 1, 0.1), ARGUMENT, "no tool of the handle 1");
        refused(palpate_loop_set_friction(own, 0, -0.1), ARGUMENT, "friction of tool 0 must not be negative");
        let mut frame = Frame { struct_size: 3, ..Frame::default() };
        refused(palpate_loop_get_frame(own, &mut frame), ARGUMENT, "sizeof(palpate_frame)");
        frame.struct_size = 1 << 20;
        refused(palpate_loop_get_frame(own, &mut frame), ARGUMENT, "newer palpate.h");
        let other = ToolOptions { shape: 9, ..ToolOptions::default() };
        refused(palpate_scene_add_tool(scene, &other, null_mut()), ARGUMENT, "there is no shape 9");
        // Wrenches are zero after a refused tick: none of an earlier one is put out again.
        let call = |own, now, period, readings, wrenches, tools| {
            palpate_loop_tick(own, now, period, readings, wrenches, tools)
        };
        refused(call(own, 1, PERIOD, null(), &mut wrench, 1), ARGUMENT, "readings is a null pointer");
        assert_eq!((wrench.force, wrench.torque), (NO_WRENCH.force, NO_WRENCH.torque));
        refused(call(own, 1, f64::NAN, &at(0.0), &mut wrench, 1), ARGUMENT, "period");
        refused(
            call(own, 1, PERIOD, [at(0.0); 2].as_ptr(), [wrench; 2].as_mut_ptr(), 2),
            ARGUMENT,
            "tools is 2, it must be 1",
        );
        refused(call(null_mut(), 1, PERIOD, &at(0.0), &mut wrench, 1), ARGUMENT, "loop is a null pointer");
        // Lengths that wrap around to none, and lengths of no array.
        done(palpate_scene_add_tool(scene, null(), null_mut()));
        for ticks in [usize::MAX / 2 + 1, usize::MAX / 32] {
            let run = palpate_scene_run(scene, ticks, 2, null(), null(), null_mut(), null_mut());
            refused(run, ARGUMENT, "more than memory holds");
        }
        palpate_loop_free(own);
        palpate_scene_free(scene);
        palpate_store_free(store);
        palpate_loop_free(null_mut::<Loop>());
    }
    std::fs::remove_file(path).expect("the store");
}

#[test]
fn damaged_and_foreign_files_are_refused() {
    let path = store_file("damaged");
    let mut bytes = std::fs::read(&path).expect("the store");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&path, bytes).expect("the store");
    let file = std::ffi::CString::new(path.to_str().expect("UTF-8")).expect("no zero");
    let (mut store, mut scene) = (null_mut(), null_mut());
    // SAFETY: texts and places.
    unsafe {
        refused(palpate_store_load(file.as_ptr(), &mut store), Status::PalpateErrorStore, "damaged");
        refused(palpate_scene_load(file.as_ptr(), &mut scene), Status::PalpateErrorStore, "damaged");
        assert!(store.is_null() && scene.is_null());
    }
    std::fs::remove_file(path).expect("the store");
}

#[test]
fn a_tool_stiffer_than_its_device_holds_is_refused() {
    let path = store_file("device");
    let store = load(&path);
    let (scene, own) = scene_and_loop(store);
    let (mut limits, mut second) = (DeviceOptions::default(), null_mut());
    // SAFETY: living objects and places.
    unsafe {
        refused(palpate_device_limits_known(c"Tuch".as_ptr(), &mut limits, size_of_val(&limits)), ARGUMENT, "Touch");
        done(palpate_device_limits_known(c"Touch".as_ptr(), &mut limits, size_of_val(&limits)));
        assert_eq!(limits.max_stiffness, 400.0);
        done(palpate_scene_set_device(scene, 0, &limits));
        refused(palpate_loop_new(scene, &mut second), ARGUMENT, "at most 400 N/m");
        palpate_loop_free(own);
        palpate_scene_free(scene);
        palpate_store_free(store);
    }
    std::fs::remove_file(path).expect("the store");
}

#[test]
fn statics_refuse_what_cannot_be_prescribed() {
    let path = store_file("statics");
    let store = load(&path);
    let (mut force, nan) = ([0.0; 3], f64::NAN);
    let condition = |node, kind, value| Condition { node, kind, value };
    // SAFETY: living objects and places.
    unsafe {
        let solve =
            |c: &[Condition]| palpate_store_solve(store, c.as_ptr(), c.len(), null_mut(), null_mut(), 0, null_mut());
        refused(solve(&[condition(9999, 0, [0.0; 3])]), ARGUMENT, "surface node 9999 is not touchable");
        refused(solve(&[condition(60, 7, [0.0; 3])]), ARGUMENT, "there is no kind 7");
        let both = [condition(60, 0, [nan, nan, 1e-3]), condition(60, 1, [0.0, 0.0, 1.0])];
        refused(solve(&both), ARGUMENT, "both a force and a displacement along z");
        let touch = |radius, force| {
            let (point, press) = ([0.05, 0.05, 0.1], [nan, nan, -1e-3]);
            palpate_store_touch(store, point.as_ptr(), press.as_ptr(), radius, force, null_mut(), 0, null_mut())
        };
        refused(touch(-1.0, force.as_mut_ptr()), ARGUMENT, "radius");
        refused(touch(0.02, null_mut()), ARGUMENT, "force is a null pointer");
        done(touch(0.02, force.as_mut_ptr()));
        assert!(force[2] < 0.0);
        palpate_store_free(store);
    }
    std::fs::remove_file(path).expect("the store");
}

#[test]
fn who_ticks_is_one_at_a_time() {
    let path = store_file("threads");
    let store = load(&path);
    let (scene, own) = scene_and_loop(store);
    let mut wrench = NO_WRENCH;
    let target =
        Target { position: [0.05, 0.05, 0.104], orientation: [0.0; 4], velocity: [0.0; 3], active: 1, grab: 0 };
    // SAFETY: living objects and places.
    unsafe {
        refused(palpate_loop_set_target(own, 0, &target), Status::PalpateErrorState, "palpate_loop_start first");
        done(palpate_loop_start(own));
        refused(palpate_loop_start(own), Status::PalpateErrorState, "runs already");
        done(palpate_loop_set_target(own, 0, &target));
        let (other, of_other) = scene_and_loop(store);
        refused(palpate_loop_change(own, other), ARGUMENT, "scene is not the one");
        done(palpate_loop_change(own, scene));
        palpate_loop_free(of_other);
        palpate_scene_free(other);
        refused(
            palpate_loop_tick(own, 1, PERIOD, &at(0.0), &mut wrench, 1),
            Status::PalpateErrorState,
            "palpate_loop_stop",
        );
        done(palpate_loop_stop(own));
        done(palpate_loop_stop(own));
        done(palpate_loop_tick(own, 1, PERIOD, &at(0.1), &mut wrench, 1));
    }
    // Two threads tick without pause: whoever comes second is turned away, and nobody waits.
    let (address, busy) = (own as usize, AtomicBool::new(false));
    std::thread::scope(|scope| {
        for first in [1_u64, 2] {
            let busy = &busy;
            scope.spawn(move || {
                let mut wrench = NO_WRENCH;
                for tick in 0..400_000 {
                    // SAFETY: a living loop.
                    let status = unsafe {
                        palpate_loop_tick(
                            address as *mut Loop,
                            first + 1_000_000 * tick,
                            PERIOD,
                            &at(0.1),
                            &mut wrench,
                            1,
                        )
                    };
                    busy.fetch_or(status == Status::PalpateErrorBusy, Ordering::Relaxed);
                    if busy.load(Ordering::Relaxed) {
                        return;
                    }
                    assert!(matches!(status, Status::PalpateOk | Status::PalpateFault));
                }
            });
        }
    });
    assert!(busy.load(Ordering::Relaxed), "the two never met");
    // SAFETY: living objects.
    unsafe {
        done(palpate_loop_reset(own));
        palpate_loop_free(own);
        palpate_scene_free(scene);
        palpate_store_free(store);
    }
    std::fs::remove_file(path).expect("the store");
}

/// A struct of two numbers that has grown by a third one.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
struct NewerStruct {
    struct_size: u32,
    first: u32,
    second: f64,
    added: f64,
}

impl Default for NewerStruct {
    fn default() -> Self {
        Self { struct_size: size_of::<Self>() as u32, first: 1, second: 2.0, added: 3.0 }
    }
}

// SAFETY: numbers only; the size comes first.
unsafe impl VersionedStruct for NewerStruct {
    const NAME: &str = "grown";
    const FIRST_SIZE: usize = 16;
}

/// What an older program has, and memory behind it that is not the struct's.
#[repr(C)]
struct OlderStruct {
    struct_size: u32,
    first: u32,
    second: f64,
    behind: f64,
}

#[test]
fn an_older_struct_is_read_and_filled_as_far_as_it_reaches() {
    let mut older = OlderStruct { struct_size: 16, first: 7, second: 8.0, behind: 9.0 };
    // SAFETY: 16 bytes are there.
    let read = unsafe { read((&raw const older).cast::<NewerStruct>()) }.expect("an older struct");
    assert_eq!(read, NewerStruct { struct_size: 16, first: 7, second: 8.0, added: 3.0 });
    let answer = NewerStruct { first: 4, second: 5.0, added: 6.0, ..NewerStruct::default() };
    // SAFETY: 16 bytes are there.
    unsafe { write(&answer, (&raw mut older).cast::<NewerStruct>()) }.expect("an older struct");
    assert_eq!((older.struct_size, older.first, older.second, older.behind), (16, 4, 5.0, 9.0));
    // SAFETY: 16 bytes are there.
    unsafe { write_as(&NewerStruct::default(), (&raw mut older).cast::<NewerStruct>(), 16) }.expect("an older struct");
    assert_eq!((older.struct_size, older.first, older.second, older.behind), (16, 1, 2.0, 9.0));
}

#[test]
fn a_newer_struct_and_none_at_all_are_refused() {
    for (size, words) in [(32, "newer palpate.h"), (15, "set it to sizeof(grown)"), (0, "sizeof(grown)")] {
        let mut stated_size = NewerStruct { struct_size: size, ..NewerStruct::default() };
        // SAFETY: refused by its size alone.
        let refusals =
            unsafe { [read(&raw const stated_size).err(), write(&NewerStruct::default(), &raw mut stated_size).err()] };
        for refusal in refusals {
            let refusal = refusal.expect("refused");
            assert_eq!(refusal.status, Status::PalpateErrorArgument);
            assert!(refusal.message.contains(words), "{}", refusal.message);
        }
    }
}
