//! Whatever the service replies: what is on the motors is zero, or what the loop wrote last.

use std::time::{Duration, Instant};

use glam::DVec3;
use palpate_devices::haply::open;
use palpate_devices::{Connection, Device, Wrench};
use palpate_emulators::inverse_service::{MotorForce, Release, ReplyFlaw};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use serde_json::{Value, json};

use super::{ARM, alone, service};

/// Troubles one after another.
const REPLY_FLAWS: usize = 40;
/// Ticks of each, and twice as many without.
const TICKS: usize = 20;
/// Every so many troubles the loop hangs, for so long.
const HANGS: usize = 6;
const HANG: Duration = Duration::from_millis(80);
/// Ticks after a fault until the loop is reset.
const RESET: usize = 8;
/// By how much a busy machine may delay a thread.
const SLACK: Duration = Duration::from_millis(30);
/// The driver's own.
const HOLD: Duration = Duration::from_millis(5);
/// Size of the forces, N.
const FORCE: f64 = 2.0;

struct Written {
    at: Instant,
    force: DVec3,
}

/// A loop whose force has another direction at every tick, 0.1 mrad apart at least.
#[derive(Default)]
struct Loop {
    written: Vec<Written>,
    /// When a reading was a fault.
    faults: Vec<Instant>,
    released: usize,
}

impl Loop {
    fn tick(&mut self, device: &mut dyn Device) {
        let reading = device.read(0, 1e-3);
        self.released = self.released.saturating_sub(1);
        if reading.is_err() {
            self.faults.push(Instant::now());
            self.released = RESET;
        }
        let angle = 2.399_963_229_728_653 * self.written.len() as f64;
        let force = if self.released == 0 { FORCE * DVec3::new(angle.cos(), angle.sin(), 0.0) } else { DVec3::ZERO };
        self.written.push(Written { at: Instant::now(), force });
        let _ = device.write(Wrench { force, ..Wrench::default() });
        std::thread::sleep(Duration::from_millis(1));
    }

    /// The tick that wrote a force, by its direction; a force that has been withheld comes back from zero in the same one.
    fn tick_of(&self, motors: DVec3) -> usize {
        let is_it = |written: &Written| (written.force.normalize_or_zero() - motors.normalize()).length() < 1e-9;
        let tick = self.written.iter().position(is_it).unwrap_or_else(|| panic!("nobody wrote {motors} N"));
        assert!(motors.length() < FORCE * (1.0 + 1e-12), "{motors} N is more than was written");
        tick
    }

    /// Checks what has been on the motors; how many forces.
    fn check(&self, changes: &[MotorForce]) -> usize {
        let (mut latest, mut count) = (0, 0);
        for (rank, change) in changes.iter().enumerate().filter(|(_, change)| change.force != DVec3::ZERO) {
            let tick = self.tick_of(change.force);
            assert!(tick >= latest, "the force of tick {tick} came after that of tick {latest}");
            (latest, count) = (tick, count + 1);
            let written = self.written[tick].at;
            let end = changes.get(rank + 1).map_or(change.at, |next| next.at);
            let age = end - written;
            assert!(age <= 2 * HOLD + SLACK, "the force of tick {tick} was on the motors {age:?} after it was written");
            if let Some(fault) = self.faults.iter().find(|fault| **fault > written) {
                let after = change.at.saturating_duration_since(*fault);
                assert!(after <= SLACK, "the force of tick {tick} came onto the motors {after:?} after a fault");
            }
        }
        count
    }
}

fn any_json() -> impl Strategy<Value = Value> {
    prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<f64>().prop_map(Value::from),
        (-0.3..0.3).prop_map(Value::from),
        ".{0,6}".prop_map(Value::from),
        Just(json!({"x": 1e300, "y": 0, "z": 0})),
        Just(json!([[], {}])),
    ]
}

fn any_reply_flaw() -> impl Strategy<Value = ReplyFlaw> {
    let paths = [
        "/inverse3",
        "/inverse3/0",
        "/inverse3/0/device_id",
        "/inverse3/0/status",
        "/inverse3/0/status/ready",
        "/inverse3/0/state",
        "/inverse3/0/state/cursor_position",
        "/inverse3/0/state/cursor_position/y",
        "/inverse3/0/state/cursor_velocity/x",
        "/wireless_verse_grip/0/state/orientation/w",
    ];
    let path = prop::sample::select(paths.to_vec());
    prop_oneof![
        Just(ReplyFlaw::Silence),
        (0..80_u64).prop_map(|ms| ReplyFlaw::Late(Duration::from_millis(ms))),
        Just(ReplyFlaw::Twice),
        Just(ReplyFlaw::Cut),
        Just(ReplyFlaw::Truncated),
        ".{0,40}".prop_map(ReplyFlaw::Text),
        Just(ReplyFlaw::Binary),
        (0..2_000_000_usize).prop_map(ReplyFlaw::Huge),
        (path.clone(), any_json()).prop_map(|(path, value)| ReplyFlaw::Replaced(path, value)),
        path.prop_map(ReplyFlaw::Missing),
    ]
}

#[test]
fn whatever_the_service_replies_no_force_is_stale() {
    let _alone = alone();
    let service = service(Release::V35);
    let connection = Connection { address: Some(service.address()), ..Connection::default() };
    let mut device = open(&connection).expect("the emulated arm opens").device;
    let (mut ticks, mut runner) = (Loop::default(), TestRunner::deterministic());
    for rank in 0..REPLY_FLAWS {
        let reply_flaw = any_reply_flaw().new_tree(&mut runner).expect("a trouble").current();
        service.set_reply_flaw(Some(reply_flaw));
        (0..TICKS).for_each(|_| ticks.tick(&mut *device));
        service.set_reply_flaw(None);
        (0..TICKS).for_each(|_| ticks.tick(&mut *device));
        if rank % HANGS == 0 {
            std::thread::sleep(HANG);
        }
        (0..TICKS).for_each(|_| ticks.tick(&mut *device));
    }
    drop(device);
    let forces = ticks.check(&service.take_changes(ARM));
    assert!(forces > REPLY_FLAWS && ticks.faults.len() > REPLY_FLAWS, "{forces} forces, {} faults", ticks.faults.len());
    assert_eq!(service.motors(ARM).force, DVec3::ZERO);
}
