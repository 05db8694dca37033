//! The suite of all drivers on every emulated device.

use std::time::Duration;

use glam::DVec3;
use palpate_devices::{
    Buttons, Connection, DeviceFault, OpenError, ReadyDevice, Wrench, forcedimension, haply, openhaptics,
};
use palpate_emulators::conformance::{Bench, Disturbance, Endurance, Facts, assert_conforms, endure};
use palpate_emulators::inverse_service::{InverseService, MIDDLE, Options, Release, ReplyFlaw};
use palpate_emulators::library::{EmulatedLibrary, Steering};
use palpate_emulators::{SteeredTip, Tip, request_realtime};
use serde_json::json;

/// The first device of an emulated library; the suite's thread is another than the test's.
struct LibraryBench {
    steering: Steering,
    connection: Connection,
    open: fn(&Connection) -> Result<ReadyDevice, OpenError>,
    facts: Facts,
}

/// What both libraries do.
const LIBRARY: Facts = Facts {
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
    can_run_fast: true,
};

fn openhaptics(library: &EmulatedLibrary) -> LibraryBench {
    let (steering, connection) = (library.steering(), library.connection(None));
    LibraryBench { steering, connection, open: openhaptics::open, facts: LIBRARY }
}

fn force_dimension(library: &EmulatedLibrary, turns: bool) -> LibraryBench {
    let facts = Facts {
        turns,
        buttons: 4,
        stale_after: Duration::from_millis(20),
        // The guard looks every 4 ms and waits 16, on a machine that is not busy.
        force_holds: Duration::from_millis(150),
        driver_error: DeviceFault::Driver(8),
        ..LIBRARY
    };
    let (steering, connection) = (library.steering(), library.connection(None));
    LibraryBench { steering, connection, open: forcedimension::open, facts }
}

impl Bench for LibraryBench {
    fn facts(&self) -> Facts {
        self.facts
    }

    fn open(&mut self) -> Result<ReadyDevice, OpenError> {
        (self.open)(&self.connection)
    }

    fn set_tip(&mut self, tip: Tip) {
        self.steering.set_tip(0, tip);
    }

    fn press(&mut self, buttons: Buttons) {
        self.steering.press(0, buttons);
    }

    fn motors(&mut self) -> Wrench {
        self.steering.motors(0)
    }

    fn disturb(&mut self, disturbance: Option<Disturbance>) {
        self.steering.disturb(0, disturbance);
    }

    fn run_fast(&mut self, as_fast_as_possible: bool) {
        self.steering.run_fast(as_fast_as_possible);
    }
}

/// Identities of the service's arm and its grip.
const ARM: &str = "0A01";
const GRIP: &str = "61576";

/// An arm and a grip of the emulated service.
struct HaplyBench {
    release: Release,
    service: InverseService,
}

impl HaplyBench {
    fn new(release: Release) -> Self {
        let service = InverseService::start(&Options { release, ..Options::default() }).expect("a free port");
        service.add_arm(ARM, "inverse3", SteeredTip::held());
        service.add_grip(GRIP, ARM);
        Self { release, service }
    }
}

impl Bench for HaplyBench {
    fn facts(&self) -> Facts {
        Facts {
            middle: if self.release >= Release::V35 { DVec3::ZERO } else { MIDDLE },
            position_tolerance: 1e-9,
            velocity_tolerance: 1e-9,
            velocity_settles: Duration::from_millis(60),
            force_tolerance: 1e-9,
            turns: true,
            buttons: 3,
            // An exchange takes less than one; the rest is for a machine that runs other things too.
            late_ticks: 10,
            stale_after: Duration::from_millis(50),
            force_holds: Duration::from_millis(100),
            recovers_within: Duration::from_secs(4),
            driver_error: DeviceFault::Driver(1),
            can_run_fast: false,
        }
    }

    fn open(&mut self) -> Result<ReadyDevice, OpenError> {
        // Longer than a machine pauses that builds and tests other things: the suite asks that no force be withheld then.
        let address = format!("{}&hold=40", self.service.address());
        haply::open(&Connection { address: Some(address), ..Connection::default() })
    }

    fn set_tip(&mut self, tip: Tip) {
        self.service.set_tip(ARM, tip);
    }

    fn press(&mut self, buttons: Buttons) {
        self.service.press(GRIP, buttons);
    }

    fn motors(&mut self) -> Wrench {
        Wrench { force: self.service.motors(ARM).force, torque: DVec3::ZERO }
    }

    fn disturb(&mut self, disturbance: Option<Disturbance>) {
        self.service.plug(ARM, disturbance != Some(Disturbance::Unplugged));
        let old = disturbance == Some(Disturbance::WrongVersion);
        self.service.set_release(if old { Release::V30 } else { self.release });
        self.service.set_reply_flaw(match disturbance {
            Some(Disturbance::DriverError) => Some(ReplyFlaw::Truncated),
            Some(Disturbance::SlowReplies) => Some(ReplyFlaw::Late(Duration::from_millis(150))),
            Some(Disturbance::NotFinite) => {
                Some(ReplyFlaw::Replaced("/inverse3/0/state/cursor_position/x", json!(null)))
            }
            _ => None,
        });
    }
}

const DHD: &str = "palpate_emulated_dhd";
const HD: &str = "palpate_emulated_hd";

#[test]
fn every_model_of_force_dimension_conforms() {
    for (model, turns) in [
        ("omega.3", false),
        ("omega.6", true),
        ("omega.7", true),
        ("delta.3", false),
        ("sigma.7", true),
        ("lambda.7", true),
        ("falcon", false),
    ] {
        println!("{model}");
        assert_conforms(force_dimension(&EmulatedLibrary::with_devices(DHD, model), turns));
    }
}

#[test]
fn every_model_of_openhaptics_conforms() {
    for model in ["Touch", "PHANTOM Omni", "PHANTOM Desktop", "PHANTOM Premium 1.5 6DOF", "PHANTOM Premium 3.0 6DOF"] {
        println!("{model}");
        assert_conforms(openhaptics(&EmulatedLibrary::with_devices(HD, model)));
    }
}

/// With all releases at the same time: the suite runs again what fails while the machine stalls.
#[test]
fn every_release_of_haplys_service_conforms() {
    request_realtime();
    std::thread::scope(|scope| {
        for release in [Release::V31, Release::V34, Release::V35] {
            let named = std::thread::Builder::new().name(format!("service of {}", release.name()));
            named.spawn_scoped(scope, move || assert_conforms(HaplyBench::new(release))).expect("a thread");
        }
    });
}

/// `cargo test --release -p palpate-emulators --test conformance minute -- --ignored --nocapture --test-threads 1`.
fn endures_a_minute_at_1_khz(bench: impl Bench) {
    let figures = endure(bench, Endurance { ticks: 60_000, fast: false }).expect("no tick missed");
    println!("{figures:#?}");
    assert!(figures.seconds < 90.0);
}

#[test]
#[ignore = "a minute"]
fn a_minute_of_force_dimension() {
    endures_a_minute_at_1_khz(force_dimension(&EmulatedLibrary::with_devices(DHD, "sigma.7"), true));
}

#[test]
#[ignore = "a minute"]
fn a_minute_of_openhaptics() {
    endures_a_minute_at_1_khz(openhaptics(&EmulatedLibrary::with_devices(HD, "Touch")));
}

#[test]
#[ignore = "a minute"]
fn a_minute_of_haply() {
    request_realtime();
    endures_a_minute_at_1_khz(HaplyBench::new(Release::V35));
}
