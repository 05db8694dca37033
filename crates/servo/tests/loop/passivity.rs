//! What the safety stage gives to a hand over closed paths of the tip, before forces that are those of passive springs.

use std::f64::consts::PI;
use std::sync::{Arc, Mutex};

use glam::{DMat3, DQuat, DVec3};
use palpate_devices::{Device, DeviceLimits, Pose, Reading, Wrench, known};
use palpate_servo::{ForceLoop, PortEnergy, SafetyLimits, SafetyStage};

use crate::common::{PERIOD, PERIOD_NS, Scripted, TOOL, settings, single};

/// Work given out over a closed path may be this part of the path's peak energy.
const PASSIVE: f64 = 1e-3;

/// A deterministic stream of numbers in (-1, 1).
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * 0.5 * (1.0 + self.next())
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }
}

/// What a path did: energy given out, the largest that the law stored, the stage's own account, and what went out.
struct Outcome {
    given: f64,
    peak: f64,
    port: PortEnergy,
    out: Vec<Wrench>,
}

/// A wrench by tick and pose.
type Law = dyn Fn(usize, &Pose) -> Wrench;

/// Ticks along a path, measured `every` so many of them, before a law that depends on the tick too; the work of what goes
/// out by the trapezoid rule.
fn follow(stage: &mut SafetyStage, path: &[Pose], every: usize, law: impl Fn(usize, &Pose) -> Wrench) -> Outcome {
    let (mut stored, mut outcome) = (0.0, Outcome { given: 0.0, peak: 0.0, port: stage.energy(), out: Vec::new() });
    let mut last: Option<(Pose, Wrench, Wrench)> = None;
    for tick in 0..path.len() {
        let (measured, nanoseconds) = (tick / every * every, |tick: usize| 1_000_000 * tick as u64);
        let (pose, timestamp_ns) = (path[measured], nanoseconds(measured));
        stage.accept_reading(
            Ok(Reading { pose, active: true, timestamp_ns, ..Reading::default() }),
            nanoseconds(tick),
            PERIOD,
        );
        let computed = law(tick, &pose);
        let out = stage.apply(computed, 1.0, PERIOD);
        assert_eq!(stage.fault(), None);
        if let Some((before, computed_before, out_before)) = last {
            let moved = pose.position - before.position;
            let turned = pose.rotation_from(&before);
            let work =
                |a: Wrench, b: Wrench| 0.5 * ((a.force + b.force).dot(moved) + (a.torque + b.torque).dot(turned));
            outcome.given += work(out_before, out);
            stored -= work(computed_before, computed);
            outcome.peak = outcome.peak.max(stored);
        }
        outcome.out.push(out);
        last = Some((pose, computed, out));
    }
    Outcome { port: stage.energy(), ..outcome }
}

fn through(limits: SafetyLimits, path: &[Pose], law: impl Fn(usize, &Pose) -> Wrench) -> Outcome {
    follow(&mut SafetyStage::new(limits, false), path, 1, law)
}

/// From 0 to 1 with a smooth start and end.
fn smooth(share: f64) -> f64 {
    0.5 - 0.5 * (PI * share.clamp(0.0, 1.0)).cos()
}

/// From a height down to a depth, held, and back, at a mean speed; m, s, m/s. The samples of the way up are those of the way
/// down, so that the trapezoid rule finds no work of a spring where it begins to touch.
fn press(height: f64, depth: f64, hold: f64, speed: f64) -> Vec<Pose> {
    let (way, held) = (((height + depth) / speed / PERIOD) as usize, (hold / PERIOD) as usize);
    let at = |tick: usize| height - (height + depth) * smooth(tick as f64 / way as f64);
    let heights = (0..=way).chain(std::iter::repeat_n(way, held)).chain((0..way).rev()).map(at);
    heights.map(|z| Pose::at(DVec3::new(0.0, 0.0, z))).collect()
}

/// A smooth surface at `z = 0` that pushes with `stiffness` times the depth.
fn wall(stiffness: f64) -> impl Fn(usize, &Pose) -> Wrench {
    move |_, pose| Wrench { force: DVec3::Z * (-stiffness * pose.position.z).max(0.0), ..Wrench::default() }
}

fn without_controller(limits: SafetyLimits) -> SafetyLimits {
    SafetyLimits { max_damping: 0.0, max_angular_damping: 0.0, ..limits }
}

/// Presses that end within the ramp, that the slew limit cuts, and that the clamp cuts.
fn presses() -> Vec<(&'static str, SafetyLimits, f64, Vec<Pose>)> {
    let usual = SafetyLimits::default();
    let settled = SafetyLimits { ramp: 0.0, ..usual };
    vec![
        ("start ramp, quick press", usual, 500.0, press(0.01, 0.004, 0.3, 0.2)),
        ("start ramp, slow press", usual, 500.0, press(0.005, 0.004, 0.1, 0.06)),
        ("slew limit", SafetyLimits { max_slew: 50.0, ..settled }, 500.0, press(0.01, 0.004, 0.1, 0.3)),
        ("slew limit, stiff", settled, 5000.0, press(0.01, 0.0015, 0.1, 0.4)),
        ("ramp, slew and clamp", usual, 5000.0, press(0.02, 0.002, 0.3, 0.2)),
    ]
}

#[test]
fn a_press_gives_out_no_energy_through_ramp_and_slew() {
    for (name, limits, stiffness, path) in presses() {
        let outcome = through(limits, &path, wall(stiffness));
        let part = outcome.given / outcome.peak;
        assert!(part < PASSIVE, "{name}: {part}, {:?}", outcome.port);
        assert!((outcome.port.given - outcome.given).abs() < 1e-12, "{name}: {:?}", outcome.port);
        // Without the controller it is half of what the contact stored, and all of it is reported.
        let open = through(without_controller(limits), &path, wall(stiffness));
        assert!(open.given > 0.4 * open.peak, "{name}: {}", open.given / open.peak);
        assert!((open.port.owed - open.given).abs() < 1e-3 * open.peak, "{name}: {:?}", open.port);
    }
}

/// A spring, stiffer in some directions than in others, and one of torsion: let in and out where they carry nothing.
struct Springs {
    stiffness: DMat3,
    torsion: f64,
    attached: std::ops::Range<usize>,
}

impl Springs {
    fn wrench(&self, tick: usize, pose: &Pose) -> Wrench {
        if !self.attached.contains(&tick) {
            return Wrench::default();
        }
        let angle = pose.rotation_from(&Pose::default());
        Wrench { force: -(self.stiffness * pose.position), torque: -self.torsion * angle }
    }
}

/// Some ticks of free motion, a random closed path on springs about one axis, and free motion again; with limits that
/// change what goes out.
fn random_path(noise: &mut Noise) -> (Vec<Pose>, Springs, SafetyLimits) {
    const FREE: usize = 200;
    let (ticks, size) = (noise.between(300.0, 1200.0) as usize, noise.between(0.001, 0.006));
    let waves: [(DVec3, f64); 6] = std::array::from_fn(|m| {
        let part = 1.0 / (m + 1) as f64;
        (noise.vector() * size * part, 0.5 * noise.next() * part)
    });
    let (axis, away) = (noise.vector().normalize(), 0.03 * noise.vector().normalize());
    let on_springs = (0..=ticks).map(|tick| {
        let phase = PI * tick as f64 / ticks as f64;
        let sines = waves.iter().enumerate().map(|(m, wave)| (wave, ((m + 1) as f64 * phase).sin()));
        let (place, angle) =
            sines.fold((DVec3::ZERO, 0.0), |sum, ((x, turn), sine)| (sum.0 + *x * sine, sum.1 + turn * sine));
        Pose { position: place, orientation: DQuat::from_axis_angle(axis, angle) }
    });
    let free = |tick: usize| Pose::at(away * smooth(tick as f64 / FREE as f64));
    let path = (1..=FREE).rev().map(free).chain(on_springs).chain((1..=FREE).map(free)).collect();
    let root = DMat3::from_cols(noise.vector(), noise.vector(), noise.vector());
    let springs = Springs {
        stiffness: root * root.transpose() * noise.between(100.0, 2000.0),
        torsion: noise.between(0.0, 0.3),
        attached: FREE..FREE + ticks + 1,
    };
    let limits = SafetyLimits {
        ramp: noise.between(-0.2, 0.5).max(0.0),
        max_slew: noise.between(20.0, 500.0),
        max_torque_slew: noise.between(1.0, 30.0),
        max_force: noise.between(1.0, 8.0),
        ..SafetyLimits::default()
    };
    (path, springs, limits)
}

#[test]
fn random_closed_paths_give_out_no_energy() {
    let (mut noise, mut open_paths) = (Noise(7), 0);
    for number in 0..1000 {
        let (path, springs, limits) = random_path(&mut noise);
        let law = |tick: usize, pose: &Pose| springs.wrench(tick, pose);
        let outcome = through(limits, &path, law);
        let part = outcome.given / outcome.peak;
        assert!(part < PASSIVE, "path {number}: {part}, {:?}", outcome.port);
        assert!(outcome.given <= outcome.port.owed + 1e-9, "path {number}: {:?}", outcome.port);
        let open = through(without_controller(limits), &path, law);
        open_paths += usize::from(open.given > PASSIVE * open.peak);
    }
    assert!(open_paths > 500, "without the controller {open_paths} of 1000 give out energy");
}

/// Forces of two tips on one body that gives by `compliance`, m/N, under depths of which neither can pull, N.
fn pressed_together(compliance: [[f64; 2]; 2], depths: [f64; 2]) -> [f64; 2] {
    let [[own, cross], [_, other]] = compliance;
    let determinant = own * other - cross * cross;
    let both =
        [(other * depths[0] - cross * depths[1]) / determinant, (own * depths[1] - cross * depths[0]) / determinant];
    match both {
        [_, second] if second <= 0.0 => [(depths[0] / own).max(0.0), 0.0],
        [first, _] if first <= 0.0 => [0.0, (depths[1] / other).max(0.0)],
        both => both,
    }
}

/// A random way down and up again, with presses between, at most 4 mm deep.
fn random_press(noise: &mut Noise, ticks: usize) -> Vec<f64> {
    let (deepest, clear) = (noise.between(1e-3, 4e-3), noise.between(1e-4, 2e-3));
    let waves: [(f64, f64); 3] = std::array::from_fn(|_| (0.4 * noise.next(), PI * noise.next()));
    let depth = |tick: usize| {
        let phase = PI * tick as f64 / ticks as f64;
        let sines = waves.iter().enumerate();
        let wave: f64 = sines.map(|(m, (size, shift))| size * (2.0 * (m + 1) as f64 * phase + shift).sin()).sum();
        phase.sin().powi(2) * (clear + deepest) * (1.0 + wave) - clear
    };
    (0..=ticks).map(depth).collect()
}

/// What two hands get over closed paths on one body, out of their devices and as computed, and the most that the body held, J.
fn given_to_two(ways: [&[f64]; 2], compliance: [[f64; 2]; 2], together: bool) -> (f64, f64, f64) {
    let limits = SafetyLimits::default();
    let mut stages = [SafetyStage::new(limits, false), SafetyStage::new(limits, false)];
    let (mut given, mut peak) = ([0.0; 2], 0.0f64);
    let mut before = ([[0.0; 2]; 2], [0.0; 2]);
    for tick in 0..ways[0].len() {
        let (depths, timestamp_ns) = ([ways[0][tick], ways[1][tick]], 1_000_000 * tick as u64);
        for (stage, depth) in stages.iter_mut().zip(depths) {
            let pose = Pose::at(-depth * DVec3::Z);
            stage.accept_reading(
                Ok(Reading { pose, active: true, timestamp_ns, ..Reading::default() }),
                timestamp_ns,
                PERIOD,
            );
        }
        let share = if together { SafetyStage::scene_share(&mut stages) } else { 1.0 };
        let computed = pressed_together(compliance, depths);
        let mut out = [0.0; 2];
        for (stage, (out, force)) in stages.iter_mut().zip(out.iter_mut().zip(computed)) {
            *out = stage.apply(Wrench { force: force * DVec3::Z, ..Wrench::default() }, share, PERIOD).force.z;
        }
        for (given, (now, then)) in given.iter_mut().zip([(out, before.0[0]), (computed, before.0[1])]) {
            let work = |port: usize| 0.5 * (now[port] + then[port]) * (before.1[port] - depths[port]);
            *given += if tick > 0 { work(0) + work(1) } else { 0.0 };
        }
        peak = peak.max(-given[1]);
        before = ([out, computed], depths);
    }
    (given[0], given[1], peak)
}

/// What one hand presses into a body and another gets out of it, while the start ramp withholds force of both.
#[test]
fn two_hands_on_one_body_get_no_energy_out_of_it() {
    let (mut noise, mut leaks_apart) = (Noise(11), 0);
    for number in 0..1000 {
        let ticks = noise.between(200.0, 800.0) as usize;
        let ways: [Vec<f64>; 2] = std::array::from_fn(|_| random_press(&mut noise, ticks));
        let compliance = {
            let (own, other) = (1.0 / noise.between(100.0, 600.0), 1.0 / noise.between(100.0, 600.0));
            let cross = noise.between(0.1, 0.8) * (own * other).sqrt();
            [[own, cross], [cross, other]]
        };
        let (given, computed, peak) = given_to_two([&ways[0], &ways[1]], compliance, true);
        assert!(given - computed.max(0.0) < PASSIVE * peak, "path {number}: {}", given / peak);
        let (given, computed, _) = given_to_two([&ways[0], &ways[1]], compliance, false);
        leaks_apart += usize::from(given - computed.max(0.0) > PASSIVE * peak);
    }
    assert!(leaks_apart > 100, "each port by itself, {leaks_apart} of 1000 give out energy");
}

/// What the controller takes is bounded by the device's damping and force, opposes the motion, and leaves rest alone.
#[test]
fn damping_stays_within_the_device() {
    for device in [known::TOUCH, known::FALCON, known::OMEGA] {
        let limits = SafetyLimits {
            max_force: device.max_force,
            max_damping: device.max_damping,
            max_slew: f64::INFINITY,
            ..SafetyLimits::default()
        };
        let path = press(0.02, 0.004, 0.4, 0.15);
        let (outcome, open) =
            (through(limits, &path, wall(400.0)), through(without_controller(limits), &path, wall(400.0)));
        let mut damped = 0;
        for (tick, pair) in path.windows(2).enumerate() {
            let velocity = (pair[1].position - pair[0].position) / PERIOD;
            let damping = open.out[tick + 1].force - outcome.out[tick + 1].force;
            assert!(damping.length() <= device.max_damping * velocity.length() * (1.0 + 1e-9) + 1e-12);
            assert!(damping.dot(velocity) >= 0.0);
            assert!(outcome.out[tick + 1].force.length() <= device.max_force * (1.0 + 1e-12));
            damped += usize::from(damping != DVec3::ZERO);
        }
        assert!(damped > 20 && outcome.given < open.given);
        assert!(
            (outcome.given - outcome.port.owed).abs() < 1e-6,
            "what could not be paid is reported: {:?}",
            outcome.port
        );
    }
}

/// Where nothing is withheld, and where the clamp alone withholds, each bit is as if there were no controller.
#[test]
fn nothing_is_damped_where_nothing_is_owed() {
    let limits = SafetyLimits { ramp: 0.0, max_slew: f64::INFINITY, ..SafetyLimits::default() };
    let clamped = SafetyLimits { max_force: 1.0, ..limits };
    let paths = [press(0.01, 0.004, 0.1, 0.1), press(0.01, 0.004, 0.0, 0.01)];
    for (limits, path) in paths.iter().flat_map(|path| [(limits, path), (clamped, path)]) {
        // Forces of a sphere on a soft surface grow with the depth to the power 3/2.
        let hertz = |_: usize, pose: &Pose| Wrench {
            force: DVec3::Z * 8e3 * (-pose.position.z).max(0.0).powf(1.5),
            ..Wrench::default()
        };
        let laws: [&Law; 2] = [&wall(500.0), &hertz];
        for law in laws {
            let (outcome, open) = (through(limits, path, law), through(without_controller(limits), path, law));
            assert!(outcome.out == open.out);
            assert!(outcome.port.owed.abs() < 1e-9);
        }
    }
}

/// A body that others have set in motion pushes the hand away: that energy is theirs to give, and goes through. The slew
/// limit on top of it still gives out none of its own.
#[test]
fn energy_of_others_goes_through() {
    // A wall that comes up 6 mm while the tip is pressed on, and the tip is then lifted off it.
    let path = press(0.02, 0.004, 0.3, 0.1);
    let held = path.iter().position(|pose| pose.position.z <= -0.0039).expect("pressed");
    let rises = move |tick: usize, pose: &Pose| {
        let surface = 0.006 * smooth((tick as f64 - held as f64 - 50.0) / 100.0);
        Wrench { force: DVec3::Z * (500.0 * (surface - pose.position.z)).max(0.0), ..Wrench::default() }
    };
    let limits = SafetyLimits { ramp: 0.0, max_slew: f64::INFINITY, ..SafetyLimits::default() };
    let free = through(limits, &path, rises);
    assert!(free.given > 0.5 * 500.0 * (0.01 * 0.01 - 0.004 * 0.004) * 0.9);
    assert_eq!(free.port.owed, 0.0);
    let slow = SafetyLimits { max_slew: 20.0, ..limits };
    let (damped, open) = (through(slow, &path, rises), through(without_controller(slow), &path, rises));
    assert!(open.given > free.given + 1e-4, "the slew limit makes energy: {} {}", open.given, free.given);
    assert!(damped.given < free.given + PASSIVE * free.given, "{} {}", damped.given, free.given);
}

/// A fault takes the wrench away, with nothing in its place, and what was owed counts as unpaid.
#[test]
fn a_fault_stays_a_fault() {
    let limits = SafetyLimits::default();
    let mut stage = SafetyStage::new(limits, true);
    let path = press(0.01, 0.004, 0.3, 0.2);
    let lifted = path.len() - 30;
    follow(&mut stage, &path[..lifted], 1, wall(500.0));
    stage.apply(Wrench { force: DVec3::NAN, ..Wrench::default() }, 1.0, PERIOD);
    for pose in &path[lifted..] {
        stage.accept_reading(Ok(Reading { pose: *pose, active: true, ..Reading::default() }), 0, PERIOD);
        assert_eq!(stage.apply(Wrench::default(), 1.0, PERIOD), Wrench::default());
    }
    assert_eq!(stage.energy().owed, 0.0);
    let before = stage.energy();
    stage.reset();
    assert_eq!(stage.energy(), before, "a reset keeps the account");
}

/// A device that measures every fifth tick has the same balance.
#[test]
fn a_device_slower_than_the_loop_is_balanced() {
    let path = press(0.01, 0.004, 0.3, 0.2);
    let through = |limits| follow(&mut SafetyStage::new(limits, false), &path, 5, wall(500.0));
    let (outcome, open) = (through(SafetyLimits::default()), through(without_controller(SafetyLimits::default())));
    assert!(open.given > 0.4 * open.peak, "{}", open.given / open.peak);
    // The law's own trapezoid rule over steps of up to 1.5 mm is a part of it.
    assert!(outcome.given < 2.0 * PASSIVE * outcome.peak, "{} {:?}", outcome.given / outcome.peak, outcome.port);
    assert_eq!(outcome.port.owed, 0.0);
}

/// Presses a body through the whole loop: energy given to the hand, J, and the loop's own account of it.
fn press_through_the_loop(moving: bool, device: DeviceLimits, limits: SafetyLimits) -> (f64, PortEnergy) {
    // Other programs on the machine must not decide which ticks have a fault.
    let limits = SafetyLimits { max_compute: f64::INFINITY, max_overruns: u32::MAX, ..limits };
    let top = DVec3::new(0.05, 0.05, 0.1 + TOOL.radius);
    let path: Vec<Pose> = press(0.03, 0.006, 0.3, 0.25).iter().map(|pose| Pose::at(pose.position + top)).collect();
    let (places, written) = (path.clone(), Arc::new(Mutex::new(Vec::new())));
    let out = written.clone();
    let read = move |now_ns: u64| {
        let pose = places[(now_ns / PERIOD_NS) as usize];
        Ok(Reading { pose, active: true, timestamp_ns: now_ns, ..Reading::default() })
    };
    let write = move |wrench: Wrench| {
        out.lock().expect("no poison").push(wrench.force);
        Ok(())
    };
    let devices: Vec<Box<dyn Device>> = vec![Box::new(Scripted { read, write, limits: device })];
    let (mut force_loop, mut handle) =
        ForceLoop::new(single(moving), devices, limits, settings()).expect("a valid loop");
    (0..path.len() as u64).for_each(|tick| force_loop.tick(tick * PERIOD_NS, PERIOD));
    let forces = written.lock().expect("no poison");
    let work = |tick: usize| 0.5 * (forces[tick - 1] + forces[tick]).dot(path[tick].position - path[tick - 1].position);
    ((1..path.len()).map(work).sum(), handle.latest().status.ports[0])
}

#[test]
fn a_body_gives_out_no_energy_through_the_loop() {
    let usual = SafetyLimits::default();
    for (moving, device) in [(false, DeviceLimits::UNLIMITED), (true, DeviceLimits::UNLIMITED), (false, known::OMEGA)] {
        let (given, port) = press_through_the_loop(moving, device, usual);
        let (open, open_port) = press_through_the_loop(moving, device, without_controller(usual));
        assert!(open > 2e-3 && open_port.owed >= open * (1.0 - 1e-9), "{open} {open_port:?}");
        assert!(given < PASSIVE * open && port.owed == 0.0, "{given} {port:?}");
        assert!((port.given - given).abs() < 1e-12);
    }
}
