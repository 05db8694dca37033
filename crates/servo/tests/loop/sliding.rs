//! Tools that slide under the local law: ticks never allocate, and the same input gives the same bits.

use glam::{DQuat, DVec3};
use palpate_core::contact::shape::ToolShape;
use palpate_core::simulation::{Input, MAX_TOOLS, Pose, Scratch, State, ToolInput, step};
use palpate_devices::{Reading, Wrench};
use palpate_servo::{ForceLoop, SafetyLimits, Settings};

use crate::common::{PERIOD, PERIOD_NS, device, settings, sliding};
use crate::counting_allocator::allocations;

const TICKS: u64 = 1500;

/// Presses, slides to and fro over the top of the cube, rocks, lifts, and comes back; a second tool beside the first.
fn reading(tool: usize, tick: u64) -> Reading {
    let turn = 6.3e-3 * tick as f64;
    let x = 0.03 + 0.04 * tool as f64 + 0.015 * (2.0 * turn).sin();
    let height = 0.1115 - 0.004 * (1.0 - turn.cos());
    let orientation = DQuat::from_rotation_x(0.2 * turn.sin());
    Reading { pose: Pose { position: DVec3::new(x, 0.05, height), orientation }, active: true, ..Reading::default() }
}

/// Wrenches of all ticks, how many ticks had a contact of each tool, and what they have allocated.
fn run(moving: bool, shapes: [ToolShape; 2]) -> (Vec<[Wrench; 2]>, [u64; 2], u64) {
    let of_tool = |tool| device(move |now| Ok(Reading { timestamp_ns: now, ..reading(tool, now / PERIOD_NS) }));
    let limits = SafetyLimits { max_compute: f64::INFINITY, max_overruns: u32::MAX, ..SafetyLimits::default() };
    let settings = Settings { friction: [0.3; MAX_TOOLS], ..settings() };
    let model = sliding(moving, shapes);
    let (mut force_loop, mut handle) =
        ForceLoop::new(model, vec![of_tool(0), of_tool(1)], limits, settings).expect("a valid loop");
    let (mut wrenches, mut touching, mut allocated) = (Vec::new(), [0; 2], 0);
    for tick in 0..TICKS {
        let start = allocations();
        force_loop.tick(tick * PERIOD_NS, PERIOD);
        allocated += allocations() - start;
        let published = handle.latest();
        assert_eq!(published.status.fault, None);
        wrenches.push([0, 1].map(|tool| published.status.wrenches[tool]));
        published.state.contacts.iter().for_each(|(contact, _)| touching[contact.tool] += 1);
    }
    (wrenches, touching, allocated)
}

#[test]
fn sliding_ticks_never_allocate_and_repeat_to_the_bit() {
    let sphere = || ToolShape::sphere(0.01).expect("a sphere");
    let second = [
        sphere(),
        ToolShape::ellipsoid(DVec3::new(0.01, 0.008, 0.006)).expect("an ellipsoid"),
        ToolShape::capsule(0.005, 0.005).expect("a capsule"),
    ];
    for (moving, shape) in [false, true].into_iter().flat_map(|moving| second.iter().map(move |s| (moving, s))) {
        let (wrenches, touching, allocated) = run(moving, [sphere(), shape.clone()]);
        assert_eq!(allocated, 0, "ticks allocate");
        assert!(touching.iter().all(|&ticks| (200..TICKS).contains(&ticks)), "{touching:?}");
        let pushed = wrenches.iter().map(|of_tick| of_tick[0].force.z).fold(0.0, f64::max);
        assert!(pushed > 0.01, "{pushed}");
        assert!(run(moving, [sphere(), shape.clone()]).0 == wrenches, "other bits");
    }
}

/// Within steps as short as these the pieces next to a tool are not looked for again.
#[test]
fn a_tick_is_the_same_with_fresh_memory() {
    let capsule = || ToolShape::capsule(0.005, 0.005).expect("a capsule");
    let model = sliding(false, [capsule(), ToolShape::sphere(0.01).expect("a sphere")]);
    let wrenches = |fresh: bool| -> Vec<Wrench> {
        let (mut state, mut scratch, mut input) = (State::new(&model), Scratch::new(&model), Input::default());
        let ticks = 0..400;
        let of_tick = |tick| {
            let height = 0.1053 - 1e-6 * f64::from(tick);
            let pose = Pose {
                position: DVec3::new(0.05 + 1e-6 * f64::from(tick), 0.05, height),
                orientation: DQuat::from_rotation_y(1.5),
            };
            input.tools[0] = ToolInput { pose, active: true, ..ToolInput::default() };
            if fresh {
                scratch = Scratch::new(&model);
            }
            step(&model, &mut state, &mut scratch, &input).wrench_on_device[0]
        };
        ticks.map(of_tick).collect()
    };
    let fresh = wrenches(false);
    assert!(fresh.iter().any(|wrench| wrench.force.z > 1e-3));
    assert!(fresh == wrenches(true), "other bits");
}

/// Sixteen are the most that a tick may take, eight where a tool takes pressure cells.
#[test]
fn newtons_method_takes_few_steps() {
    let sphere = || ToolShape::sphere(0.01).expect("a sphere");
    let capsule = ToolShape::capsule(0.005, 0.005).expect("a capsule");
    for (shape, usual, most) in [(sphere(), 6, 10), (capsule, 6, 8)] {
        let model = sliding(false, [sphere(), shape]);
        let (mut state, mut scratch) = (State::new(&model), Scratch::new(&model));
        let mut input = Input::default();
        input.controls.friction = [0.3; MAX_TOOLS];
        let mut taken = Vec::new();
        for tick in 0..TICKS {
            for tool in 0..2 {
                let Reading { pose, active, .. } = reading(tool, tick);
                input.tools[tool] = ToolInput { pose, active, ..ToolInput::default() };
            }
            step(&model, &mut state, &mut scratch, &input);
            if state.contacts.iter().count() == 2 {
                taken.push(scratch.newton_steps());
            }
        }
        taken.sort_unstable();
        assert!(taken.len() > 200);
        assert!(taken[taken.len() / 2] <= usual && taken[taken.len() - 1] <= most, "{:?}", &taken[taken.len() - 5..]);
    }
}
