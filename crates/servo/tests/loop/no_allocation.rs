//! A tick never allocates: counted for every kind of tick.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec3;
use palpate_core::simulation::{Contact, Mode, Pose, Snapshot, Strike};
use palpate_core::strain::StrainMeasure;
use palpate_devices::emulated::{Command, Hand, HandTarget, Tip, Waypoint, emulated, known};
use palpate_devices::{Buttons, Device, DeviceLimits, Reading, Wrench};
use palpate_servo::{ForceLoop, LoopHandle, Published, SafetyLimits, Settings, StrainPreparer};

use crate::common::{PERIOD, PERIOD_NS, device, scene, settings};
use crate::counting_allocator::allocations;

const TICKS: u64 = 2600;
/// Ticks between two recordings, and what the ticks are in which one begins and ends: in a contact, most times.
const RECORDED: u64 = 370;
const RECORDING: [&str; 2] = ["recording begins", "recording ends"];
const BAD_NUMBER: u64 = 2200;
const RESET: u64 = 2300;
/// Reached by the presses of the first tool.
const STRAIN_LIMIT: f64 = 0.03;
/// Ticks between two breaks in which the strain of contacts is prepared.
const BREAK: u64 = 10;

/// The first tool presses the first body again and again, holds on to it, goes to the second body, and from there to where
/// it may not touch.
fn first_tool(tick: u64) -> Reading {
    let depth = 0.012 * (6e-3 * tick as f64).sin();
    let (x, y, above) = match tick {
        BAD_NUMBER => (f64::NAN, 0.05, 0.0),
        0..1200 => (0.03 + 2e-5 * tick as f64, 0.05, 0.005 - depth),
        1200..1500 => (0.05, 0.05, 0.01),
        1500..1900 | RESET.. => (0.22, 0.05, 0.003),
        1900..2000 => (0.16, 0.05, 0.02),
        _ => (0.16, 0.05, 0.003),
    };
    let buttons = if (1200..1500).contains(&tick) { Buttons::GRAB } else { Buttons::default() };
    Reading { pose: Pose::at(DVec3::new(x, y, 0.1 + above)), buttons, active: true, ..Reading::default() }
}

/// The second tool is on the first body for a while, and comes to it anew when the first has left it.
fn second_tool(tick: u64) -> Reading {
    let pose = Pose::at(DVec3::new(0.07, 0.05, 0.101));
    let active = matches!(tick, 300..900 | 1000..1450 | 1520..2000);
    Reading { pose, active, ..Reading::default() }
}

fn settings_at(tick: u64) -> Settings {
    let watch = (tick / 200 % 2 == 1).then_some((0, 7));
    Settings { watch, strain_limit: STRAIN_LIMIT, ..settings() }
}

const STRIKES: [u64; 2] = [100, 1600];

fn strike() -> Strike {
    let (point, impulse) = (DVec3::new(0.02, 0.02, 0.1), DVec3::new(0.0, 0.0, -1e-4));
    Strike { body: 0, point, impulse, radius: 0.02, duration: 3e-3 }
}

/// What kinds of tick that was, given the contacts before it.
fn kinds(tick: u64, before: &[(u64, usize)], published: &Published) -> Vec<&'static str> {
    let Published { status, state } = published;
    let now = contacts(state);
    let both = |holds: bool, name: &'static str| holds.then_some(name);
    [
        both(now.is_empty(), "free"),
        both(now.iter().any(|contact| !before.contains(contact)), "begin"),
        both(!now.is_empty() && now == before, "hold"),
        both(before.iter().any(|contact| !now.contains(contact)), "end"),
        both(state.contacts.iter().any(|(contact, _)| contact.mode == Mode::Grab), "grab"),
        both(now.iter().filter(|contact| contact.1 == 0).count() == 2, "two tools"),
        both([0, 1].iter().all(|body| now.iter().any(|contact| contact.1 == *body)), "two bodies"),
        both(state.energy(0).is_some_and(|energy| energy.kinetic > 0.0), "motion"),
        both(STRIKES.contains(&tick), "strike"),
        both(tick == RESET, "reset"),
        both(status.fault.is_some(), "fault"),
        both(state.tools[0].refused[1].is_some(), "refused"),
        both(settings_at(tick).watch.is_some(), "watch"),
        both(status.limited[0], "limited"),
        both(status.ports.iter().any(|port| port.owed > 0.0), "owed"),
        both(state.contacts.iter().any(|(contact, _)| is_steep(contact)), "steep"),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// Whether a press carries more along the surface than into it: it may slip.
fn is_steep(contact: &Contact) -> bool {
    let pressing = -contact.force.dot(contact.normal);
    contact.mode == Mode::Press && (contact.force + contact.normal * pressing).length() > pressing
}

/// Serial and body of the contacts.
fn contacts(state: &Snapshot) -> Vec<(u64, usize)> {
    state.contacts.iter().map(|(contact, _)| (contact.serial, contact.body)).collect()
}

/// Ticks and allocations by kind of tick.
fn count(mut force_loop: ForceLoop, mut handle: LoopHandle) -> BTreeMap<&'static str, (u64, u64)> {
    let mut counts = BTreeMap::new();
    let (mut before, mut records) = (Vec::new(), None);
    for tick in 0..TICKS {
        handle.set(settings_at(tick)).expect("valid settings");
        if tick == RESET {
            handle.reset().expect("room");
        }
        if STRIKES.contains(&tick) {
            // One waits for the tick after.
            (0..2).for_each(|_| handle.strike(strike()).expect("room"));
        }
        match tick % RECORDED {
            0 => records = Some(handle.begin_recording().expect("no recording yet")),
            60 => handle.end_recording(),
            _ => {}
        }
        if tick % BREAK == 0 {
            std::thread::sleep(std::time::Duration::from_micros(200));
        }
        let start = allocations();
        force_loop.tick(tick * PERIOD_NS, PERIOD);
        let allocated = allocations() - start;
        let published = handle.latest();
        let recording =
            [0, 60].into_iter().filter(|at| tick % RECORDED == *at).map(|at| RECORDING[usize::from(at > 0)]);
        for kind in kinds(tick, &before, published).into_iter().chain(recording) {
            let (ticks, sum) = counts.entry(kind).or_insert((0, 0));
            (*ticks, *sum) = (*ticks + 1, *sum + allocated);
        }
        before = contacts(&published.state);
        assert_eq!(records.as_mut().is_some_and(|ring| ring.pop().is_ok()), tick % RECORDED < 60);
    }
    counts
}

#[test]
fn allocations_are_counted() {
    let start = allocations();
    drop(std::hint::black_box(vec![0_u8]));
    assert_eq!(allocations() - start, 2);
}

#[test]
fn an_emulated_device_does_not_allocate() {
    let at = |time: f64, z: f64| Waypoint { time, position: DVec3::new(0.0, 0.0, z) };
    let target = HandTarget::Along(vec![at(0.1, 0.0), at(0.4, -0.01), at(0.8, -0.01), at(1.2, 0.0)]);
    for (_, mechanics) in known::ALL {
        let tip = Tip::new(mechanics, DVec3::ZERO, Some(Hand::loose(target.clone())));
        let (mut handle, mut device) = emulated("emulated", tip, DeviceLimits::UNLIMITED);
        let start = allocations();
        for tick in 0..3000 {
            let reading = device.read(tick * PERIOD_NS, PERIOD).expect("an emulated device has no faults");
            let force = -300.0 * reading.pose.position.min(DVec3::ZERO);
            device.write(Wrench { force, ..Wrench::default() }).expect("an emulated device has no faults");
            handle.set(Command { target: (tick > 2000).then_some(DVec3::Y), ..Command::default() });
            handle.true_motion();
        }
        assert_eq!(allocations() - start, 0);
    }
}

#[test]
fn no_kind_of_tick_allocates() {
    // When strain responses come is not the same from run to run, and contacts last longer or shorter: with the limit, only
    // that it acts is asked for.
    let bodies = [(false, false), (true, false), (false, true)];
    for ((moving, quadratic), limited) in bodies.into_iter().flat_map(|body| [(body, false), (body, true)]) {
        let devices = vec![
            device(|now_ns| Ok(Reading { timestamp_ns: now_ns, ..first_tool(now_ns / PERIOD_NS) })),
            device(|now_ns| Ok(Reading { timestamp_ns: now_ns, ..second_tool(now_ns / PERIOD_NS) })),
        ];
        // Other programs on the machine must not decide which ticks have a fault.
        let limits = SafetyLimits { max_compute: f64::INFINITY, max_overruns: u32::MAX, ..SafetyLimits::default() };
        let model = scene(moving, quadratic);
        let mut strain = StrainPreparer::new(&model);
        for (body, of_body) in model.bodies.iter().enumerate() {
            strain.set_measure(body, Arc::new(StrainMeasure::of_surface(&of_body.green().surface)));
        }
        let settings = Settings { strain_limit: STRAIN_LIMIT, ..settings() };
        let (mut force_loop, mut handle) = ForceLoop::new(model, devices, limits, settings).expect("a valid loop");
        let _worker = limited.then(|| force_loop.limit_strain(&mut handle, strain).expect("a thread"));
        let counts = count(force_loop, handle);
        let allocating: Vec<_> = counts.iter().filter(|(_, (_, sum))| *sum > 0).collect();
        assert!(allocating.is_empty(), "kinds of tick that allocate, with ticks and allocations: {allocating:?}");
        let all =
            ["free", "begin", "hold", "end", "grab", "two tools", "two bodies", "strike", "reset", "fault", "owed"];
        let all = all.into_iter().chain(RECORDING);
        let kinds: Vec<_> = match limited {
            true => vec!["limited"],
            false => all.chain(["refused", "watch", "steep"]).chain(moving.then_some("motion")).collect(),
        };
        for kind in kinds {
            assert!(counts.contains_key(kind), "no tick was of the kind '{kind}': {counts:?}");
        }
    }
}
