//! The loop by its whole tick: on any thread, with any device, whatever goes wrong.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use glam::DVec3;
use palpate_core::simulation::{Input, Model, Pose, Scratch, Snapshot, State, Strike, step};
use palpate_devices::simulated::{Target, simulated};
use palpate_devices::{Buttons, Device, DeviceFault, DeviceLimits, Reading, Wrench, known};
use palpate_servo::{
    Fault, FaultReason, ForceLoop, LoopHandle, SafetyLimits, Scheduling, Script, Servo, Settings, StrainPreparer,
    TickRecord, now_ns, run,
};

use crate::common::{PERIOD, PERIOD_NS, Scripted, device, scene, settings, single};

/// Other programs on the machine must not decide which ticks have a fault.
fn patient() -> SafetyLimits {
    SafetyLimits { max_compute: f64::INFINITY, max_overruns: u32::MAX, ..SafetyLimits::default() }
}

/// A tip 1 mm in the first cube.
fn pressing(now_ns: u64) -> Reading {
    let pose = Pose::at(DVec3::new(0.05, 0.05, 0.104));
    Reading { pose, active: true, timestamp_ns: now_ns, ..Reading::default() }
}

fn new(model: Arc<Model>, devices: Vec<Box<dyn Device>>) -> (ForceLoop, LoopHandle) {
    ForceLoop::new(model, devices, patient(), settings()).expect("a valid loop")
}

/// Ticks some times; the forces on the devices at the last.
fn tick(force_loop: &mut ForceLoop, handle: &mut LoopHandle, ticks: std::ops::Range<u64>) -> [f64; 2] {
    ticks.for_each(|tick| force_loop.tick(tick * PERIOD_NS, PERIOD));
    let wrenches = &handle.latest().status.wrenches;
    [wrenches[0].force.z, wrenches[1].force.z]
}

/// Poses and buttons of two tools: the first presses, slides and holds on, the second comes and goes.
fn script_of_two(ticks: usize) -> (Vec<Pose>, Vec<bool>) {
    let mut poses = Vec::new();
    for tick in 0..ticks {
        let t = tick as f64 * PERIOD;
        poses.push(Pose::at(DVec3::new(0.03 + 0.02 * t, 0.05, 0.105 - 0.01 * (9.0 * t).sin())));
        let out = tick % 400 < 150;
        poses.push(Pose::at(if out { DVec3::NAN } else { DVec3::new(0.24 - 0.3 * t, 0.05, 0.103) }));
    }
    let grabs = (0..2 * ticks).map(|k| k % 2 == 0 && (500..600).contains(&(k / 2))).collect();
    (poses, grabs)
}

#[test]
fn a_drivers_callback_gives_the_bits_of_an_offline_run() {
    const TICKS: usize = 900;
    let model = scene(true, false);
    let (poses, grabs) = script_of_two(TICKS);
    let blow = DVec3::new(0.0, 0.0, -1e-3);
    let point = DVec3::new(0.02, 0.02, 0.1);
    let strike = Strike { body: 0, point, impulse: blow, radius: 0.02, duration: 3e-3 };
    let script =
        Script { period: PERIOD, poses: &poses, grabs: &grabs, strikes: &[(700, strike)], watch: &[], devices: &[] };
    let mut pairs = std::collections::BTreeSet::new();
    let each = |record: &TickRecord| pairs.extend(record.output.contacts.iter().map(|c| (c.tool, c.body)));
    let strain = StrainPreparer::new(&model);
    let recording = run(&model, patient(), settings(), &strain, &script, each).expect("a valid script");
    assert_eq!(recording.fault, None);
    assert_eq!(recording.energies[0].1.len(), TICKS);

    let devices = (0..2usize).map(|tool| {
        let (poses, grabs, mut tick) = (poses.clone(), grabs.clone(), 0);
        let mut latest = Pose::default();
        device(move |now_ns| {
            let (pose, grab) = (poses[2 * tick + tool], grabs[2 * tick + tool]);
            tick += 1;
            let active = pose.is_finite();
            latest = if active { pose } else { latest };
            let buttons = if grab { Buttons::GRAB } else { Buttons::default() };
            Ok(Reading { pose: latest, buttons, active, timestamp_ns: now_ns, ..Reading::default() })
        })
    });
    let (mut force_loop, mut handle) = new(model, devices.collect());
    let callback = std::thread::spawn(move || {
        let mut wrenches = Vec::new();
        for tick in 0..TICKS {
            if tick == 700 {
                handle.strike(strike).expect("room");
            }
            force_loop.tick(now_ns(), PERIOD);
            wrenches.extend_from_slice(&handle.latest().status.wrenches[..2]);
        }
        wrenches
    });
    let wrenches = callback.join().expect("no panic");
    let bits = |v: DVec3| v.to_array().map(f64::to_bits);
    let live: Vec<_> = wrenches.iter().map(|wrench| bits(wrench.force)).collect();
    let offline: Vec<_> = recording.forces.iter().copied().map(bits).collect();
    assert_eq!(live, offline);
    let pushed = |tool: usize| recording.forces[tool..].iter().step_by(2).filter(|f| f.z > 0.0).count();
    assert!(pushed(0) > 200 && pushed(1) > 200, "{} {}", pushed(0), pushed(1));
    assert_eq!(pairs.into_iter().collect::<Vec<_>>(), [(0, 0), (1, 0), (1, 1)]);
}

/// A strike so weak that the displacements it makes would be subnormal numbers: zero in every tick, on any thread.
#[test]
fn subnormal_numbers_are_zero_live_and_offline() {
    let model = single(true);
    let impulse = DVec3::new(0.0, 0.0, -1e-304);
    let point = DVec3::new(0.02, 0.02, 0.1);
    let strike = Strike { body: 0, point, impulse, radius: 0.02, duration: 1e-3 };
    let nodes: Vec<u32> = (0..20).collect();
    let bits = |moved: Vec<DVec3>| moved.iter().flat_map(|u| u.to_array()).map(f64::to_bits).collect::<Vec<_>>();

    let poses = vec![Pose::at(DVec3::NAN); 100];
    let watch: Vec<_> = nodes.iter().map(|&node| (0, node)).collect();
    let script =
        Script { period: PERIOD, poses: &poses, grabs: &[], strikes: &[(0, strike)], watch: &watch, devices: &[] };
    let strain = StrainPreparer::new(&model);
    let recording = run(&model, patient(), settings(), &strain, &script, |_| ()).expect("a valid script");
    let offline = bits(recording.displacements[99 * nodes.len()..].to_vec());

    let idle = device(|now_ns| Ok(Reading { timestamp_ns: now_ns, ..Reading::default() }));
    let (mut force_loop, mut handle) = new(model.clone(), vec![idle]);
    handle.strike(strike).expect("room");
    (0..100).for_each(|_| force_loop.tick(now_ns(), PERIOD));
    assert_eq!(bits(handle.latest().state.displacements_of(&model, 0, &nodes)), offline);

    // The step zeroes them itself, whatever the mode of the thread.
    let (mut state, mut scratch, mut snapshot) = (State::new(&model), Scratch::new(&model), Snapshot::new(&model));
    for tick in 0..100 {
        let mut input = Input::default();
        input.controls.strike = (tick == 0).then_some(strike);
        step(&model, &mut state, &mut scratch, &input);
    }
    state.snapshot_into(&mut snapshot);
    assert_eq!(bits(snapshot.displacements_of(&model, 0, &nodes)), offline);
    assert!(offline.into_iter().all(|bits| f64::from_bits(bits) == 0.0));
}

#[test]
fn what_does_not_fit_the_scene_is_an_error() {
    let model = scene(false, false);
    let make = |devices: usize, limits: SafetyLimits, settings: Settings| {
        let devices = (0..devices).map(|_| device(|now_ns| Ok(pressing(now_ns)))).collect();
        ForceLoop::new(model.clone(), devices, limits, settings).err().map(|error| error.to_string())
    };
    let refused = |message: Option<String>, part: &str| {
        let message = message.unwrap_or_else(|| panic!("accepted: {part}"));
        assert!(message.contains(part) && !message.contains('\n'), "{message}");
    };
    assert_eq!(make(2, patient(), settings()), None);
    refused(make(1, patient(), settings()), "2 tools takes as many devices, got 1");
    refused(make(3, patient(), settings()), "2 tools takes as many devices, got 3");
    refused(make(2, SafetyLimits { max_force: f64::NAN, ..patient() }, settings()), "largest force");
    refused(make(2, SafetyLimits { ramp: -1.0, ..patient() }, settings()), "ramp");
    refused(make(2, SafetyLimits { max_damping: f64::NAN, ..patient() }, settings()), "strongest damping");
    refused(make(2, patient(), Settings { watch: Some((2, 0)), ..settings() }), "no body 2");
    refused(make(2, patient(), Settings { watch: Some((1, 100_000)), ..settings() }), "no surface node 100000");
    let (_, mut handle) = new(model.clone(), (0..2).map(|_| device(|now_ns| Ok(pressing(now_ns)))).collect());
    let struck = handle.strike(Strike { body: 7, ..Strike::default() });
    refused(struck.err().map(|error| error.to_string()), "no body 7");
    refused(make(2, patient(), Settings { time_scale: f64::NAN, ..settings() }), "time scale");

    let weak = DeviceLimits { max_stiffness: 2000.0, rate: Some(800.0), ..DeviceLimits::UNLIMITED };
    let with_limits = |limits| -> Box<dyn Device> {
        Box::new(Scripted { read: |now_ns| Ok(pressing(now_ns)), write: |_| Ok(()), limits })
    };
    let start = |limits, rate| {
        let scene = single(false);
        let strain = StrainPreparer::new(&scene);
        let servo =
            Servo::start(scene, vec![with_limits(limits)], patient(), settings(), Scheduling::at(rate), strain, None);
        servo.err().map(|error| error.to_string())
    };
    refused(start(weak, 500.0), "holds at most 2000 N/m: lower max_stiffness to 2000");
    let slow = DeviceLimits { max_stiffness: f64::INFINITY, ..weak };
    refused(start(slow, 1000.0), "at most 800");
    assert_eq!(start(slow, 800.0), None);
    // 2 b / T is 3200 N/m for 2 N s/m at 800 Hz, and 6400 for twice that; a millisecond of delay leaves 2461 of those.
    let damped = |own_damping, delay| DeviceLimits { own_damping: Some(own_damping), delay, ..slow };
    refused(start(damped(2.0, 0.0), 800.0), "holds at most 3200 N/m at 800 Hz: lower max_stiffness to 3200");
    assert_eq!(start(damped(4.0, 0.0), 800.0), None);
    refused(start(damped(4.0, 1e-3), 800.0), "holds at most 2461 N/m at 800 Hz");
    refused(start(DeviceLimits { max_damping: f64::NAN, ..slow }, 800.0), "strongest damping of NaN");
    refused(start(DeviceLimits { delay: -1e-3, ..slow }, 800.0), "delay of -0.001");
    refused(start(DeviceLimits::UNLIMITED, 99.0), "100 to 10000 Hz");
}

/// A tool that may ask for 5000 N/m is refused by every device that holds less, with what it holds.
#[test]
fn known_devices_refuse_what_they_do_not_hold() {
    for (name, limits) in known::ALL {
        let device = Box::new(Scripted { read: |now_ns| Ok(pressing(now_ns)), write: |_| Ok(()), limits });
        let refused = ForceLoop::new(single(false), vec![device], patient(), settings()).err();
        let expected = (limits.max_stiffness < 5000.0).then(|| {
            let held = limits.max_stiffness;
            format!("tool 0 may ask for 5000 N/m, its device holds at most {held} N/m: lower max_stiffness to {held}")
        });
        assert_eq!(refused.map(|error| error.to_string()), expected, "{name}");
    }
}

#[test]
fn settings_that_do_not_fit_leave_those_there_are() {
    let (mut force_loop, mut handle) = new(single(false), vec![device(|now_ns| Ok(pressing(now_ns)))]);
    let good = tick(&mut force_loop, &mut handle, 0..400)[0];
    let bad = Settings { watch: Some((0, u32::MAX)), friction: [0.0; 4], ..settings() };
    assert!(handle.set(bad).is_err());
    assert_eq!(tick(&mut force_loop, &mut handle, 400..401)[0], good);
}

#[test]
fn the_lower_limit_of_scene_and_device_counts() {
    let limits = DeviceLimits { max_force: 0.125, ..DeviceLimits::UNLIMITED };
    let weak = Scripted { read: |now_ns| Ok(pressing(now_ns)), write: |_| Ok(()), limits };
    let (mut force_loop, mut handle) = new(single(false), vec![Box::new(weak)]);
    assert!((tick(&mut force_loop, &mut handle, 0..400)[0] - 0.125).abs() < 1e-12);
}

/// One tool's fault takes its own wrench away; the other tool goes on, and a reset brings both back.
#[test]
fn a_fault_of_a_device_latches_its_tool() {
    let at = |tick: u64| move |now_ns: u64| now_ns / PERIOD_NS == tick;
    let (read_fails, write_fails) = (at(500), at(1000));
    let second = |now_ns: u64| {
        let pose = Pose::at(DVec3::new(0.2, 0.05, 0.104));
        Ok(Reading { pose, ..pressing(now_ns) })
    };
    let now = Arc::new(AtomicU64::new(0));
    let seen = now.clone();
    let first = Scripted {
        read: move |now_ns| {
            seen.store(now_ns, Ordering::Relaxed);
            if read_fails(now_ns) { Err(DeviceFault::Disconnected) } else { Ok(pressing(now_ns)) }
        },
        write: move |_| if write_fails(now.load(Ordering::Relaxed)) { Err(DeviceFault::Driver(3)) } else { Ok(()) },
        limits: DeviceLimits::UNLIMITED,
    };
    let (mut force_loop, mut handle) = new(scene(false, false), vec![Box::new(first), device(second)]);
    let both = tick(&mut force_loop, &mut handle, 0..500);
    assert!(both[0] > 0.1 && both[1] > 0.1);
    for (ticks, fault) in [(500..600, DeviceFault::Disconnected), (1000..1100, DeviceFault::Driver(3))] {
        let end = ticks.end;
        // A write that fails may have gone out; the next one is zero.
        let forces = tick(&mut force_loop, &mut handle, ticks);
        assert_eq!(forces, [0.0, both[1]]);
        let expected = Fault { tool: Some(0), reason: FaultReason::Device(fault) };
        assert_eq!(handle.latest().status.fault, Some(expected));
        assert!(expected.to_string().starts_with("tool 0: the device"));
        handle.reset().expect("room");
        let again = tick(&mut force_loop, &mut handle, end..end + 400);
        assert!((again[0] / both[0] - 1.0).abs() < 1e-9 && (again[1] / both[1] - 1.0).abs() < 1e-9);
        assert_eq!(handle.latest().status.fault, None);
    }
}

#[test]
fn a_bad_position_latches_and_keeps_its_reason() {
    let read = |now_ns: u64| {
        let bad = Pose::at(DVec3::NAN);
        Ok(Reading { pose: if now_ns / PERIOD_NS == 300 { bad } else { pressing(now_ns).pose }, ..pressing(now_ns) })
    };
    let (mut force_loop, mut handle) = new(single(false), vec![device(read)]);
    assert!(tick(&mut force_loop, &mut handle, 0..300)[0] > 0.1);
    assert_eq!(tick(&mut force_loop, &mut handle, 300..900)[0], 0.0);
    let fault = handle.latest().status.fault.expect("a fault");
    assert_eq!(fault, Fault { tool: Some(0), reason: FaultReason::ReadingNotFinite });
}

#[test]
fn ticks_that_take_too_long_latch_until_a_reset() {
    let slow = |now_ns: u64| {
        let start = Instant::now();
        while now_ns / PERIOD_NS >= 300 && now_ns / PERIOD_NS < 303 && start.elapsed() < Duration::from_millis(2) {}
        Ok(pressing(now_ns))
    };
    let (model, limits) = (single(false), SafetyLimits { max_overruns: 3, ..patient() });
    // Ticks that are meant to be fast get a period that other programs on the machine leave them.
    let mut loose = ForceLoop::new(model, vec![device(slow)], limits, settings()).expect("a valid loop");
    let (force_loop, handle) = (&mut loose.0, &mut loose.1);
    (0..300).for_each(|tick| force_loop.tick(tick * PERIOD_NS, 1.0));
    (300..303).for_each(|tick| force_loop.tick(tick * PERIOD_NS, 1e-3));
    assert!(handle.latest().status.wrenches[0].force.z > 0.1);
    force_loop.tick(303 * PERIOD_NS, 1.0);
    let status = handle.latest().status;
    assert_eq!(status.fault, Some(Fault { tool: None, reason: FaultReason::Overrun }));
    assert_eq!(status.wrenches[0], Wrench::default());
    assert!(status.missed_computing >= 6);
    handle.reset().expect("room");
    (304..900).for_each(|tick| force_loop.tick(tick * PERIOD_NS, 1.0));
    assert_eq!(handle.latest().status.fault, None);
    assert!(handle.latest().status.wrenches[0].force.z > 0.1);
}

#[test]
fn a_lost_store_and_a_panic_outlast_resets() {
    let panicking =
        |now_ns: u64| if now_ns / PERIOD_NS == 700 { panic!("a driver's mistake") } else { Ok(pressing(now_ns)) };
    for lost in [true, false] {
        let written = Arc::new(Mutex::new(Wrench::default()));
        let last = written.clone();
        let write = move |wrench| {
            *last.lock().expect("no poison") = wrench;
            Ok(())
        };
        let first = Scripted { read: panicking, write, limits: DeviceLimits::UNLIMITED };
        let (mut force_loop, mut handle) = new(single(false), vec![Box::new(first)]);
        assert!(tick(&mut force_loop, &mut handle, 0..600)[0] > 0.1);
        if lost {
            force_loop.latch(FaultReason::StoreLost);
        }
        let ticks = if lost { 600..650 } else { 600..750 };
        let reason = if lost { FaultReason::StoreLost } else { FaultReason::Panic };
        assert_eq!(tick(&mut force_loop, &mut handle, ticks)[0], 0.0);
        handle.reset().expect("room");
        assert_eq!(tick(&mut force_loop, &mut handle, 750..1100)[0], 0.0);
        assert_eq!(handle.latest().status.fault, Some(Fault { tool: None, reason }));
        assert_eq!(*written.lock().expect("no poison"), Wrench::default());
    }
}

/// The row of a tick counts all that the tick did, and the watched node only where one is watched.
#[test]
fn a_row_has_its_own_ticks_time_and_watch() {
    let tick_of = Arc::new(AtomicU64::new(0));
    let seen = tick_of.clone();
    let busy = Scripted {
        read: move |now_ns| {
            seen.store(now_ns / PERIOD_NS, Ordering::Relaxed);
            Ok(pressing(now_ns))
        },
        write: move |_| {
            let start = Instant::now();
            while tick_of.load(Ordering::Relaxed) == 5 && start.elapsed() < Duration::from_millis(20) {}
            Ok(())
        },
        limits: DeviceLimits::UNLIMITED,
    };
    let model = single(false);
    let (mut force_loop, mut handle) = new(model.clone(), vec![Box::new(busy)]);
    tick(&mut force_loop, &mut handle, 0..10);
    handle.set(Settings { watch: Some((0, 30)), ..settings() }).expect("valid settings");
    tick(&mut force_loop, &mut handle, 10..11);
    let watched = handle.latest().state.displacements_of(&model, 0, &[30])[0];
    drop(force_loop);
    let mut rows = Vec::new();
    handle.drain_log(|row| rows.push(row));
    assert_eq!(rows.len(), 11);
    assert!(rows[5].compute_us >= 20e3);
    assert!((rows[5].time - 5e-3).abs() < 1e-12);
    assert!(rows[..10].iter().all(|row| row.watched.is_none()));
    assert!((rows[10].watched.expect("watched") - watched).length() < 1e-15);
    assert_eq!(rows[10].forces[0], rows[10].force);
}

#[test]
fn a_servo_keeps_its_rate_and_leaves_its_devices_without_a_wrench() {
    let (mut target, first) = simulated();
    target.set(Target { pose: pressing(0).pose, active: true, ..Target::default() });
    let written = Arc::new(Mutex::new(Vec::new()));
    let all = written.clone();
    let mut first = first;
    let device = Scripted {
        read: move |now_ns| first.read(now_ns, PERIOD),
        write: move |wrench: Wrench| {
            all.lock().expect("no poison").push(wrench.force.z);
            Ok(())
        },
        limits: DeviceLimits::UNLIMITED,
    };
    let scene = single(false);
    let strain = StrainPreparer::new(&scene);
    let servo = Servo::start(scene, vec![Box::new(device)], patient(), settings(), Scheduling::at(500.0), strain, None);
    let mut servo = servo.expect("a running loop");
    let (start, mut status) = (Instant::now(), servo.latest().status);
    while status.ticks < 250 && start.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(10));
        status = servo.latest().status;
    }
    servo.stop();
    // Each deadline of the grid is a tick or a missed one.
    let deadlines = 500.0 * status.time + 1.0;
    assert!((deadlines - (status.ticks + status.missed_deadlines()) as f64).abs() < 2.0, "{status:?}");
    assert!(status.wrenches[0].force.z > 0.0 && status.compute.max > 0.0);
    let written = written.lock().expect("no poison");
    assert!(written.len() > 250 && written.last() == Some(&0.0));
}
