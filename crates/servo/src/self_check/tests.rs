use std::sync::{Arc, Mutex};

use palpate_devices::{Buttons, DeviceFault, Pose};

use super::*;

const PERIOD: f64 = 1e-3;
/// Of the hand that holds the tip: mass of both, kg, damping, N s/m, stiffness, N/m. It follows a push of a second closely.
const MASS: f64 = 0.1;
const DAMPING: f64 = 10.0;
const STIFFNESS: f64 = 200.0;

/// A tip in a hand, and the wrenches that it got.
struct Held {
    position: DVec3,
    velocity: DVec3,
    stiffness: f64,
    /// Force of the motors per force written: -1 for a driver with a wrong sign.
    gain: f64,
    /// Tick from which it is unplugged.
    unplugged: u64,
    ticks: u64,
    written: Arc<Mutex<Vec<DVec3>>>,
}

impl Held {
    fn new() -> (Self, Arc<Mutex<Vec<DVec3>>>) {
        let written = Arc::new(Mutex::new(Vec::new()));
        let held = Self {
            position: DVec3::ZERO,
            velocity: DVec3::ZERO,
            stiffness: STIFFNESS,
            gain: 1.0,
            unplugged: u64::MAX,
            ticks: 0,
            written: written.clone(),
        };
        (held, written)
    }
}

impl Device for Held {
    fn name(&self) -> &str {
        "held"
    }

    fn read(&mut self, now_ns: u64, _period: f64) -> std::result::Result<Reading, DeviceFault> {
        self.ticks += 1;
        if self.ticks >= self.unplugged {
            return Err(DeviceFault::Disconnected);
        }
        // Measures every other tick.
        let timestamp_ns = 1 + now_ns / 2_000_000 * 2_000_000;
        let (pose, buttons) = (Pose::at(self.position), Buttons(if self.ticks == 30 { 2 } else { 0 }));
        Ok(Reading { pose, buttons, active: true, timestamp_ns, ..Reading::default() })
    }

    fn write(&mut self, wrench: Wrench) -> std::result::Result<(), DeviceFault> {
        self.written.lock().expect("no panic").push(wrench.force);
        let force = self.gain * wrench.force - self.stiffness * self.position - DAMPING * self.velocity;
        self.velocity += PERIOD / MASS * force;
        self.position += PERIOD * self.velocity;
        Ok(())
    }

    fn limits(&self) -> DeviceLimits {
        DeviceLimits { max_force: 0.4, max_speed: Some(10.0), ..DeviceLimits::UNLIMITED }
    }
}

/// A ticker past the start ramp, and the ends of its hand-offs.
fn settled(device: Held) -> (Ticker, Input<(u64, Task)>, Output<Observation>) {
    let (tasks, asked) = triple_buffer(&(0, Task::default()));
    let (published, seen) = triple_buffer(&Observation::default());
    let mut ticker = Ticker::new(Box::new(device), asked, published);
    (0..300).for_each(|tick| ticker.tick(1_000_000 * tick, PERIOD));
    (ticker, tasks, seen)
}

fn run(ticker: &mut Ticker, ticks: std::ops::Range<u64>) {
    ticks.for_each(|tick| ticker.tick(1_000_000 * (300 + tick), PERIOD));
}

#[test]
fn a_push_rises_evenly_and_moves_the_hand_along_it() {
    for (direction, gain) in [(DVec3::X, 1.0), (DVec3::NEG_Z, 1.0), (DVec3::Y, -1.0)] {
        let (mut device, written) = Held::new();
        device.gain = gain;
        let (mut ticker, mut tasks, mut seen) = settled(device);
        tasks.write((1, Task { direction, force: 0.3, seconds: 1.0 }));
        run(&mut ticker, 0..999);
        let pushed = *seen.read();
        let written = written.lock().expect("no panic").split_off(300);
        for (tick, force) in written.iter().enumerate() {
            let expected = 0.3 * PERIOD * (tick + 1) as f64 * direction;
            assert!((*force - expected).length() < 1e-12, "{tick}: {force}");
        }
        // A ramp is followed by F/K less the delay b/K of the rate.
        let along = (pushed.last - pushed.first).dot(direction);
        let expected = gain * (0.3 / STIFFNESS) * (1.0 - DAMPING / STIFFNESS);
        assert!((along / expected - 1.0).abs() < 0.02, "{along} {expected}");
        assert!((pushed.largest_force - 0.2997).abs() < 1e-9 && !pushed.done);
        run(&mut ticker, 999..1001);
        assert!(seen.read().done && seen.read().fault.is_none());
    }
}

#[test]
fn after_a_push_and_in_a_fault_there_is_no_force_from_the_next_tick_on() {
    for unplugged in [u64::MAX, 700] {
        let (mut device, written) = Held::new();
        device.unplugged = unplugged;
        let (mut ticker, mut tasks, mut seen) = settled(device);
        tasks.write((1, Task { direction: DVec3::X, force: 0.3, seconds: 0.5 }));
        run(&mut ticker, 0..600);
        let last = unplugged.min(800) as usize - 2;
        let written = written.lock().expect("no panic");
        assert!(written[last].x > 0.2 && written[last + 1..].iter().all(|force| *force == DVec3::ZERO));
        let fault = (unplugged == 700).then_some(FaultReason::Device(DeviceFault::Disconnected));
        assert_eq!((seen.read().fault, seen.read().done), (fault, true));
    }
}

#[test]
fn a_tip_that_nobody_holds_runs_away_and_is_let_go() {
    let (mut device, written) = Held::new();
    device.stiffness = 0.0;
    let (mut ticker, mut tasks, mut seen) = settled(device);
    tasks.write((1, Task { direction: DVec3::X, force: 0.4, seconds: 10.0 }));
    run(&mut ticker, 0..9000);
    assert!(seen.read().ran_away && seen.read().done);
    // b x' = F t/T: after sqrt(2 b x T / F) it has gone that far.
    let expected = (2.0 * DAMPING * MAX_TRAVEL * 10.0 / 0.4_f64).sqrt() * 0.4 / 10.0;
    assert!((seen.read().largest_force / expected - 1.0).abs() < 0.02, "{expected}");
    assert_eq!(written.lock().expect("no panic").last(), Some(&DVec3::ZERO));
}

#[test]
fn the_device_s_own_limit_holds() {
    let (device, written) = Held::new();
    let (mut ticker, mut tasks, _seen) = settled(device);
    tasks.write((1, Task { direction: DVec3::X, force: 0.5, seconds: 1.0 }));
    run(&mut ticker, 0..990);
    let largest = written.lock().expect("no panic").iter().map(|force| force.length()).fold(0.0, f64::max);
    assert!((largest - 0.4).abs() < 1e-12);
}

#[test]
fn what_is_seen_of_a_path_is_its_statistics() {
    let (mut device, _written) = Held::new();
    (device.position, device.stiffness) = (DVec3::new(0.01, 0.0, 0.0), 1000.0);
    let (mut ticker, mut tasks, mut seen) = settled(device);
    assert_eq!(seen.read().buttons, 2);
    assert!((seen.read().highest.x - 0.01).abs() < 1e-12 && seen.read().lowest.x < 0.0);
    assert_eq!((seen.read().readings, seen.read().fresh), (300, 150));
    assert!((seen.read().longest_gap - 0.002).abs() < 1e-12);
    // At rest by then.
    tasks.write((1, Task::default()));
    run(&mut ticker, 5000..5100);
    let rest = *seen.read();
    assert_eq!((rest.task, rest.readings, rest.buttons, rest.largest_force), (1, 100, 0, 0.0));
    assert!(rest.deviation.length() < 1e-5 && rest.time > 0.099);
}

#[test]
fn a_check_that_asks_for_more_is_refused() {
    let (device, written) = Held::new();
    let mut check = SelfCheck::start(ReadyDevice { device: Box::new(device), scheduler: None }).expect("a thread");
    let push = |direction, force, seconds| Task { direction, force, seconds };
    for task in
        [push(DVec3::X, 0.6, 1.0), push(DVec3::ONE, 0.1, 1.0), push(DVec3::X, f64::NAN, 1.0), push(DVec3::X, 0.1, 0.0)]
    {
        assert!(check.begin(task).is_err());
    }
    check.begin(Task::default()).expect("watching is always possible");
    while check.observation().is_none_or(|seen| seen.readings < 5) {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    check.stop();
    assert!(written.lock().expect("no panic").iter().all(|force| *force == DVec3::ZERO));
}
