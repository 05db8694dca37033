//! A tick by way of C is that of the servo: the same bits, no allocation; frames tell of it.
#![allow(unsafe_code)] // calls what C calls, and counts allocations

mod common;
#[path = "../../core/tests/common/counting_allocator.rs"]
mod counting_allocator;

use std::path::Path;
use std::ptr::{null, null_mut};

use common::{NO_WRENCH, PERIOD, at, done, load, refused, scene_and_loop, store_file};
use counting_allocator::allocations;
use palpate::force_loop::{
    Loop, Target, palpate_loop_change, palpate_loop_free, palpate_loop_new, palpate_loop_set_target,
    palpate_loop_start, palpate_loop_stop,
};
use palpate::frame::{
    ContactRecord, Frame, palpate_loop_get_contacts, palpate_loop_get_frame, palpate_loop_get_positions,
    palpate_loop_get_rest_positions, palpate_loop_get_surface_size, palpate_loop_get_triangles,
};
use palpate::offline::palpate_scene_run;
use palpate::options::{BodyOptions, DeviceOptions, SceneOptions, ToolOptions};
use palpate::scene::{
    SceneGraph, palpate_scene_add_body, palpate_scene_add_tool, palpate_scene_free, palpate_scene_get_options,
    palpate_scene_remove_body, palpate_scene_set_device, palpate_scene_set_options,
};
use palpate::settings::palpate_loop_reset;
use palpate::statics::palpate_store_touch;
use palpate::status::Status;
use palpate::store::{Store, palpate_store_free};
use palpate::tick::{DeviceReading, DeviceWrench, palpate_loop_check_period, palpate_loop_tick};

const TICKS: usize = 900;

struct Fixture {
    path: std::path::PathBuf,
    store: *mut Store,
    scene: *mut SceneGraph,
    own: *mut Loop,
}

impl Fixture {
    fn new(name: &str) -> Self {
        let path = store_file(name);
        let store = load(&path);
        let (scene, own) = scene_and_loop(store);
        Self { path, store, scene, own }
    }
}

impl Drop for Fixture {
    fn drop(&mut self) {
        // SAFETY: each is freed once.
        unsafe {
            palpate_loop_free(self.own);
            palpate_scene_free(self.scene);
            palpate_store_free(self.store);
        }
        let _ = std::fs::remove_file(Path::new(&self.path));
    }
}

/// Down to 4 mm and back, twice, and sideways.
fn path() -> Vec<DeviceReading> {
    let mut before = [0.0; 3];
    let reading = |tick: usize| {
        let depth = 0.004 * (7e-3 * tick as f64).sin();
        let mut reading = at(0.005 - depth);
        reading.position[0] += 1e-5 * tick as f64;
        let shift = |k: usize| (reading.position[k] - before[k]) / PERIOD;
        let velocity = if tick == 0 { [0.0; 3] } else { [shift(0), shift(1), shift(2)] };
        before = reading.position;
        DeviceReading { velocity, ..reading }
    };
    (0..TICKS).map(reading).collect()
}

fn tick(own: *mut Loop, tick: usize, reading: &DeviceReading) -> (Status, DeviceWrench) {
    let mut wrench = NO_WRENCH;
    let now_ns = (1e9 * PERIOD * tick as f64).round() as u64;
    // SAFETY: a living loop of one tool.
    let status = unsafe { palpate_loop_tick(own, now_ns, PERIOD, reading, &mut wrench, 1) };
    (status, wrench)
}

#[test]
fn ticks_are_those_of_a_script_to_the_bit_and_do_not_allocate() {
    let fixture = Fixture::new("bits");
    let (path, mut played) = (path(), vec![[0.0; 3]; TICKS]);
    let positions: Vec<[f64; 3]> = path.iter().map(|reading| reading.position).collect();
    // SAFETY: a living scene of one tool, and as many rows as stated.
    done(unsafe {
        let (from, to) = (positions.as_ptr().cast(), played.as_mut_ptr().cast());
        palpate_scene_run(fixture.scene, TICKS, 1, from, null(), to, null_mut())
    });
    for (count, reading) in path.iter().enumerate() {
        let before = allocations();
        let (status, wrench) = tick(fixture.own, count, reading);
        assert_eq!(allocations() - before, 0, "tick {count} allocates");
        assert_eq!((status, wrench.force), (Status::PalpateOk, played[count]), "tick {count}");
    }
    let highest = played.iter().map(|force| force[2]).fold(0.0, f64::max);
    assert!(highest > 0.3, "{highest} N: the device is pushed up");
}

/// A patch that sticks, held still and let in by the ramp, is the static answer with a spring in series for the largest stiffness.
#[test]
fn a_held_press_is_the_static_answer() {
    let fixture = Fixture::new("held");
    let (depth, radius) = (0.002, 0.02);
    let last = (0..1500).map(|count| {
        let down = depth * (count as f64 / 400.0).min(1.0);
        tick(fixture.own, count, &at(0.005 - down)).1
    });
    let held = last.fold(None, |_, now| Some(now)).expect("a tick");
    let mut force = [0.0; 3];
    // SAFETY: a living store, three numbers each.
    done(unsafe {
        let (point, press) = ([0.05, 0.05, 0.1], [0.0, 0.0, -depth]);
        let to = force.as_mut_ptr();
        palpate_store_touch(fixture.store, point.as_ptr(), press.as_ptr(), radius, to, null_mut(), 0, null_mut())
    });
    assert!((held.force[2] + force[2]).abs() < 0.01 * force[2].abs(), "{:?} {force:?}", held.force);
}

#[test]
fn frames_tell_of_the_latest_tick_and_surfaces_follow_the_tool() {
    let fixture = Fixture::new("frames");
    let own = fixture.own;
    let last = (0..800).map(|count| tick(own, count, &at(0.005 - 0.003 * (count as f64 / 400.0).min(1.0))));
    let (_, wrench) = last.fold(None, |_, now| Some(now)).expect("a tick");
    let (mut frame, mut nodes, mut triangles, mut count) = (Frame::default(), 0, 0, 0);
    // SAFETY: a living loop, and places of the sizes that are stated.
    unsafe {
        done(palpate_loop_get_frame(own, &mut frame));
        assert_eq!((frame.ticks, frame.tools, frame.contacts, frame.faulty), (800, 1, 1, 0));
        assert_eq!((frame.forces[0], frame.torques[0]), (wrench.force, wrench.torque));
        let mut contacts: [ContactRecord; 4] = std::mem::zeroed();
        done(palpate_loop_get_contacts(own, contacts.as_mut_ptr(), contacts.len(), &mut count));
        assert_eq!(count, 1);
        let balance = contacts[0].force[2] + wrench.force[2];
        assert!(balance.abs() < 1e-9 && contacts[0].force[2] < -0.1, "on the body and on the device: {balance} N");
        done(palpate_loop_get_surface_size(own, 0, &mut nodes, &mut triangles));
        let (mut rest, mut moved) = (vec![[0.0_f64; 3]; nodes], vec![[0.0; 3]; nodes]);
        let mut corners = vec![[0_u32; 3]; triangles];
        done(palpate_loop_get_triangles(own, 0, corners.as_mut_ptr().cast(), triangles));
        assert!(corners.as_flattened().iter().all(|&node| (node as usize) < nodes));
        done(palpate_loop_get_rest_positions(own, 0, rest.as_mut_ptr().cast(), nodes));
        done(palpate_loop_get_positions(own, 0, moved.as_mut_ptr().cast(), nodes));
        let middle =
            rest.iter().position(|p| p.map(|x: f64| (1e3 * x).round()) == [50.0, 50.0, 100.0]).expect("a node");
        let dent = rest[middle][2] - moved[middle][2];
        assert!((0.002..0.005).contains(&dent), "{dent} m under a tool 3 mm deep");
        let held = rest.iter().zip(&moved).filter(|(rest, _)| rest[2] < 1e-9);
        assert!(held.into_iter().all(|(rest, moved)| rest == moved), "the support does not move");
    }
}

#[test]
fn a_fault_is_told_and_its_wrench_is_zero_until_a_reset() {
    let fixture = Fixture::new("fault");
    let own = fixture.own;
    for count in 0..600 {
        tick(own, count, &at(0.005 - 0.003 * (count as f64 / 400.0).min(1.0)));
    }
    let bad = DeviceReading { position: [f64::NAN; 3], ..at(0.002) };
    let (status, wrench) = tick(own, 600, &bad);
    assert_eq!((status, wrench.force), (Status::PalpateFault, [0.0; 3]), "within the tick");
    assert_eq!(tick(own, 601, &at(0.002)).0, Status::PalpateFault);
    let mut frame = Frame::default();
    // SAFETY: a living loop and a place.
    unsafe {
        done(palpate_loop_get_frame(own, &mut frame));
        let text: Vec<u8> = frame.fault.iter().take_while(|&&c| c != 0).map(|&c| c as u8).collect();
        assert!(String::from_utf8_lossy(&text).contains("not finite"), "{}", String::from_utf8_lossy(&text));
        done(palpate_loop_reset(own));
    }
    assert_eq!(tick(own, 602, &at(0.005)).0, Status::PalpateOk);
}

/// Force along z of a simulated hand that presses by 2 mm: the first above 0.2 N, or that of the last of 2 s.
fn pressed_by_hand(own: *mut Loop) -> f64 {
    let target =
        Target { position: [0.05, 0.05, 0.102], orientation: [0.0; 4], velocity: [0.0; 3], active: 1, grab: 0 };
    let mut frame = Frame::default();
    // SAFETY: a living loop and places.
    unsafe {
        done(palpate_loop_start(own));
        let above = Target { position: [0.05, 0.05, 0.12], ..target };
        done(palpate_loop_set_target(own, 0, &above));
        std::thread::sleep(std::time::Duration::from_millis(50));
        done(palpate_loop_set_target(own, 0, &target));
        for _ in 0..200 {
            std::thread::sleep(std::time::Duration::from_millis(10));
            done(palpate_loop_get_frame(own, &mut frame));
            if frame.forces[0][2] > 0.2 {
                break;
            }
        }
        done(palpate_loop_stop(own));
    }
    frame.forces[0][2]
}

#[test]
fn a_thread_of_its_own_presses_by_a_simulated_hand() {
    let force = pressed_by_hand(Fixture::new("thread").own);
    assert!(force > 0.2, "{force}");
}

#[test]
fn the_thread_keeps_to_what_a_device_can_render() {
    let fixture = Fixture::new("device");
    let limits = DeviceOptions { max_force: 0.1, ..DeviceOptions::default() };
    let mut own = null_mut();
    // SAFETY: a living scene and a place; the loop is freed once.
    unsafe {
        done(palpate_scene_set_device(fixture.scene, 0, &limits));
        done(palpate_loop_new(fixture.scene, &mut own));
        let force = pressed_by_hand(own);
        palpate_loop_free(own);
        assert!((force - 0.1).abs() < 1e-9, "{force}");
    }
}

/// Waits for a frame that is as wanted.
#[track_caller]
fn wait_until(own: *mut Loop, wanted: impl Fn(&Frame) -> bool) {
    let mut frame = Frame::default();
    let seen = (0..300).any(|_| {
        std::thread::sleep(std::time::Duration::from_millis(10));
        // SAFETY: a living loop and a place.
        done(unsafe { palpate_loop_get_frame(own, &mut frame) });
        wanted(&frame)
    });
    assert!(seen, "{:?}", frame.forces);
}

/// A second cube and a second tool come into a running loop, the first ones go on, and the second cube goes again.
#[test]
fn bodies_and_tools_come_and_go_while_the_loop_runs() {
    let fixture = Fixture::new("change");
    let (own, scene) = (fixture.own, fixture.scene);
    let pressed =
        Target { position: [0.05, 0.05, 0.102], orientation: [0.0; 4], velocity: [0.0; 3], active: 1, grab: 0 };
    let beside = Target { position: [0.25, 0.05, 0.102], ..pressed };
    let (mut frame, mut body, mut tool) = (Frame::default(), 0, 0);
    // SAFETY: living objects and places.
    unsafe {
        refused(palpate_loop_change(own, scene), Status::PalpateErrorState, "palpate_loop_start first");
        done(palpate_loop_start(own));
        done(palpate_loop_set_target(own, 0, &Target { position: [0.05, 0.05, 0.12], ..pressed }));
        std::thread::sleep(std::time::Duration::from_millis(50));
        done(palpate_loop_set_target(own, 0, &pressed));
        wait_until(own, |frame| frame.forces[0][2] > 0.2);
        let options = BodyOptions { position: [0.2, 0.0, 0.0], ..BodyOptions::default() };
        done(palpate_scene_add_body(scene, fixture.store, &options, &mut body));
        done(palpate_scene_add_tool(scene, &ToolOptions { radius: 0.005, ..ToolOptions::default() }, &mut tool));
        done(palpate_loop_change(own, scene));
        done(palpate_loop_get_frame(own, &mut frame));
        assert!(frame.tools == 2 && frame.forces[0][2] > 0.2, "the first contact goes on: {:?}", frame.forces);
        done(palpate_loop_set_target(own, tool, &Target { position: [0.25, 0.05, 0.12], ..beside }));
        std::thread::sleep(std::time::Duration::from_millis(50));
        done(palpate_loop_set_target(own, tool, &beside));
        wait_until(own, |frame| frame.forces[1][2] > 0.05 && frame.contacts == 2);
        done(palpate_scene_remove_body(scene, body));
        done(palpate_loop_change(own, scene));
        wait_until(own, |frame| frame.forces[1] == [0.0; 3] && frame.forces[0][2] > 0.2 && frame.contacts == 1);
        let gone = palpate_loop_get_positions(own, body, null_mut(), 0);
        refused(gone, Status::PalpateErrorArgument, "the loop has no body of the handle 1");
        done(palpate_loop_stop(own));
    }
}

/// A loop keeps its own limits through a change and a stop.
#[test]
fn limits_of_a_scene_are_for_loops_that_are_made_later() {
    let fixture = Fixture::new("limits");
    let (own, scene, mut later) = (fixture.own, fixture.scene, null_mut());
    let mut options = SceneOptions::default();
    let strongest = |own| {
        let force = |count| tick(own, count, &at(0.005 - 0.003 * (count as f64 / 400.0).min(1.0))).1.force[2];
        (0..600).map(force).fold(0.0, f64::max)
    };
    // SAFETY: living objects and places.
    unsafe {
        done(palpate_scene_get_options(scene, &mut options));
        options.max_force = 0.05;
        done(palpate_loop_start(own));
        done(palpate_scene_set_options(scene, &options));
        done(palpate_loop_change(own, scene));
        done(palpate_loop_stop(own));
        done(palpate_loop_new(scene, &mut later));
        let (held, new) = (strongest(own), strongest(later));
        assert!(held > 0.1 && new <= 0.05 * (1.0 + 1e-12) && new > 0.04, "{held} N and {new} N");
        palpate_loop_free(later);
    }
}

/// What other threads ask for keeps no tick from being made.
#[test]
fn a_period_is_checked_while_another_thread_ticks() {
    let fixture = Fixture::new("period");
    let (own, over) = (fixture.own as usize, std::sync::atomic::AtomicBool::new(false));
    let ended = std::sync::atomic::Ordering::Relaxed;
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut checks = 0;
            while !over.load(ended) {
                // SAFETY: a living loop.
                done(unsafe { palpate_loop_check_period(own as *const Loop, PERIOD) });
                checks += 1;
            }
            assert!(checks > 100, "{checks}");
        });
        for count in 0..20_000 {
            assert_eq!(tick(fixture.own, count, &at(0.004)).0, Status::PalpateOk, "tick {count}");
        }
        over.store(true, ended);
    });
    // SAFETY: a living loop, whose own thread ticks it from now on.
    unsafe {
        done(palpate_loop_start(fixture.own));
        refused(palpate_loop_check_period(fixture.own, PERIOD), Status::PalpateErrorState, "palpate_loop_stop first");
        done(palpate_loop_stop(fixture.own));
    }
}
