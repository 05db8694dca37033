//! What goes wrong with one device ends its own force within the tick that sees it, and nothing else; the reason is told, what
//! is recorded up to then and beyond is made again.

use glam::DVec3;
use palpate_devices::{Device, DeviceFault, DeviceLimits, Pose, Reading, Twist};
use palpate_servo::{FaultReason, ForceLoop, Replay, SafetyLimits, StrainPreparer, TickRecord};

use crate::common::{PERIOD, PERIOD_NS, Scripted, scene, settings};

/// The tick in which it goes wrong, that of the reset, and how many there are.
const WRONG: u64 = 400;
const RESET: u64 = 700;
const TICKS: u64 = 1200;
/// The scene's longest age of a reading, in ticks.
const OLDEST: u64 = 50;

/// What the first device says from `WRONG` on, given what a good one would say.
type Injected = fn(u64, Reading) -> Result<Reading, DeviceFault>;

fn once(tick: u64, good: Reading, bad: Reading) -> Reading {
    if tick == WRONG { bad } else { good }
}

fn moved(good: Reading, by: DVec3) -> Reading {
    Reading { pose: Pose { position: good.pose.position + by, ..good.pose }, ..good }
}

/// Name, what is injected, why there is no force then, and so many ticks later.
const FAULTS: [(&str, Injected, FaultReason, u64); 7] = [
    (
        "a position that is not a number",
        |tick, good| Ok(once(tick, good, moved(good, DVec3::NAN))),
        FaultReason::ReadingNotFinite,
        0,
    ),
    (
        "a velocity that is infinite",
        |tick, good| {
            let twist = Twist { linear: DVec3::new(0.0, f64::INFINITY, 0.0), ..good.twist };
            Ok(once(tick, good, Reading { twist, ..good }))
        },
        FaultReason::ReadingNotFinite,
        0,
    ),
    ("a jump of a metre", |tick, good| Ok(once(tick, good, moved(good, DVec3::X))), FaultReason::JumpingInput, 0),
    (
        "a jump of a metre into the body",
        |tick, good| Ok(once(tick, good, moved(good, -DVec3::Z))),
        FaultReason::JumpingInput,
        0,
    ),
    (
        "measurements that stop",
        |tick, good| {
            let measured = if (WRONG..RESET).contains(&tick) { WRONG - 1 } else { tick };
            Ok(Reading { timestamp_ns: measured * PERIOD_NS, ..good })
        },
        FaultReason::StaleInput,
        OLDEST,
    ),
    (
        "a cable pulled out",
        |tick, good| if tick == WRONG { Err(DeviceFault::Disconnected) } else { Ok(good) },
        FaultReason::Device(DeviceFault::Disconnected),
        0,
    ),
    (
        "motors off",
        |tick, good| if tick == WRONG { Err(DeviceFault::MotorsOff) } else { Ok(good) },
        FaultReason::Device(DeviceFault::MotorsOff),
        0,
    ),
];

/// A tip 1 mm in one of the two cubes.
fn pressing(tool: usize, tick: u64) -> Reading {
    let x = if tool == 0 { 0.05 } else { 0.2 };
    let pose = Pose::at(DVec3::new(x, 0.05, 0.104));
    Reading { pose, active: true, timestamp_ns: tick * PERIOD_NS, ..Reading::default() }
}

fn limits() -> SafetyLimits {
    SafetyLimits { max_compute: f64::INFINITY, max_overruns: u32::MAX, ..SafetyLimits::default() }
}

/// A device with sensors: it cannot jump.
fn sensing(read: impl FnMut(u64) -> Result<Reading, DeviceFault> + Send + 'static) -> Box<dyn Device> {
    let limits = DeviceLimits { max_speed: Some(10.0), ..DeviceLimits::UNLIMITED };
    Box::new(Scripted { read, write: |_| Ok(()), limits })
}

fn record(injected: Injected) -> Vec<TickRecord> {
    let devices = vec![
        sensing(move |now_ns| injected(now_ns / PERIOD_NS, pressing(0, now_ns / PERIOD_NS))),
        sensing(|now_ns| Ok(pressing(1, now_ns / PERIOD_NS))),
    ];
    let (mut force_loop, mut handle) =
        ForceLoop::new(scene(false, false), devices, limits(), settings()).expect("a valid loop");
    let mut records = handle.begin_recording().expect("no recording yet");
    for tick in 0..TICKS {
        if tick == RESET {
            handle.reset().expect("room");
        }
        force_loop.tick(tick * PERIOD_NS, PERIOD);
    }
    std::iter::from_fn(|| records.pop().ok()).collect()
}

#[test]
fn force_ends_in_the_tick_that_sees_the_fault_and_the_loop_lives() {
    for (name, injected, reason, later) in FAULTS {
        let records = record(injected);
        assert_eq!(records.len() as u64, TICKS, "{name}");
        let force = |tick: u64, tool: usize| records[tick as usize].output.tools[tool].wrench.force;
        let seen = WRONG + later;
        assert!(force(seen - 1, 0).z > 0.1, "{name}: pressed until then");
        for tick in seen..RESET {
            assert_eq!(force(tick, 0), DVec3::ZERO, "{name}: tick {tick}");
            assert_eq!(records[tick as usize].output.tools[0].fault, Some(reason), "{name}: tick {tick}");
            assert_eq!(force(tick, 1), force(seen - 1, 1), "{name}: the other tool goes on");
        }
        assert!(!reason.to_string().is_empty());
        let last = TICKS - 1;
        assert!((force(last, 0).z / force(WRONG - 1, 0).z - 1.0).abs() < 1e-9, "{name}: back after the reset");
        assert!(records.iter().flat_map(|r| &r.output.tools).all(|t| t.wrench.force.is_finite()), "{name}");
    }
}

#[test]
fn what_was_recorded_with_faults_is_made_again() {
    for (name, injected, ..) in FAULTS {
        let model = scene(false, false);
        let devices = vec![DeviceLimits { max_speed: Some(10.0), ..DeviceLimits::UNLIMITED }; 2];
        let strain = StrainPreparer::new(&model);
        let mut replay = Replay::new(&model, &devices, limits(), settings(), strain).expect("a valid loop");
        for record in record(injected) {
            let differences = replay.tick(&record).expect("valid settings");
            assert!(differences.is_empty(), "{name}: {}", differences[0]);
        }
    }
}
