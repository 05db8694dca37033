//! The driver of Force Dimension's devices against an emulated library.

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use glam::DVec3;
use palpate_devices::{Buttons, Connection, Device, DeviceFault, OpenError, Opened, Wrench, forcedimension};
use palpate_emulators::conformance::{Bench, Disturbance, Endurance, Facts, Motors, Tip, assert_conforms, endure};
use palpate_emulators::vendor::{
    MOTORS_OFF, NONSENSE, READS_FAIL, Steering, UNCALIBRATED, built_library, disturbance_number,
};

/// There is one library a process, and its devices are the same for all tests.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

struct Emulated {
    steering: Steering,
    library: PathBuf,
    has_wrist: bool,
    _alone: MutexGuard<'static, ()>,
}

fn emulated(models: &str) -> Emulated {
    let alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let library = built_library("palpate_emulated_dhd");
    let steering = Steering::load(&library).expect("the emulated library");
    steering.reset(models);
    Emulated { steering, library, has_wrist: models.starts_with("sigma"), _alone: alone }
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
    has_wrist: bool,
}

fn bench(emulated: &Emulated) -> OnBench {
    OnBench { steering: emulated.steering, connection: emulated.connection(None), has_wrist: emulated.has_wrist }
}

impl Bench for OnBench {
    fn facts(&self) -> Facts {
        Facts {
            middle: DVec3::ZERO,
            position_tolerance: 1e-9,
            velocity_tolerance: 1e-9,
            velocity_settles: Duration::ZERO,
            force_tolerance: 1e-6,
            turns: self.has_wrist,
            buttons: 4,
            late_ticks: 0,
            stale_after: Duration::from_millis(20),
            // The guard looks every 4 ms and waits 16, on a machine that is not busy.
            force_holds: Duration::from_millis(150),
            recovers_within: Duration::from_secs(5),
            driver_error: DeviceFault::Driver(8),
            hurries: true,
        }
    }

    fn open(&mut self) -> Result<Opened, OpenError> {
        forcedimension::open(&self.connection)
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
}

#[test]
fn a_device_with_motors_of_rotation_conforms() {
    let emulated = emulated("sigma.7");
    assert_conforms(bench(&emulated));
}

#[test]
fn a_falcon_conforms() {
    let emulated = emulated("falcon");
    assert_conforms(bench(&emulated));
}

/// A minute at 1 kHz: `cargo test --release -p palpate-emulators --test forcedimension -- --ignored --nocapture`.
#[test]
#[ignore = "a minute"]
fn a_minute_at_1_khz() {
    let emulated = emulated("sigma.7");
    let figures = endure(bench(&emulated), Endurance { ticks: 60_000, hurried: false }).expect("no tick missed");
    println!("{figures:#?}");
    assert!(figures.seconds < 90.0);
}

#[test]
fn two_devices_are_told_apart_and_a_third_is_not_there() {
    let emulated = emulated("omega.3, falcon");
    let mut omega = forcedimension::open(&emulated.connection(None)).expect("the first").device;
    let mut falcon = forcedimension::open(&emulated.connection(Some("1"))).expect("the second").device;
    assert!(omega.name().contains("omega.3") && falcon.name().contains("Falcon"), "{}", falcon.name());
    assert_eq!((omega.limits().max_force, falcon.limits().max_force), (12.0, 8.0));
    emulated.steering.set_tip(0, Tip::at(0.01 * DVec3::X));
    emulated.steering.set_tip(1, Tip::at(-0.02 * DVec3::X));
    assert!((omega.read(1, 1e-3).expect("a reading").pose.position.x - 0.01).abs() < 1e-12);
    assert!((falcon.read(1, 1e-3).expect("a reading").pose.position.x + 0.02).abs() < 1e-12);
    falcon.write(Wrench { force: DVec3::Y, torque: DVec3::ZERO }).expect("written");
    assert_eq!(emulated.steering.motors(1).wrench.force, DVec3::Y);
    assert_eq!(emulated.steering.motors(0).wrench.force, DVec3::ZERO);
    for (asked, said) in [(Some("1"), "in use"), (Some("2"), "no Force Dimension device"), (Some("omega"), "0 to 1")] {
        let error = forcedimension::open(&emulated.connection(asked)).err().expect("refused").to_string();
        assert!(error.contains(said), "{error}");
    }
}

#[test]
fn the_list_tells_what_there_is_and_what_is_in_the_way() {
    let emulated = emulated("sigma.7,omega.3");
    let opened = forcedimension::open(&emulated.connection(Some("1"))).expect("the second");
    let listing = forcedimension::list(&emulated.connection(None));
    assert!(listing.missing.is_none() && listing.found.len() == 2);
    assert!(listing.found[0].name.contains("sigma.7") && listing.found[0].obstacle.is_none());
    assert!(listing.found[1].obstacle.as_ref().is_some_and(|obstacle| obstacle.what.contains("in use")));
    assert!(listing.facts.iter().any(|(name, fact)| *name == "SDK version" && fact == "3.17.5.0"));
    drop(opened);
    emulated.steering.reset("");
    let nothing = forcedimension::list(&emulated.connection(None)).missing.expect("nothing is there").to_string();
    assert!(nothing.contains("udev"), "{nothing}");
    let nowhere = Connection { library: Some("/nowhere/libdrd.so".into()), ..Connection::default() };
    let missing = forcedimension::list(&nowhere).missing.expect("no library").to_string();
    assert!(missing.contains("/nowhere/libdrd.so") && missing.contains("PALPATE_FORCEDIMENSION_LIBRARY"), "{missing}");
}

/// Whatever the library says: no panic, no number that is none, no force that nobody wrote.
#[test]
fn nonsense_is_survived() {
    let emulated = emulated("sigma.7");
    let mut device = forcedimension::open(&emulated.connection(None)).expect("opens").device;
    let mut good = 0;
    for tick in 0..20_000 {
        // A status of nonsense loses the device from time to time; then it is well for a while, to come back.
        emulated.steering.disturb(0, if tick % 1000 < 900 { NONSENSE } else { 0 });
        if let Ok(reading) = device.read(1_000_000 * tick, 1e-3) {
            good += 1;
            assert!(reading.pose.is_finite() && reading.twist.linear.is_finite() && reading.twist.angular.is_finite());
        }
        let _ = device.write(Wrench { force: 0.5 * DVec3::X, torque: DVec3::ZERO });
        let force = emulated.steering.motors(0).wrench.force;
        assert!(force == DVec3::ZERO || (force - 0.5 * DVec3::X).length() < 1e-12, "{force}");
    }
    println!("{good} good readings");
    for _ in 0..200 {
        emulated.steering.disturb(0, NONSENSE);
        let _ = forcedimension::list(&emulated.connection(None));
    }
}

#[test]
fn a_device_that_is_not_initialised_gets_no_force() {
    let emulated = emulated("omega.3");
    emulated.steering.disturb(0, UNCALIBRATED);
    let error = forcedimension::open(&emulated.connection(None)).err().expect("refused").to_string();
    assert!(error.contains("not initialised") && error.contains("Haptic Init"), "{error}");
    emulated.steering.disturb(0, 0);
    assert!(forcedimension::open(&emulated.connection(None)).is_ok());
}

/// Motors that a person has switched off are a fault, and are on again when the person lets them.
#[test]
fn motors_that_are_off_are_told_and_come_back() {
    let emulated = emulated("omega.3");
    let mut device = forcedimension::open(&emulated.connection(None)).expect("opens").device;
    let mut until = |wanted: fn(Result<(), DeviceFault>) -> bool| {
        let began = Instant::now();
        loop {
            let said = device.read(began.elapsed().as_nanos() as u64, 1e-3).map(|_| ());
            let force = if said.is_ok() { DVec3::X } else { DVec3::ZERO };
            let _ = device.write(Wrench { force, torque: DVec3::ZERO });
            if wanted(said) {
                return emulated.steering.motors(0).wrench.force;
            }
            assert!(began.elapsed() < Duration::from_secs(10), "{said:?}");
            std::thread::sleep(Duration::from_millis(1));
        }
    };
    assert_eq!(until(|said| said.is_ok()), DVec3::X);
    emulated.steering.disturb(0, MOTORS_OFF);
    assert_eq!(until(|said| said == Err(DeviceFault::MotorsOff)), DVec3::ZERO);
    emulated.steering.disturb(0, 0);
    assert_eq!(until(|said| said.is_ok()), DVec3::X);
}

/// Ticks without a force until a device says what is wanted; or for a time, and then what it said last.
fn said_within(device: &mut dyn Device, time: Duration, wanted: Option<DeviceFault>) -> Result<DVec3, DeviceFault> {
    let began = Instant::now();
    loop {
        let said = device.read(began.elapsed().as_nanos() as u64, 1e-3).map(|reading| reading.pose.position);
        let _ = device.write(Wrench::default());
        if said.err() == wanted || began.elapsed() > time {
            return said;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

const PATIENCE: Duration = Duration::from_secs(5);

#[test]
fn a_force_does_not_outlive_motors_that_were_off() {
    let emulated = emulated("omega.3");
    let mut device = forcedimension::open(&emulated.connection(None)).expect("opens").device;
    device.write(Wrench { force: DVec3::X, torque: DVec3::ZERO }).expect("written");
    emulated.steering.disturb(0, MOTORS_OFF);
    let began = Instant::now();
    // The loop writes on until the guard has found out.
    while device.read(began.elapsed().as_nanos() as u64, 1e-3) != Err(DeviceFault::MotorsOff) {
        let _ = device.write(Wrench { force: DVec3::X, torque: DVec3::ZERO });
        assert!(began.elapsed() < PATIENCE);
    }
    std::thread::sleep(Duration::from_millis(100));
    emulated.steering.disturb(0, 0);
    assert_eq!(emulated.steering.motors(0).wrench.force, DVec3::ZERO);
}

/// The tick that says so has no force on the motors any more.
#[test]
fn a_device_that_cannot_be_read_is_let_go_at_once() {
    let emulated = emulated("sigma.7");
    let mut device = forcedimension::open(&emulated.connection(None)).expect("opens").device;
    for _ in 0..5 {
        assert!(said_within(&mut *device, PATIENCE, None).is_ok());
        let pushed = Wrench { force: DVec3::X, torque: 0.01 * DVec3::Z };
        device.write(pushed).expect("written");
        assert_eq!(emulated.steering.motors(0).wrench, pushed);
        emulated.steering.disturb(0, READS_FAIL);
        assert_eq!(device.read(0, 1e-3), Err(DeviceFault::Disconnected));
        assert_eq!(emulated.steering.motors(0).wrench, Wrench::default());
        emulated.steering.disturb(0, 0);
    }
}

/// Ranks count what is plugged in: that of an unplugged device is the next one's.
#[test]
fn a_device_that_comes_back_is_the_same_one() {
    let emulated = emulated("omega.3,omega.3");
    let mut device = forcedimension::open(&emulated.connection(None)).expect("the first").device;
    let places = [0.01 * DVec3::X, 0.02 * DVec3::X];
    (0..2).for_each(|rank| emulated.steering.set_tip(rank, Tip::at(places[rank as usize])));
    emulated.steering.disturb(0, disturbance_number(Some(Disturbance::Unplugged)));
    assert_eq!(said_within(&mut *device, PATIENCE, Some(DeviceFault::Disconnected)), Err(DeviceFault::Disconnected));
    // Time for some attempts.
    let other = said_within(&mut *device, Duration::from_millis(700), None);
    assert_eq!(other, Err(DeviceFault::Disconnected), "another device was taken for it");
    let listing = forcedimension::list(&emulated.connection(None));
    assert!(listing.found[0].obstacle.is_some(), "nobody can tell which one it is");
    emulated.steering.disturb(0, 0);
    let back = said_within(&mut *device, PATIENCE, None).expect("it is back");
    assert!((back - places[0]).length() < 1e-12, "{back}");
}
