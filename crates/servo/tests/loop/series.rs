//! Higher orders of the displacement that arrive while the loop runs: no tick allocates, no force jumps.

use std::sync::Arc;

use glam::DVec3;
use palpate_core::contact::shape::ToolShape;
use palpate_core::contact::smooth::SmoothSurface;
use palpate_core::simulation::{KnownSeries, Model, Pose};
use palpate_devices::Reading;
use palpate_servo::{ForceLoop, LoopHandle, SafetyLimits};

use crate::common::{PERIOD, PERIOD_NS, device, settings, sliding};
use crate::counting_allocator::allocations;

const RADIUS: f64 = 0.01;
/// The first tool presses the top of the cube, lifts, and presses again.
const LIFTS: u64 = 600;
const PRESSES_AGAIN: u64 = 800;
const TICKS: u64 = 1400;

fn reading(tool: usize, tick: u64) -> Reading {
    let height = if (LIFTS..PRESSES_AGAIN).contains(&tick) { 0.13 } else { 0.106 };
    let pose = Pose::at(DVec3::new(0.05, 0.05, height));
    Reading { pose, active: tool == 0, ..Reading::default() }
}

/// A series of which some fans know that the body is softer than it would be without.
fn series(model: &Model, known: impl Fn(DVec3) -> bool, blocks: usize) -> Arc<KnownSeries> {
    let smooth = SmoothSurface::new(&model.bodies[0].green().surface);
    // Most of it by the second order; the series ends at 10 N.
    let at = |position| if known(position) { [0.0, 0.0, -2e-3, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 1e-3] } else { [0.0; 10] };
    let fields = smooth.fans().iter().map(|fan| at(fan.position)).collect();
    Arc::new(KnownSeries::new(RADIUS, fields, vec![true; blocks]))
}

fn running(model: &Arc<Model>) -> (ForceLoop, LoopHandle) {
    let of_tool = |tool| device(move |now| Ok(Reading { timestamp_ns: now, ..reading(tool, now / PERIOD_NS) }));
    let limits = SafetyLimits { max_compute: f64::INFINITY, max_overruns: u32::MAX, ..SafetyLimits::default() };
    ForceLoop::new(model.clone(), vec![of_tool(0), of_tool(1)], limits, settings()).expect("a valid loop")
}

/// Forces by tick, and how many blocks of series the loop had, where series are offered before some ticks.
fn run(model: &Arc<Model>, offers: &[(u64, Arc<KnownSeries>)]) -> (Vec<f64>, Vec<u32>) {
    let (mut force_loop, mut handle) = running(model);
    let (mut forces, mut blocks) = (Vec::new(), Vec::new());
    for tick in 0..TICKS {
        for (_, offered) in offers.iter().filter(|(when, _)| *when == tick) {
            assert!(handle.offer_series(0, offered.clone()));
        }
        let start = allocations();
        force_loop.tick(tick * PERIOD_NS, PERIOD);
        assert_eq!(allocations() - start, 0, "tick {tick} allocates");
        let status = handle.latest().status;
        assert_eq!(status.fault, None);
        forces.push(status.wrenches[0].force.z);
        blocks.push(status.series_blocks[0][0]);
    }
    (forces, blocks)
}

fn scene() -> Arc<Model> {
    let sphere = || ToolShape::sphere(RADIUS).expect("a sphere");
    let model = sliding(false, [sphere(), sphere()]);
    Arc::new(model.with_series(0, Arc::new(KnownSeries::new(RADIUS, vec![], vec![]))).expect("a surface"))
}

#[test]
fn a_force_does_not_jump_where_a_series_arrives_under_a_pressing_tool() {
    let model = scene();
    let whole = series(&model, |_| true, 3);
    let (without, none) = run(&model, &[]);
    let (with, all) = run(&Arc::new(model.with_series(0, whole.clone()).expect("a surface")), &[]);
    assert!(none.iter().all(|&blocks| blocks == 0) && all.iter().all(|&blocks| blocks == 3));
    let (before, last) = (LIFTS as usize - 1, TICKS as usize - 1);
    assert!(with[before] < 0.98 * without[before] && with[before] > 0.1, "{} {}", with[before], without[before]);
    // Below the tool nothing is known at first; what is known at the bottom is taken up at once.
    let below = series(&model, |place| place.z < 0.03, 1);
    let (forces, blocks) = run(&model, &[(200, below), (300, whole)]);
    assert_eq!((blocks[199], blocks[200], blocks[before], blocks[LIFTS as usize + 50]), (0, 1, 1, 3));
    assert_eq!(forces[..LIFTS as usize], without[..LIFTS as usize]);
    assert!((forces[last] / with[last] - 1.0).abs() < 1e-6, "{} {}", forces[last], with[last]);
}

#[test]
fn a_recorded_loop_keeps_what_it_began_with() {
    let model = scene();
    let (mut force_loop, mut handle) = running(&model);
    let mut tick = |handle: &mut LoopHandle, now: u64| {
        force_loop.tick(now * PERIOD_NS, PERIOD);
        handle.latest().status.series_blocks[0][0]
    };
    assert!(handle.offer_series(0, series(&model, |_| true, 1)));
    assert_eq!(tick(&mut handle, 0), 1);
    handle.hold_series(true);
    let _records = handle.begin_recording().expect("no recording yet");
    assert!(handle.offer_series(0, series(&model, |place| place.z < 0.05, 2)));
    // The state that a recording begins with has the series of the loop.
    assert_eq!([700, 701].map(|now| tick(&mut handle, now)), [1, 1]);
    handle.end_recording();
    handle.hold_series(false);
    assert_eq!(tick(&mut handle, 702), 2);
}
