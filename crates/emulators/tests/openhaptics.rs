//! The driver of the Touch and the PHANTOM devices against an emulated library.

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use glam::DVec3;
use palpate_devices::{Buttons, Connection, DeviceFault, OpenError, Opened, Wrench, openhaptics};
use palpate_emulators::conformance::{Bench, Disturbance, Endurance, Facts, Motors, Tip, assert_conforms, endure};
use palpate_emulators::vendor::{NONSENSE, Steering, built_library, disturbance_number};

/// There is one library a process, and its devices are the same for all tests.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

struct Emulated {
    steering: Steering,
    library: PathBuf,
    _alone: MutexGuard<'static, ()>,
}

fn emulated(models: &str) -> Emulated {
    let alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let library = built_library("palpate_emulated_hd");
    let steering = Steering::load(&library).expect("the emulated library");
    steering.reset(models);
    Emulated { steering, library, _alone: alone }
}

impl Emulated {
    fn connection(&self, id: Option<&str>) -> Connection {
        Connection { id: id.map(str::to_owned), library: Some(self.library.clone()), ..Connection::default() }
    }
}

/// The suite's thread is another than the test's.
struct OnBench {
    steering: Steering,
    connection: Connection,
}

fn bench(emulated: &Emulated) -> OnBench {
    OnBench { steering: emulated.steering, connection: emulated.connection(None) }
}

impl Bench for OnBench {
    fn facts(&self) -> Facts {
        Facts {
            middle: DVec3::ZERO,
            position_tolerance: 1e-9,
            velocity_tolerance: 1e-9,
            velocity_settles: Duration::ZERO,
            force_tolerance: 1e-6,
            turns: true,
            buttons: 2,
            late_ticks: 0,
            stale_after: Duration::from_millis(100),
            force_holds: Duration::from_millis(50),
            recovers_within: Duration::from_secs(5),
            driver_error: DeviceFault::Driver(0x0304),
            hurries: true,
        }
    }

    fn open(&mut self) -> Result<Opened, OpenError> {
        openhaptics::open(&self.connection)
    }

    fn set_tip(&mut self, tip: Tip) {
        self.steering.set_tip(0, tip);
    }

    fn press(&mut self, buttons: Buttons) {
        self.steering.press(0, buttons);
    }

    fn motors(&mut self) -> Motors {
        self.steering.motors(0)
    }

    fn disturb(&mut self, disturbance: Option<Disturbance>) {
        self.steering.disturb(0, disturbance_number(disturbance));
    }

    fn hurry(&mut self, as_fast_as_possible: bool) {
        self.steering.hurry(as_fast_as_possible);
    }
}

#[test]
fn a_touch_conforms() {
    let emulated = emulated("Touch");
    assert_conforms(bench(&emulated));
}

#[test]
fn a_device_with_motors_of_rotation_conforms() {
    let emulated = emulated("PHANTOM Premium 1.5 6DOF");
    assert_conforms(bench(&emulated));
}

/// A minute at 1 kHz: `cargo test --release -p palpate-emulators --test openhaptics -- --ignored --nocapture`.
#[test]
#[ignore = "a minute"]
fn a_minute_at_1_khz() {
    let emulated = emulated("Touch");
    let figures = endure(bench(&emulated), Endurance { ticks: 60_000, hurried: false }).expect("no tick missed");
    println!("{figures:#?}");
    assert!(figures.seconds < 90.0);
}
