//! The hand-offs between the loop's thread and all others, at once: for a sanitizer of threads, which sees unordered accesses,
//! and without one a test that nothing is lost or torn.

mod stored;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use glam::DVec3;
use palpate_core::simulation::{PreviousRanks, Strike};
use palpate_devices::simulated::{Target, simulated};
use palpate_devices::{Device, Pose};
use palpate_servo::{ForceLoop, SafetyLimits, SceneChange, Scheduling, Servo, StrainPreparer};

use stored::{SCENES, model, settings};

const PERIOD: f64 = 1e-3;
const TICKS: u64 = 3000;
const EXCHANGES: u32 = 20;

/// By itself, for the harness of tests is not made for sanitizers. Needs the store that `across_builds` leaves in the target
/// folder.
fn main() {
    hand_offs();
    exchange();
}

fn strike(rank: u32) -> Strike {
    let impulse = DVec3::new(0.0, 0.0, -1e-9 * f64::from(rank));
    Strike { body: 0, point: DVec3::new(0.02, 0.02, 0.1), impulse, radius: 0.02, duration: 1e-3 }
}

/// A loop that another thread ticks: settings, strikes, frames, log and recordings.
fn hand_offs() {
    let model = model(&SCENES[2]);
    let limits = SafetyLimits { max_compute: f64::INFINITY, max_overruns: u32::MAX, ..SafetyLimits::default() };
    let (mut targets, device) = simulated();
    let devices = vec![Box::new(device) as Box<dyn Device>];
    let (mut force_loop, mut handle) =
        ForceLoop::new(model.clone(), devices, limits, settings()).expect("a valid loop");
    let _worker = force_loop.limit_strain(&mut handle, StrainPreparer::new(&model)).expect("a thread");
    let over = Arc::new(AtomicBool::new(false));
    let ended = over.clone();
    let ticking = std::thread::spawn(move || {
        let mut tick = 0;
        while !ended.load(Ordering::Acquire) {
            force_loop.tick(1_000_000 * tick, PERIOD);
            tick += 1;
        }
        force_loop
    });
    let pointing = std::thread::spawn(move || {
        for step in 0..2000 {
            // A position whose parts belong together.
            let depth = 1e-6 * f64::from(step);
            let pose = Pose::at(DVec3::new(0.03 + depth, 0.05, 0.11 - depth));
            targets.set(Target { pose, active: true, ..Target::default() });
            std::thread::yield_now();
        }
    });
    let (mut records, mut rows, mut last, mut changes) = (None, 0, 0, 0_u32);
    let (mut struck, mut given) = (0_u32, 0.0);
    while last < TICKS || given == 0.0 {
        let latest = handle.latest();
        let (status, time) = (latest.status, latest.state.body_time(0));
        assert!(status.ticks >= last, "the latest tick is not older than the one before");
        assert!(time >= 0.0 && latest.state.contacts.iter().all(|(contact, _)| contact.force.is_finite()));
        last = status.ticks;
        handle.drain_log(|_| rows += 1);
        changes += 1;
        let mut changed = settings();
        (changed.friction[0], changed.time_scale) = (0.1 + 1e-4 * f64::from(changes % 100), 1.0);
        // Refused only where the ring is full.
        let _ = handle.set(changed);
        struck += u32::from(handle.strike(strike(struck + 1)).is_ok());
        match changes % 50 {
            10 => records = handle.begin_recording().ok(),
            40 => handle.end_recording(),
            _ => {}
        }
        if let Some(ring) = &mut records {
            while let Ok(record) = ring.pop() {
                assert_eq!(record.input.settings.time_scale, 1.0);
                assert!(record.output.tools[0].wrench.force.is_finite());
                let strike = record.input.strike.map_or(given, |strike| -1e9 * strike.impulse.z);
                assert!(strike >= given, "strikes come in order");
                given = strike;
            }
        }
    }
    over.store(true, Ordering::Release);
    pointing.join().expect("no panic");
    let force_loop = ticking.join().expect("no panic");
    handle.drain_log(|_| rows += 1);
    assert!(rows > 0 && handle.latest().status.ticks >= TICKS && struck > 0);
    drop(force_loop);
}

/// A loop on its own thread: scenes come in and go out while it is struck, set, drawn and recorded.
fn exchange() {
    let model = model(&SCENES[2]);
    let limits = SafetyLimits { max_compute: f64::INFINITY, max_overruns: u32::MAX, ..SafetyLimits::default() };
    let (_target, device) = simulated();
    let devices = vec![Box::new(device) as Box<dyn Device>];
    let strain = StrainPreparer::new(&model);
    let scheduling = Scheduling::at(1000.0);
    let servo = Servo::start(model.clone(), devices, limits, settings(), scheduling, strain, None);
    let mut servo = servo.expect("a loop");
    let mut previous_ranks = PreviousRanks::default();
    (previous_ranks.bodies[0], previous_ranks.tools[0]) = (Some(0), Some(0));
    for round in 1..=EXCHANGES {
        let next = Arc::new(model.changed(model.bodies.clone(), model.tools.clone()).expect("a valid scene"));
        // Every other time the tool gets another device.
        let device = (round % 2 == 0).then(|| Box::new(simulated().1) as Box<dyn Device>);
        let strain = StrainPreparer::new(&next);
        let change = SceneChange { model: next, previous_ranks, devices: vec![device], settings: settings(), strain };
        servo.change(change).expect("the loop ticks");
        let mut ring = servo.begin_recording().expect("no recording yet");
        let mut rows = 0;
        for step in 0..20 {
            servo.set(settings()).expect("valid settings");
            let _ = servo.strike(strike(step));
            assert!(servo.latest().state.contacts.iter().all(|(contact, _)| contact.force.is_finite()));
            servo.drain_log(|_| rows += 1);
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        let ticks = servo.end_recording();
        let recorded = std::iter::from_fn(|| ring.pop().ok()).count() as u64;
        assert!(recorded == ticks && rows > 0, "{recorded} of {ticks} ticks, {rows} rows");
    }
    servo.stop();
}
