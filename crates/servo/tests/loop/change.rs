//! Bodies, tools and devices that come into a running loop and go out of it. A driver of the test's own calls the tick.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use glam::DVec3;
use palpate_core::simulation::{Model, Pose, PreviousRanks};
use palpate_devices::{Device, DeviceLimits, OpenError, Reading, Scheduler, Wrench};
use palpate_servo::{SafetyLimits, SceneChange, Scheduling, Servo, Settings, StrainPreparer};

use crate::common::{PERIOD_NS, Scripted, TOOL, scene, settings};
use crate::counting_allocator::allocations;

type Tick = Box<dyn FnMut() + Send>;

/// Hands the tick to whoever calls it.
struct Handed(Mutex<Sender<Tick>>);

impl Scheduler for Handed {
    fn rate(&self) -> f64 {
        1000.0
    }

    fn start(&self, tick: Tick) -> Result<(), OpenError> {
        self.0.lock().expect("no poison").send(tick).map_err(|_| OpenError::new("nobody ticks", "none"))
    }

    fn stop(&self) {}
}

/// The forces that a device got, z of each tick.
type Got = Arc<Mutex<Vec<f64>>>;

/// Presses a cube's top at (x, 0.05), to and fro, by its own count of readings.
fn pressing(x: f64) -> (Box<dyn Device>, Got) {
    let got: Got = Arc::new(Mutex::new(Vec::with_capacity(100_000)));
    let (gets, mut tick) = (Arc::clone(&got), 0_u64);
    let read = move |_| {
        tick += 1;
        let height = 0.104 - 0.006 * (8e-3 * tick as f64).sin();
        let pose = Pose::at(DVec3::new(x, 0.05, height));
        Ok(Reading { pose, active: true, timestamp_ns: tick * PERIOD_NS, ..Reading::default() })
    };
    let write = move |wrench: Wrench| {
        gets.lock().expect("no poison").push(wrench.force.z);
        Ok(())
    };
    (Box::new(Scripted { read, write, limits: DeviceLimits::UNLIMITED }), got)
}

fn started(model: &Arc<Model>, devices: Vec<Box<dyn Device>>) -> (Servo, Receiver<Tick>) {
    let (sender, ticks) = channel();
    let strain = StrainPreparer::new(model);
    let driver = Arc::new(Handed(Mutex::new(sender)));
    let limits = SafetyLimits { max_compute: 10.0, max_overruns: u32::MAX, ..SafetyLimits::default() };
    let servo = Servo::start(model.clone(), devices, limits, settings(), Scheduling::at(1000.0), strain, Some(driver));
    (servo.expect("a loop"), ticks)
}

/// Of the model's bodies and tools those of some old ranks, in this order; `None` is a new tool.
fn change(model: &Model, bodies: &[usize], tools: &[Option<usize>], new: Option<Box<dyn Device>>) -> SceneChange {
    let kept_bodies = bodies.iter().map(|&body| model.bodies[body].clone()).collect();
    let changed = model.changed(kept_bodies, vec![TOOL; tools.len()]).expect("a valid scene");
    let mut previous_ranks = PreviousRanks::default();
    previous_ranks.bodies.iter_mut().zip(bodies).for_each(|(to, &old)| *to = Some(old));
    previous_ranks.tools.iter_mut().zip(tools).for_each(|(to, &old)| *to = old);
    let mut new = new.into_iter();
    let devices = tools.iter().map(|old| if old.is_some() { None } else { new.next() }).collect();
    let model = Arc::new(changed);
    SceneChange { strain: StrainPreparer::new(&model), model, previous_ranks, devices, settings: settings() }
}

/// Makes ticks one by one while another thread asks for a change; none of them allocates or frees, that of the change included.
fn ticks_through(tick: &mut Tick, servo: &mut Servo, change: SceneChange) -> palpate_core::Result<()> {
    std::thread::scope(|scope| {
        let asked = scope.spawn(|| servo.change(change));
        while !asked.is_finished() {
            let before = allocations();
            tick();
            assert_eq!(allocations(), before, "a tick allocated or freed");
            std::thread::sleep(Duration::from_micros(50));
        }
        asked.join().expect("no panic")
    })
}

/// What the first of two devices gets in 1200 ticks without a change.
fn unchanged(moving: bool, second_x: f64) -> Vec<f64> {
    let (first, got) = pressing(0.03);
    let (second, _) = pressing(second_x);
    let (mut servo, ticks) = started(&scene(moving, false), vec![first, second]);
    let mut tick = ticks.recv().expect("a tick");
    (0..1200).for_each(|_| tick());
    servo.stop();
    got.lock().expect("no poison").clone()
}

#[test]
fn what_stays_goes_on_to_the_bit() {
    for moving in [false, true] {
        let model = scene(moving, false);
        let (first, got) = pressing(0.03);
        // In the air beside the cubes: it changes nothing that the first one feels.
        let (second, _) = pressing(0.18);
        let (third, third_got) = pressing(0.19);
        let (mut servo, ticks) = started(&model, vec![first, second]);
        let mut tick = ticks.recv().expect("a tick");
        (0..300).for_each(|_| tick());
        ticks_through(&mut tick, &mut servo, change(&model, &[0], &[Some(0)], None)).expect("changed");
        // The body comes back behind another place, the tool behind a new one.
        let swapped = change(&model, &[1, 0], &[None, Some(0)], Some(third));
        let previous_ranks = PreviousRanks { bodies: [None, Some(0), None, None], ..swapped.previous_ranks };
        ticks_through(&mut tick, &mut servo, SceneChange { previous_ranks, ..swapped }).expect("changed");
        while got.lock().expect("no poison").len() < 1200 {
            tick();
        }
        let (reference, got) = (unchanged(moving, 0.18), got.lock().expect("no poison"));
        assert_eq!(got[..1200], reference[..1200]);
        assert!(got.iter().copied().fold(0.0, f64::max) > 0.01 && third_got.lock().expect("no poison").len() > 100);
        assert_eq!(servo.latest().status.fault, None);
        servo.stop();
    }
}

#[test]
fn what_goes_is_let_go_of_and_what_comes_ramps_in() {
    let model = scene(false, false);
    let (first, got) = pressing(0.03);
    let (second, second_got) = pressing(0.07);
    let (third, third_got) = pressing(0.07);
    let (mut servo, ticks) = started(&model, vec![first, second]);
    let mut tick = ticks.recv().expect("a tick");
    (0..200).for_each(|_| tick());
    let both = unchanged(false, 0.07);
    assert_eq!(got.lock().expect("no poison")[..200], both[..200]);
    assert!(second_got.lock().expect("no poison")[199] > 0.01);
    ticks_through(&mut tick, &mut servo, change(&model, &[0, 1], &[Some(0)], None)).expect("changed");
    // The device that has gone was told to let go, and is not asked any more.
    let last = second_got.lock().expect("no poison").clone();
    assert_eq!(last.last(), Some(&0.0));
    (0..5).for_each(|_| tick());
    assert_eq!(second_got.lock().expect("no poison").len(), last.len());
    let by_itself = *got.lock().expect("no poison").last().expect("a force");
    assert!(by_itself > 0.0);

    let grows = change(&model, &[0, 1], &[Some(0), None], Some(third));
    ticks_through(&mut tick, &mut servo, grows).expect("changed");
    (0..3).for_each(|_| tick());
    let came = third_got.lock().expect("no poison");
    assert!(came.windows(2).all(|pair| pair[1] - pair[0] < 0.01 * both.iter().copied().fold(0.0, f64::max) + 1e-3));

    // A body that goes takes its contacts along.
    drop(came);
    ticks_through(&mut tick, &mut servo, change(&model, &[1], &[Some(0), Some(1)], None)).expect("changed");
    servo.stop();
}

/// The hand on it may be anywhere: it feels what it presses itself, and is not dragged to where the other one pressed.
#[test]
fn another_device_lets_go_of_what_the_tool_held() {
    let model = scene(false, false);
    let (first, got) = pressing(0.03);
    let (second, _) = pressing(0.18);
    let (mut servo, ticks) = started(&model, vec![first, second]);
    let mut tick = ticks.recv().expect("a tick");
    (0..200).for_each(|_| tick());
    assert!(got.lock().expect("no poison")[199] > 0.01);
    let felt = Arc::new(Mutex::new(DVec3::ZERO));
    let feels = Arc::clone(&felt);
    let (mut tick_of_other, place) = (0_u64, DVec3::new(0.05, 0.05, 0.103));
    let read = move |_| {
        tick_of_other += 1;
        Ok(Reading {
            pose: Pose::at(place),
            active: true,
            timestamp_ns: tick_of_other * PERIOD_NS,
            ..Reading::default()
        })
    };
    let write = move |wrench: Wrench| {
        *feels.lock().expect("no poison") = wrench.force;
        Ok(())
    };
    let other = Box::new(Scripted { read, write, limits: DeviceLimits::UNLIMITED });
    let exchanged =
        SceneChange { devices: vec![Some(other), None], ..change(&model, &[0, 1], &[Some(0), Some(1)], None) };
    ticks_through(&mut tick, &mut servo, exchanged).expect("changed");
    assert_eq!(got.lock().expect("no poison").last(), Some(&0.0));
    (0..300).for_each(|_| tick());
    let pressed = *felt.lock().expect("no poison");
    // The middle of the cube's top: nothing pushes sideways.
    assert!(pressed.z > 0.01 && pressed.x.abs() + pressed.y.abs() < 0.05 * pressed.z, "{pressed}");
    // A reset that the loop has not seen when a change comes is not lost: the force ramps in anew.
    servo.reset().expect("room");
    let same = change(&model, &[0, 1], &[Some(0), Some(1)], None);
    ticks_through(&mut tick, &mut servo, same).expect("changed");
    assert!(felt.lock().expect("no poison").z < 0.5 * pressed.z);
    servo.stop();
}

#[test]
fn changes_that_cannot_be_leave_the_loop_as_it_was() {
    let model = scene(false, false);
    let (first, got) = pressing(0.03);
    let (second, _) = pressing(0.18);
    let (mut servo, ticks) = started(&model, vec![first, second]);
    let mut tick = ticks.recv().expect("a tick");
    (0..200).for_each(|_| tick());
    let refused = |answer: palpate_core::Result<()>, reason: &str| {
        let message = answer.expect_err("refused").to_string();
        assert!(message.contains(reason), "{message}");
    };
    refused(servo.change(change(&model, &[0, 1], &[Some(0), None], None)), "tool 1 is new, and has no device");
    let bad = Settings { time_scale: f64::NAN, ..settings() };
    let asked = SceneChange { settings: bad, ..change(&model, &[0, 1], &[Some(0), Some(1)], None) };
    refused(servo.change(asked), "time scale");
    let records = servo.begin_recording().expect("records");
    tick();
    refused(servo.change(change(&model, &[0], &[Some(0)], None)), "stop the recording first");
    drop(records);
    // Nobody ticks: given up, and never made later.
    let ended = std::thread::scope(|scope| {
        let ended = scope.spawn(|| servo.end_recording());
        while !ended.is_finished() {
            tick();
        }
        ended.join().is_ok()
    });
    assert!(ended);
    refused(servo.change(change(&model, &[0], &[Some(0)], None)), "does not tick");
    (0..100).for_each(|_| tick());
    assert!(*got.lock().expect("no poison").last().expect("a force") >= 0.0);
    ticks_through(&mut tick, &mut servo, change(&model, &[0, 1], &[Some(0), Some(1)], None)).expect("changed");
    servo.stop();
}
