//! The hand-offs between the loop's thread and all others, at once: for a sanitizer of threads, which sees unordered accesses,
//! and without one a test that nothing is lost or torn.

mod stored;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use glam::DVec3;
use palpate_devices::simulated::{Target, simulated};
use palpate_devices::{Device, Pose};
use palpate_servo::{ForceLoop, SafetyLimits, StrainPreparer};

use stored::{SCENES, model, settings};

const PERIOD: f64 = 1e-3;
const TICKS: u64 = 3000;

/// By itself, for the harness of tests is not made for sanitizers. Needs the store that `across_builds` leaves in the target
/// folder.
fn main() {
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
        (0..TICKS).for_each(|tick| force_loop.tick(1_000_000 * tick, PERIOD));
        ended.store(true, Ordering::Release);
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
    while !over.load(Ordering::Acquire) {
        let latest = handle.latest();
        let (status, time) = (latest.status, latest.state.body_time(0));
        assert!(status.ticks >= last, "the latest tick is not older than the one before");
        assert!(time >= 0.0 && latest.state.contacts.iter().all(|(contact, _)| contact.force.is_finite()));
        last = status.ticks;
        handle.drain_log(|_| rows += 1);
        changes += 1;
        let mut changed = settings();
        (changed.friction[0], changed.time_scale) = (0.1 + 1e-4 * f64::from(changes % 100), 1.0);
        handle.set(changed).expect("valid settings");
        match changes % 50 {
            10 => records = handle.begin_recording().ok(),
            40 => handle.end_recording(),
            _ => {}
        }
        if let Some(ring) = &mut records {
            while let Ok(record) = ring.pop() {
                assert_eq!(record.input.settings.time_scale, 1.0);
                assert!(record.output.tools[0].wrench.force.is_finite());
            }
        }
    }
    pointing.join().expect("no panic");
    let force_loop = ticking.join().expect("no panic");
    handle.drain_log(|_| rows += 1);
    assert!(rows > 0 && handle.latest().status.ticks == TICKS);
    drop(force_loop);
}
