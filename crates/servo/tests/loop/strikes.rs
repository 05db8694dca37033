//! Strikes that come faster than ticks: none is lost, their motions add up, and a reset takes back what still waits.

use glam::DVec3;
use palpate_core::simulation::{Pose, Strike};
use palpate_devices::Reading;
use palpate_servo::{ForceLoop, LoopHandle, SafetyLimits, Script, Settings, StrainPreparer, run};

use crate::common::{PERIOD, PERIOD_NS, device, settings, single};

const TICKS: usize = 60;

fn strike(x: f64, impulse: DVec3) -> Strike {
    Strike { body: 0, point: DVec3::new(x, 0.04, 0.1), impulse, radius: 0.02, duration: 8e-3 }
}

fn strikes() -> [Strike; 3] {
    [strike(0.02, DVec3::NEG_Z), strike(0.08, DVec3::new(0.5, 0.0, -0.5)), strike(0.05, DVec3::Y)]
}

fn new_loop() -> (ForceLoop, LoopHandle) {
    let idle = device(|now_ns| Ok(Reading { timestamp_ns: now_ns, ..Reading::default() }));
    let limits = SafetyLimits { max_compute: f64::INFINITY, max_overruns: u32::MAX, ..SafetyLimits::default() };
    ForceLoop::new(single(true), vec![idle], limits, settings()).expect("a valid loop")
}

/// Displacements of some nodes at all ticks of a script.
fn scripted(strikes: &[(usize, Strike)]) -> Vec<DVec3> {
    let (poses, watch) = (vec![Pose::at(DVec3::NAN); TICKS], [(0, 3), (0, 17), (0, 40)]);
    let script = Script { period: PERIOD, poses: &poses, grabs: &[], strikes, watch: &watch, devices: &[] };
    let model = single(true);
    let strain = StrainPreparer::new(&model);
    run(&model, SafetyLimits::default(), settings(), &strain, &script, |_| ()).expect("a valid script").displacements
}

#[test]
fn strikes_within_a_tick_are_given_one_after_the_other() {
    let (mut force_loop, mut handle) = new_loop();
    let model = single(true);
    let mut moved = Vec::new();
    strikes().into_iter().for_each(|strike| handle.strike(strike).expect("room"));
    for tick in 0..TICKS as u64 {
        force_loop.tick(tick * PERIOD_NS, PERIOD);
        moved.extend(handle.latest().state.displacements_of(&model, 0, &[3, 17, 40]));
    }
    let [a, b, c] = strikes();
    assert_eq!(moved, scripted(&[(0, a), (1, b), (2, c)]));
    // A body in motion is linear: each of them does what it does alone.
    let alone = [scripted(&[(0, a)]), scripted(&[(1, b)]), scripted(&[(2, c)])];
    let largest = moved.iter().map(|u| u.length()).fold(0.0, f64::max);
    for (rank, together) in moved.iter().enumerate() {
        let sum: DVec3 = alone.iter().map(|one| one[rank]).sum();
        assert!(together.distance(sum) < 1e-12 * largest, "{rank}: {together} {sum}");
    }
    assert!(largest > 0.0);
}

/// Each strike is given under the settings that were sent before it, whatever was sent after it.
#[test]
fn settings_and_strikes_within_a_tick_keep_their_order() {
    let (mut force_loop, mut handle) = new_loop();
    let mut records = handle.begin_recording().expect("no recording yet");
    force_loop.tick(0, PERIOD);
    let [first, second, _] = strikes();
    let sent = [(0.5, first), (1.0, second)];
    for (time_scale, strike) in sent {
        handle.set(Settings { time_scale, ..settings() }).expect("valid settings");
        handle.strike(strike).expect("room");
    }
    (1..4).for_each(|tick| force_loop.tick(tick * PERIOD_NS, PERIOD));
    let given = std::iter::from_fn(|| records.pop().ok())
        .filter_map(|record| Some((record.input.settings.time_scale, record.input.strike?)));
    assert_eq!(given.collect::<Vec<_>>(), sent);
    assert_eq!(handle.latest().status.settings.time_scale, 1.0);
}

/// Settings do not wait for strikes that wait for room, nor does a reset.
#[test]
fn a_full_queue_is_an_error_until_the_loop_ticks() {
    let (mut force_loop, mut handle) = new_loop();
    let mut records = handle.begin_recording().expect("no recording yet");
    let strikes = 64;
    (0..strikes).for_each(|_| handle.strike(strike(0.02, DVec3::NEG_Z)).expect("room"));
    let set = |friction: f64| Settings { friction: [friction; 4], ..settings() };
    let accepted = (0..2000).take_while(|&rank| handle.set(set(f64::from(rank))).is_ok()).count();
    assert_eq!(accepted, 1024 - strikes);
    let refused = handle.reset().expect_err("full").to_string();
    assert!(refused.contains("the loop does not tick") && !refused.contains('\n'), "{refused}");
    // Each strike takes its turn, and then the settings behind them come into force.
    let ticks = strikes as u64 + 1;
    (0..ticks).for_each(|tick| force_loop.tick(tick * PERIOD_NS, PERIOD));
    assert_eq!(handle.latest().status.settings.friction[0], (accepted - 1) as f64);
    handle.set(set(0.7)).expect("room");
    handle.reset().expect("room");
    (ticks..ticks + 20).for_each(|tick| force_loop.tick(tick * PERIOD_NS, PERIOD));
    assert_eq!(handle.latest().status.settings.friction[0], 0.7);
    let given: Vec<_> = std::iter::from_fn(|| records.pop().ok()).map(|record| record.input.strike.is_some()).collect();
    let (before, after) = given.split_at(ticks as usize);
    assert!(
        before.iter().any(|&given| given) && !before.iter().all(|&given| given) && !after.iter().any(|&given| given)
    );
}

/// More than may be under way at once wait until one is over.
#[test]
fn all_strikes_are_given_and_no_more_wait_than_there_is_room_for() {
    let (mut force_loop, mut handle) = new_loop();
    let mut records = handle.begin_recording().expect("no recording yet");
    let accepted = (0..100).filter(|_| handle.strike(strike(0.02, DVec3::NEG_Z)).is_ok()).count();
    assert_eq!(accepted, 64);
    let refused = handle.strike(strike(0.02, DVec3::NEG_Z)).expect_err("full").to_string();
    assert!(refused.contains("64 strikes wait") && !refused.contains('\n'), "{refused}");
    let mut given = 0;
    for tick in 0..400 {
        force_loop.tick(tick * PERIOD_NS, PERIOD);
        while let Ok(record) = records.pop() {
            given += usize::from(record.input.strike.is_some());
        }
    }
    assert_eq!(given, accepted);
}

#[test]
fn a_reset_takes_back_the_strikes_before_it_alone() {
    let (mut force_loop, mut handle) = new_loop();
    let mut records = handle.begin_recording().expect("no recording yet");
    force_loop.tick(0, PERIOD);
    (0..5).for_each(|_| handle.strike(strike(0.02, DVec3::NEG_Z)).expect("room"));
    handle.reset().expect("room");
    handle.strike(strike(0.02, DVec3::Y)).expect("room");
    (1..20).for_each(|tick| force_loop.tick(tick * PERIOD_NS, PERIOD));
    let given: Vec<_> = std::iter::from_fn(|| records.pop().ok()).filter_map(|record| record.input.strike).collect();
    assert_eq!(given, [strike(0.02, DVec3::Y)]);
    assert!(handle.latest().state.energy(0).is_some_and(|energy| energy.work > 0.0));
}
