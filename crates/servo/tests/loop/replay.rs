//! Recorded ticks made again: the same bits, whatever happened in between, and a changed coefficient is named.

use std::sync::Arc;

use glam::DVec3;
use palpate_core::contact::shape::ToolShape;
use palpate_core::simulation::{MAX_TOOLS, Model, Strike};
use palpate_core::strain::StrainMeasure;
use palpate_devices::{Buttons, Device, DeviceFault, DeviceLimits, Pose, Reading};
use palpate_servo::{
    Difference, FaultReason, ForceLoop, LoopHandle, Owner, Replay, SafetyLimits, Settings, StrainPreparer, TickRecord,
};

use crate::common::{PERIOD, PERIOD_NS, device, scene, settings, sliding};

const TICKS: u64 = 1400;

fn limits() -> SafetyLimits {
    SafetyLimits { max_compute: f64::INFINITY, max_overruns: u32::MAX, ..SafetyLimits::default() }
}

/// The first tool presses, slides and holds on, the second comes and goes, and loses its device once.
fn readings(tool: usize, now_ns: u64) -> Result<Reading, DeviceFault> {
    let tick = now_ns / PERIOD_NS;
    let t = PERIOD * tick as f64;
    let second = tool == 1;
    if second && tick == 900 {
        return Err(DeviceFault::MotorsOff);
    }
    let position = match second {
        false => DVec3::new(0.03 + 0.02 * t, 0.05, 0.105 - 0.01 * (9.0 * t).sin()),
        true => DVec3::new(0.24 - 0.1 * t, 0.05, 0.103),
    };
    let buttons = if !second && (500..600).contains(&tick) { Buttons::GRAB } else { Buttons::default() };
    let active = !second || tick % 400 > 150;
    Ok(Reading { pose: Pose::at(position), buttons, active, timestamp_ns: now_ns, ..Reading::default() })
}

/// Presses and slides over the top of one cube.
fn sliding_readings(tool: usize, now_ns: u64) -> Result<Reading, DeviceFault> {
    if tool == 1 && now_ns == 900 * PERIOD_NS {
        return Err(DeviceFault::MotorsOff);
    }
    let turn = 6.3e-9 * now_ns as f64;
    let x = 0.03 + 0.04 * tool as f64 + 0.015 * (2.0 * turn).sin();
    let pose = Pose::at(DVec3::new(x, 0.05, 0.1115 - 0.004 * (1.0 - turn.cos())));
    Ok(Reading { pose, active: true, timestamp_ns: now_ns, ..Reading::default() })
}

fn settings_at(tick: u64, strain_limit: f64) -> Settings {
    Settings { friction: [if tick < 1000 { 0.3 } else { 0.1 }; MAX_TOOLS], strain_limit, ..settings() }
}

fn measured(model: &Arc<Model>) -> StrainPreparer {
    let mut strain = StrainPreparer::new(model);
    for (body, of_body) in model.bodies.iter().enumerate() {
        strain.set_measure(body, Arc::new(StrainMeasure::of_surface(&of_body.green().surface)));
    }
    strain
}

fn strike(times: f64) -> Strike {
    let (point, impulse) = (DVec3::new(0.02, 0.02, 0.1), DVec3::new(0.0, 0.0, -1e-3 * times));
    Strike { body: 0, point, impulse, radius: 0.02, duration: 3e-3 }
}

type Readings = fn(usize, u64) -> Result<Reading, DeviceFault>;

fn new_loop(model: &Arc<Model>, readings: Readings, strain_limit: f64) -> (ForceLoop, LoopHandle) {
    let devices = [0, 1].map(|tool| device(move |now_ns| readings(tool, now_ns)) as Box<dyn Device>);
    ForceLoop::new(model.clone(), devices.into(), limits(), settings_at(0, strain_limit)).expect("a valid loop")
}

/// Ticks live, with a thread that prepares strain beside the loop; a recording begins at a tick.
fn record(model: &Arc<Model>, readings: Readings, strain_limit: f64, begin: u64) -> Vec<TickRecord> {
    let (mut force_loop, mut handle) = new_loop(model, readings, strain_limit);
    let _worker = force_loop.limit_strain(&mut handle, measured(model)).expect("a thread");
    let (mut ring, mut records) = (None, Vec::new());
    for tick in 0..TICKS {
        if tick == begin {
            ring = Some(handle.begin_recording().expect("no recording yet"));
        }
        if tick == 1100 {
            // As an overrun does.
            force_loop.latch(FaultReason::Overrun);
        }
        handle.set(settings_at(tick, strain_limit)).expect("valid settings");
        if tick == 1200 {
            handle.reset().expect("room");
        }
        if tick == 700 {
            // One a tick from here on.
            [1.0, 0.5, -0.7].into_iter().for_each(|times| handle.strike(strike(times)).expect("room"));
        }
        force_loop.tick(tick * PERIOD_NS, PERIOD);
        if tick % 8 == 0 {
            // On a busy machine the thread beside the loop needs more, until it has answered once.
            let answered = records.iter().any(|record: &TickRecord| !record.input.strain.arrived().is_empty());
            let waits = if strain_limit > 0.0 && !answered { 20_000 } else { 300 };
            std::thread::sleep(std::time::Duration::from_micros(waits));
        }
        records.extend(ring.iter_mut().filter_map(|ring| ring.pop().ok()));
    }
    let progress = handle.latest().status.recording;
    assert_eq!((progress.ticks + 1, progress.dropped), (TICKS - begin, 0), "published before the tick was over");
    records
}

fn replay(model: &Arc<Model>, strain_limit: f64, records: &[TickRecord]) -> Vec<Difference> {
    let devices = [DeviceLimits::UNLIMITED; 2];
    let (settings, strain) = (settings_at(0, strain_limit), measured(model));
    let mut replay = Replay::new(model, &devices, limits(), settings, strain).expect("a valid loop");
    let differences = records.iter().map(|record| replay.tick(record).expect("valid settings"));
    differences.flatten().collect()
}

fn spheres(radius: f64) -> [ToolShape; 2] {
    [0, 1].map(|_| ToolShape::sphere(radius).expect("a sphere"))
}

#[test]
fn replayed_ticks_have_the_bits_of_the_recorded_ones() {
    for (moving, begin) in [(false, 0), (true, 0), (true, 450)] {
        let models: [(_, Readings); 2] =
            [(scene(moving, false), readings), (sliding(moving, spheres(0.01)), sliding_readings)];
        for (model, readings) in models {
            for strain_limit in [0.0, 0.05] {
                let records = record(&model, readings, strain_limit, begin);
                assert_eq!(records.len() as u64, TICKS - begin);
                let pressed = records.iter().filter(|r| r.output.tools[0].wrench.force.z > 0.01).count();
                let answered = records.iter().filter(|r| !r.input.strain.arrived().is_empty()).count();
                assert!(pressed > 200 && (answered > 0) == (strain_limit > 0.0), "{pressed} {answered}");
                let differences = replay(&model, strain_limit, &records);
                assert!(differences.is_empty(), "{moving} {begin} {strain_limit}: {}", differences[0]);
            }
        }
    }
}

/// Faults and resets are among what is replayed.
#[test]
fn faults_come_again_in_their_tick() {
    let records = record(&scene(false, false), readings, 0.0, 0);
    let lost = records.iter().position(|r| r.output.tools[1].fault.is_some());
    assert_eq!(lost, Some(900));
    let overrun = records.iter().position(|r| r.input.fault == Some(FaultReason::Overrun));
    assert_eq!(overrun, Some(1100));
    let after = |tick: usize| records[tick].output.tools.map(|tool| tool.fault);
    assert!(after(1150).iter().take(2).all(Option::is_some) && after(1250).iter().all(Option::is_none));
}

#[test]
fn a_recording_begun_while_a_fault_is_latched_does_not_clear_it() {
    let model = sliding(false, spheres(0.01));
    let records = record(&model, sliding_readings, 0.0, 1150);
    assert!(records[..50].iter().all(|r| r.output.tools[1].fault == Some(FaultReason::Device(DeviceFault::MotorsOff))));
    assert!(records[..50].iter().all(|r| r.output.tools[0].wrench.force == DVec3::ZERO));
    assert!(records[50..].iter().any(|r| r.output.tools[0].wrench.force.z > 0.01), "the reset lets forces in");
    assert_eq!(replay(&model, 0.0, &records), Vec::new());
}

#[test]
fn a_changed_coefficient_is_found_and_named() {
    let records = record(&sliding(false, spheres(0.01)), sliding_readings, 0.0, 0);
    let touches = records.iter().position(|r| r.output.tools[0].wrench.force != DVec3::ZERO).expect("a contact");
    let mut changed = sliding(false, spheres(0.01));
    Arc::get_mut(&mut changed).expect("the only one").tools[0].radius *= 1.0 + 1e-12;
    let first = &replay(&changed, 0.0, &records)[0];
    assert_eq!((first.tick, first.of, first.quantity), (touches as u64, Owner::Tool(0), "force of the contact law"));
    // One bit of what was recorded.
    let mut altered = records.clone();
    altered[500].output.tools[1].wrench.torque.y += 1e-18;
    let differences = replay(&sliding(false, spheres(0.01)), 0.0, &altered);
    assert_eq!(differences.len(), 1);
    assert!(
        differences[0].to_string().starts_with("tick 500: tool 1: torque on the device was ["),
        "{}",
        differences[0]
    );
}

/// A recorder that does not keep up costs the loop nothing but its own records.
#[test]
fn a_full_ring_drops_and_counts() {
    let (mut force_loop, mut handle) = new_loop(&scene(false, false), readings, 0.0);
    let mut ring = handle.begin_recording().expect("no recording yet");
    assert!(handle.begin_recording().is_err_and(|error| error.to_string().contains("already")));
    (0..5000).for_each(|tick| force_loop.tick(tick * PERIOD_NS, PERIOD));
    let progress = handle.latest().status.recording;
    assert_eq!((progress.ticks, progress.dropped), (4999, 4999 - 4096));
    let ticks = std::iter::from_fn(|| ring.pop().ok()).map(|record| record.tick).collect::<Vec<_>>();
    assert_eq!(ticks, (0..4096).collect::<Vec<_>>());
    handle.end_recording();
    force_loop.tick(5001 * PERIOD_NS, PERIOD);
    assert!(!handle.latest().status.recording.records && ring.pop().is_err());
    assert!(handle.begin_recording().is_ok());
}
