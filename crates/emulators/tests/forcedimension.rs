//! The driver of Force Dimension's devices against an emulated library.

use std::time::{Duration, Instant};

use glam::DVec3;
use palpate_devices::{Connection, Device, DeviceFault, Wrench, forcedimension};
use palpate_emulators::Tip;
use palpate_emulators::conformance::Disturbance;
use palpate_emulators::library::EmulatedLibrary;

fn emulated(models: &str) -> EmulatedLibrary {
    EmulatedLibrary::with_devices("palpate_emulated_dhd", models)
}

#[test]
fn two_devices_are_told_apart_and_a_third_is_not_there() {
    let emulated = emulated("omega.3, falcon");
    let mut omega = forcedimension::open(&emulated.connection(None)).expect("the first").device;
    let mut falcon = forcedimension::open(&emulated.connection(Some("1"))).expect("the second").device;
    assert!(omega.name().contains("omega.3") && falcon.name().contains("Falcon"), "{}", falcon.name());
    assert_eq!((omega.limits().max_force, falcon.limits().max_force), (12.0, 8.0));
    emulated.set_tip(0, Tip::at(0.01 * DVec3::X));
    emulated.set_tip(1, Tip::at(-0.02 * DVec3::X));
    assert!((omega.read(1, 1e-3).expect("a reading").pose.position.x - 0.01).abs() < 1e-12);
    assert!((falcon.read(1, 1e-3).expect("a reading").pose.position.x + 0.02).abs() < 1e-12);
    falcon.write(Wrench { force: DVec3::Y, torque: DVec3::ZERO }).expect("written");
    assert_eq!(emulated.motors(1).force, DVec3::Y);
    assert_eq!(emulated.motors(0).force, DVec3::ZERO);
    for (asked, message) in [(Some("1"), "in use"), (Some("2"), "no Force Dimension device"), (Some("omega"), "0 to 1")]
    {
        let error = forcedimension::open(&emulated.connection(asked)).err().expect("refused").to_string();
        assert!(error.contains(message), "{error}");
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
    emulated.reset("");
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
        emulated.disturb(0, if tick % 1000 < 900 { Some(Disturbance::Nonsense) } else { None });
        if let Ok(reading) = device.read(1_000_000 * tick, 1e-3) {
            good += 1;
            assert!(reading.pose.is_finite() && reading.twist.linear.is_finite() && reading.twist.angular.is_finite());
        }
        let _ = device.write(Wrench { force: 0.5 * DVec3::X, torque: DVec3::ZERO });
        let force = emulated.motors(0).force;
        assert!(force == DVec3::ZERO || (force - 0.5 * DVec3::X).length() < 1e-12, "{force}");
    }
    println!("{good} good readings");
    for _ in 0..200 {
        emulated.disturb(0, Some(Disturbance::Nonsense));
        let _ = forcedimension::list(&emulated.connection(None));
    }
}

#[test]
fn a_device_that_is_not_initialised_gets_no_force() {
    let emulated = emulated("omega.3");
    emulated.disturb(0, Some(Disturbance::Uncalibrated));
    let error = forcedimension::open(&emulated.connection(None)).err().expect("refused").to_string();
    assert!(error.contains("not initialised") && error.contains("Haptic Init"), "{error}");
    emulated.disturb(0, None);
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
            let reading = device.read(began.elapsed().as_nanos() as u64, 1e-3).map(|_| ());
            let force = if reading.is_ok() { DVec3::X } else { DVec3::ZERO };
            let _ = device.write(Wrench { force, torque: DVec3::ZERO });
            if wanted(reading) {
                return emulated.motors(0).force;
            }
            assert!(began.elapsed() < Duration::from_secs(10), "{reading:?}");
            std::thread::sleep(Duration::from_millis(1));
        }
    };
    assert_eq!(until(|reading| reading.is_ok()), DVec3::X);
    emulated.disturb(0, Some(Disturbance::MotorsOff));
    assert_eq!(until(|reading| reading == Err(DeviceFault::MotorsOff)), DVec3::ZERO);
    emulated.disturb(0, None);
    assert_eq!(until(|reading| reading.is_ok()), DVec3::X);
}

/// Ticks without a force until a device says what is wanted; or for a time, and then what it said last.
fn said_within(device: &mut dyn Device, time: Duration, wanted: Option<DeviceFault>) -> Result<DVec3, DeviceFault> {
    let began = Instant::now();
    loop {
        let reading = device.read(began.elapsed().as_nanos() as u64, 1e-3).map(|reading| reading.pose.position);
        let _ = device.write(Wrench::default());
        if reading.err() == wanted || began.elapsed() > time {
            return reading;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

const TIMEOUT: Duration = Duration::from_secs(5);

#[test]
fn a_force_does_not_outlive_motors_that_were_off() {
    let emulated = emulated("omega.3");
    let mut device = forcedimension::open(&emulated.connection(None)).expect("opens").device;
    device.write(Wrench { force: DVec3::X, torque: DVec3::ZERO }).expect("written");
    emulated.disturb(0, Some(Disturbance::MotorsOff));
    let began = Instant::now();
    // The loop writes on until the guard has found out.
    while device.read(began.elapsed().as_nanos() as u64, 1e-3) != Err(DeviceFault::MotorsOff) {
        let _ = device.write(Wrench { force: DVec3::X, torque: DVec3::ZERO });
        assert!(began.elapsed() < TIMEOUT);
    }
    std::thread::sleep(Duration::from_millis(100));
    emulated.disturb(0, None);
    assert_eq!(emulated.motors(0).force, DVec3::ZERO);
}

/// The tick that says so has no force on the motors any more.
#[test]
fn a_device_that_cannot_be_read_is_let_go_at_once() {
    let emulated = emulated("sigma.7");
    let mut device = forcedimension::open(&emulated.connection(None)).expect("opens").device;
    for _ in 0..5 {
        assert!(said_within(&mut *device, TIMEOUT, None).is_ok());
        let pushed = Wrench { force: DVec3::X, torque: 0.01 * DVec3::Z };
        device.write(pushed).expect("written");
        assert_eq!(emulated.motors(0), pushed);
        emulated.disturb(0, Some(Disturbance::ReadsFail));
        assert_eq!(device.read(0, 1e-3), Err(DeviceFault::Disconnected));
        assert_eq!(emulated.motors(0), Wrench::default());
        emulated.disturb(0, None);
    }
}

/// Ranks count what is plugged in: that of an unplugged device is the next one's.
#[test]
fn a_device_that_comes_back_is_the_same_one() {
    let emulated = emulated("omega.3,omega.3");
    let mut device = forcedimension::open(&emulated.connection(None)).expect("the first").device;
    let places = [0.01 * DVec3::X, 0.02 * DVec3::X];
    (0..2).for_each(|rank| emulated.set_tip(rank, Tip::at(places[rank as usize])));
    emulated.disturb(0, Some(Disturbance::Unplugged));
    assert_eq!(said_within(&mut *device, TIMEOUT, Some(DeviceFault::Disconnected)), Err(DeviceFault::Disconnected));
    // Time for some attempts.
    let other = said_within(&mut *device, Duration::from_millis(700), None);
    assert_eq!(other, Err(DeviceFault::Disconnected), "another device was taken for it");
    let listing = forcedimension::list(&emulated.connection(None));
    assert!(listing.found[0].obstacle.is_some(), "nobody can tell which one it is");
    emulated.disturb(0, None);
    let back = said_within(&mut *device, TIMEOUT, None).expect("it is back");
    assert!((back - places[0]).length() < 1e-12, "{back}");
}
