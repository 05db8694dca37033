//! The driver of Haply's arms against the emulated Inverse Service.

mod haply_service;

use std::time::{Duration, Instant};

use glam::DVec3;
use palpate_devices::emulated::{self, Hand, HandTarget, known};
use palpate_devices::haply::{list, open};
use palpate_devices::{Buttons, Connection, Device, DeviceFault, Wrench};
use palpate_emulators::inverse_service::{InverseService, MIDDLE, Options, Release, ReplyFlaw};
use palpate_emulators::{SteeredTip, Tip};
use serde_json::json;

use haply_service::{ARM, alone, beside_others, service};

const PERIOD: f64 = 1e-3;

fn connection(service: &InverseService) -> Connection {
    Connection { address: Some(service.address()), ..Connection::default() }
}

fn opened(service: &InverseService) -> Box<dyn Device> {
    open(&connection(service)).expect("the emulated arm opens").device
}

/// Ticks with a force until a condition holds; panics if it does not within two seconds.
fn tick_until(
    device: &mut dyn Device,
    force: DVec3,
    what: &str,
    mut holds: impl FnMut(Result<palpate_devices::Reading, DeviceFault>) -> bool,
) {
    let began = Instant::now();
    while began.elapsed() < Duration::from_secs(4) {
        let reading = device.read(0, PERIOD);
        let wrench = if reading.is_ok() { Wrench { force, ..Wrench::default() } } else { Wrench::default() };
        let _ = device.write(wrench);
        if holds(reading) {
            return;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("{what} within 4 s");
}

fn until_force(device: &mut dyn Device, service: &InverseService, force: DVec3) {
    tick_until(device, force, "the force reaches the motors", |_| service.motors(ARM).force == force);
}

#[test]
fn the_origin_is_the_middle_of_the_workspace_where_it_can_be_chosen() {
    let _beside = beside_others();
    for (release, origin) in [(Release::V31, MIDDLE), (Release::V34, MIDDLE), (Release::V35, DVec3::ZERO)] {
        let service = service(release);
        let mut device = opened(&service);
        let held = DVec3::new(0.01, 0.02, -0.03);
        service.set_tip(ARM, Tip::at(held));
        tick_until(&mut *device, DVec3::ZERO, "the place", |reading| {
            reading.is_ok_and(|reading| (reading.pose.position - held - origin).length() < 1e-12)
        });
        assert_eq!(device.name(), "Haply Inverse3 0A01");
        assert_eq!(service.profiles(), [Some("org.palpate.servo".to_string())]);
        // Nothing that the service of this release does not know.
        assert_eq!(service.take_complaints(), Vec::<String>::new());
    }
}

#[test]
fn limits_tell_the_measured_delay() {
    let _alone = alone();
    let slow = ReplyFlaw::Late(Duration::from_millis(3));
    let service = service(Release::V35);
    let quick = opened(&service).limits();
    assert!(quick.delay > 0.5e-3, "half a period before and after the tick: {}", quick.delay);
    assert_eq!((quick.max_force, quick.max_torque, quick.rate), (10.0, 0.0, Some(2000.0)));
    // A greeting that is late does no harm either.
    service.set_reply_flaw(Some(slow));
    let delay = opened(&service).limits().delay;
    assert!(delay > 3.4e-3, "{delay} {}", quick.delay);
}

#[test]
fn lists_what_there_is_and_says_what_to_do() {
    let _beside = beside_others();
    let service = service(Release::V34);
    service.add_arm("0B02", "minverse", SteeredTip::held());
    service.set_calibrated("0B02", false);
    let listing = list(&connection(&service));
    assert_eq!(listing.missing, None);
    let found: Vec<_> = listing.found.iter().map(|found| (found.id.as_str(), found.name.as_str())).collect();
    assert_eq!(found, [(ARM, "Haply Inverse3"), ("0B02", "Haply Minverse")]);
    assert!(listing.found[0].obstacle.is_none());
    let obstacle = listing.found[1].obstacle.as_ref().expect("not calibrated").to_string();
    assert!(obstacle.contains("0B02 is not calibrated"), "{obstacle}");
    assert!(listing.facts.contains(&("messages of version", "3.1 to 3.4".into())), "{:?}", listing.facts);
    // By name, whatever its case; the first free one by default.
    let by_id = |id: &str| open(&Connection { id: Some(id.into()), ..connection(&service) });
    assert_eq!(by_id("0a01").expect("opens").device.name(), "Haply Inverse3 0A01");
    let refused = |id: &str| by_id(id).err().expect("refused").to_string();
    assert_eq!(refused("0B02"), obstacle);
    assert!(refused("0C03").ends_with("has no device \"0C03\": it has 0A01, 0B02"), "{}", refused("0C03"));
    service.plug(ARM, false);
    service.plug("0B02", false);
    let none = list(&connection(&service));
    assert!(none.found.is_empty() && none.missing.is_some());
}

#[test]
fn what_does_not_answer_as_the_service_does_is_refused_in_time() {
    let _beside = beside_others();
    let service = service(Release::V35);
    let refused = |expected: &str| {
        let began = Instant::now();
        let error = open(&connection(&service)).err().expect(expected).to_string();
        assert!(error.contains(expected), "{error}");
        assert!(!error.contains('\n') && began.elapsed() < Duration::from_secs(3), "{error}");
    };
    service.set_release(Release::V30);
    refused("update it to 3.1 or later");
    service.set_release(Release::V35);
    for (reply_flaw, expected) in [
        (ReplyFlaw::Silence, "does not answer in time"),
        (ReplyFlaw::Truncated, "does not greet as"),
        (ReplyFlaw::Text("[]".into()), "does not greet as"),
        (ReplyFlaw::Binary, "does not greet as"),
        (ReplyFlaw::Cut, "does not speak as"),
        (ReplyFlaw::Huge(1 << 20), "does not speak as"),
        (ReplyFlaw::Missing("/inverse3/0/state"), "error 2"),
    ] {
        service.set_reply_flaw(Some(reply_flaw));
        refused(expected);
    }
    let nobody = Connection { address: Some("ws://127.0.0.1:9".into()), ..Connection::default() };
    let error = open(&nobody).err().expect("nobody listens").to_string();
    assert!(error.contains("no Haply Inverse Service listens at ws://127.0.0.1:9"), "{error}");
    // Somebody who takes connections and says nothing.
    let mute = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = Some(format!("ws://{}", mute.local_addr().unwrap()));
    let error = open(&Connection { address, ..Connection::default() }).err().expect("mute").to_string();
    assert!(error.contains("does not answer in time"), "{error}");
}

#[test]
fn an_arm_in_use_is_refused_and_a_second_one_is_not() {
    let _alone = alone();
    let service = service(Release::V35);
    let mut first = opened(&service);
    until_force(&mut *first, &service, DVec3::X);
    let error = open(&connection(&service)).err().expect("in use").to_string();
    assert!(error.contains("is used by another program"), "{error}");
    service.add_arm("0B02", "inverse3x", SteeredTip::held());
    let mut second = opened(&service);
    assert_eq!(second.name(), "Haply Inverse3x 0B02");
    for _ in 0..50 {
        for (device, force) in [(&mut first, DVec3::X), (&mut second, DVec3::Y)] {
            device.read(0, PERIOD).expect("both go on");
            device.write(Wrench { force, ..Wrench::default() }).expect("both go on");
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!((service.motors(ARM).force, service.motors("0B02").force), (DVec3::X, DVec3::Y));
    assert_eq!(service.take_complaints(), Vec::<String>::new());
}

/// Each of these replies is a fault, takes the force off, and is over with the next good one.
#[test]
fn bad_replies_are_faults_and_take_the_force_off() {
    let _alone = alone();
    let service = service(Release::V35);
    let mut device = opened(&service);
    let state = "/inverse3/0/state";
    let x = "/inverse3/0/state/cursor_position/x";
    for (reply_flaw, expected) in [
        (ReplyFlaw::Truncated, DeviceFault::Driver(1)),
        (ReplyFlaw::Binary, DeviceFault::Driver(1)),
        (ReplyFlaw::Text("".into()), DeviceFault::Driver(1)),
        (ReplyFlaw::Text("[".repeat(100_000)), DeviceFault::Driver(1)),
        (
            ReplyFlaw::Text(r#"{"inverse3":[{"device_id":"0A01","state":{"cursor_position":{"x":NaN}}}]}"#.into()),
            DeviceFault::Driver(1),
        ),
        (ReplyFlaw::Text("null".into()), DeviceFault::Driver(2)),
        (ReplyFlaw::Text("{}".into()), DeviceFault::Driver(2)),
        (ReplyFlaw::Missing(state), DeviceFault::Driver(2)),
        (ReplyFlaw::Missing("/inverse3/0/state/cursor_velocity"), DeviceFault::Driver(2)),
        (ReplyFlaw::Missing("/inverse3/0/device_id"), DeviceFault::Disconnected),
        (ReplyFlaw::Missing("/inverse3/0"), DeviceFault::Disconnected),
        (ReplyFlaw::Replaced(state, json!([1, 2])), DeviceFault::Driver(2)),
        (ReplyFlaw::Replaced(x, json!("0.1")), DeviceFault::Driver(2)),
        (ReplyFlaw::Replaced(x, json!(null)), DeviceFault::NotFinite),
        (ReplyFlaw::Replaced(x, json!(1e300)), DeviceFault::Driver(3)),
        (ReplyFlaw::Replaced("/inverse3/0/state/cursor_velocity/z", json!(-1e9)), DeviceFault::Driver(3)),
        (ReplyFlaw::Replaced("/wireless_verse_grip/0/state/orientation/w", json!(null)), DeviceFault::NotFinite),
        (ReplyFlaw::Replaced("/inverse3", json!({"0A01": {}})), DeviceFault::Driver(4)),
        (ReplyFlaw::Replaced("/inverse3/0/status/calibrated", json!(false)), DeviceFault::MotorsOff),
        (ReplyFlaw::Replaced("/inverse3/0/status/power_supply", json!(false)), DeviceFault::MotorsOff),
        (ReplyFlaw::Cut, DeviceFault::Disconnected),
        (ReplyFlaw::Huge(1 << 20), DeviceFault::Disconnected),
        (ReplyFlaw::Silence, DeviceFault::Stale),
        (ReplyFlaw::Late(Duration::from_millis(150)), DeviceFault::Stale),
    ] {
        until_force(&mut *device, &service, DVec3::new(0.0, 0.0, 2.0));
        service.set_reply_flaw(Some(reply_flaw.clone()));
        let mut fault = None;
        tick_until(&mut *device, DVec3::Z, "a fault", |reading| {
            fault = reading.err();
            fault.is_some()
        });
        assert_eq!(fault, Some(expected), "{reply_flaw:?}");
        // The tick that is told of it has written none, and what was written before counts no more.
        let began = Instant::now();
        while began.elapsed() < Duration::from_millis(40) {
            let _ = device.read(0, PERIOD);
            std::thread::sleep(Duration::from_millis(1));
        }
        assert_eq!(service.motors(ARM).force, DVec3::ZERO, "{reply_flaw:?}");
        service.set_reply_flaw(None);
        tick_until(&mut *device, DVec3::ZERO, "readings again", |reading| reading.is_ok());
    }
}

/// Messages that are too large, after which the driver breaks the connection off.
#[test]
fn a_connection_is_not_given_up_with_a_force_on_the_motors() {
    let _alone = alone();
    let service = service(Release::V35);
    let mut device = opened(&service);
    for _ in 0..3 {
        until_force(&mut *device, &service, DVec3::Y);
        service.set_reply_flaw(Some(ReplyFlaw::Huge(1 << 20)));
        tick_until(&mut *device, DVec3::Y, "the loss", |reading| reading == Err(DeviceFault::Disconnected));
        service.set_reply_flaw(None);
        tick_until(&mut *device, DVec3::ZERO, "readings again", |reading| reading.is_ok());
    }
    assert_eq!(service.take_complaints(), Vec::<String>::new());
}

/// Wrong types where nothing is needed, and grips that are none, are no faults.
#[test]
fn oddities_are_tolerated() {
    let _beside = beside_others();
    let service = service(Release::V35);
    let mut device = opened(&service);
    for reply_flaw in [
        ReplyFlaw::Replaced("/inverse3/0/status", json!(7)),
        ReplyFlaw::Replaced("/inverse3/0/status/ready", json!("yes")),
        ReplyFlaw::Replaced("/session", json!([])),
        ReplyFlaw::Replaced("/wireless_verse_grip", json!({"a": 1})),
        ReplyFlaw::Replaced("/wireless_verse_grip/0/state", json!(null)),
        ReplyFlaw::Replaced("/wireless_verse_grip/0/state/buttons", json!([true])),
        ReplyFlaw::Replaced("/wireless_verse_grip/0/state/orientation", json!({"w": 0, "x": 0, "y": 0, "z": 0})),
        ReplyFlaw::Missing("/wireless_verse_grip"),
        ReplyFlaw::Replaced("/inverse3/0/state/cursor_position", json!({"y": 0, "z": 1, "x": 0, "w": {}})),
    ] {
        service.set_reply_flaw(Some(reply_flaw.clone()));
        for _ in 0..20 {
            device.read(0, PERIOD).unwrap_or_else(|fault| panic!("{reply_flaw:?}: {fault}"));
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

/// A service that answers twice puts its client ever farther behind, if that takes one answer each time.
#[test]
fn replies_that_nobody_asked_for_do_not_make_readings_old() {
    let _alone = alone();
    let service = service(Release::V35);
    let mut device = opened(&service);
    service.set_reply_flaw(Some(ReplyFlaw::Twice));
    tick_until(&mut *device, DVec3::ZERO, "a second", |_| service.messages() > 1000);
    service.set_tip(ARM, Tip::at(DVec3::Y));
    let began = Instant::now();
    tick_until(&mut *device, DVec3::ZERO, "the new place", |reading| {
        reading.is_ok_and(|reading| reading.pose.position == DVec3::Y)
    });
    assert!(began.elapsed() < Duration::from_millis(100), "{:?}", began.elapsed());
}

#[test]
fn the_arm_is_idle_at_once_when_the_device_is_dropped() {
    let _alone = alone();
    let service = service(Release::V35);
    let mut device = opened(&service);
    until_force(&mut *device, &service, DVec3::Y);
    drop(device);
    let motors = service.motors(ARM);
    assert_eq!(motors.force, DVec3::ZERO);
    // By a message, not by the timeout of the service.
    assert!(motors.at.elapsed() < Duration::from_millis(90), "{:?}", motors.at.elapsed());
}

/// A loop that stops reading and writing while its device lives.
#[test]
fn a_force_that_is_not_repeated_is_taken_off_by_the_driver() {
    let _alone = alone();
    let service = service(Release::V35);
    let mut device = opened(&service);
    until_force(&mut *device, &service, DVec3::Y);
    let (stopped, before) = (Instant::now(), service.messages());
    while service.motors(ARM).force != DVec3::ZERO {
        assert!(stopped.elapsed() < Duration::from_millis(60), "the driver's time is 5 ms, the service's 100 ms");
        std::thread::sleep(Duration::from_micros(200));
    }
    std::thread::sleep(Duration::from_millis(50));
    assert!(service.messages() > before + 20, "measurements go on");
    // And comes back without a jump.
    service.take_changes(ARM);
    until_force(&mut *device, &service, 4.0 * DVec3::Y);
    let forces: Vec<f64> = service.take_changes(ARM).iter().map(|change| change.force.y).collect();
    let largest_step = forces.windows(2).map(|pair| pair[1] - pair[0]).fold(forces[0], f64::max);
    assert!(largest_step < 3.9 && forces.len() > 2, "{forces:?}");
}

#[test]
fn the_arms_own_safety_takes_forces_off_until_the_brake_is_released() {
    let _alone = alone();
    let service = service(Release::V35);
    let mut device = opened(&service);
    until_force(&mut *device, &service, DVec3::Y);
    service.trigger_safety("0B02", "ebrake_triggered");
    std::thread::sleep(Duration::from_millis(30));
    device.read(0, PERIOD).expect("another arm's brake");
    service.trigger_safety(ARM, "ebrake_triggered");
    tick_until(&mut *device, DVec3::Y, "the brake", |reading| reading == Err(DeviceFault::MotorsOff));
    for _ in 0..30 {
        assert_eq!(device.read(0, PERIOD), Err(DeviceFault::MotorsOff));
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(service.motors(ARM).force, DVec3::ZERO);
    service.trigger_safety(ARM, "ebrake_released");
    tick_until(&mut *device, DVec3::Y, "readings", |reading| reading.is_ok());
    service.trigger_safety(ARM, "stall_detected");
    tick_until(&mut *device, DVec3::Y, "a stall", |reading| reading == Err(DeviceFault::MotorsOff));
    tick_until(&mut *device, DVec3::Y, "readings", |reading| reading.is_ok());
}

#[test]
fn a_service_that_starts_anew_is_found_again() {
    let _alone = alone();
    let service = service(Release::V35);
    let mut device = opened(&service);
    until_force(&mut *device, &service, DVec3::Y);
    service.drop_connections();
    tick_until(&mut *device, DVec3::Y, "the loss", |reading| reading == Err(DeviceFault::Disconnected));
    assert_eq!(service.motors(ARM).force, DVec3::ZERO);
    until_force(&mut *device, &service, DVec3::X);
    assert_eq!(service.take_complaints(), Vec::<String>::new());
}

/// Farthest that tip and force are from the balance of hand and wall at the end of a way into the wall, over what friction holds.
fn farthest_from_balance() -> f64 {
    let service = InverseService::start(&Options { release: Release::V34, ..Options::default() }).expect("a free port");
    let (wall, wanted) = (300.0, -0.02 * DVec3::Z);
    let hand = Hand::loose(HandTarget::At(wanted));
    let mechanics = known::mechanics("Inverse3").expect("known");
    let expected = wanted.z * hand.stiffness / (wall + hand.stiffness);
    // Friction holds the tip within this.
    let play = 1.1 * mechanics.dry_friction / (wall + hand.stiffness);
    let tip = emulated::Tip::new(mechanics, DVec3::ZERO, Some(hand));
    service.add_arm(ARM, "inverse3", SteeredTip::free(tip));
    let mut device = opened(&service);
    let mut depths = Vec::new();
    for _ in 0..1500 {
        let depth = device.read(0, PERIOD).expect("a reading").pose.position.z - MIDDLE.z;
        depths.push(depth);
        let force = -wall * depth.min(0.0) * DVec3::Z;
        device.write(Wrench { force, ..Wrench::default() }).expect("a device that is well");
        std::thread::sleep(Duration::from_millis(1));
    }
    // The depth that the motors' force belongs to.
    let pushed = -service.motors(ARM).force.z / wall;
    let ends = depths[1300..].iter().copied().chain([pushed]);
    ends.map(|depth| (depth - expected).abs() / play).fold(0.0, f64::max)
}

/// Through thread, socket and service: hand and wall share the way by their stiffnesses, as two springs in series do. Where a busy
/// machine halts a thread, friction may hold the tip farther away: of three ways one has to end there.
#[test]
fn the_way_into_a_wall_is_where_hand_and_wall_balance() {
    let _beside = beside_others();
    let mut farthest = f64::INFINITY;
    for _ in 0..3 {
        farthest = farthest.min(farthest_from_balance());
        if farthest < 1.0 {
            return;
        }
    }
    panic!("{farthest} times as far from the balance as friction holds the tip");
}

#[test]
fn grips_fall_asleep_and_wake() {
    let _beside = beside_others();
    let service = service(Release::V34);
    let mut device = opened(&service);
    let turned = glam::DQuat::from_rotation_x(0.3);
    service.set_tip(ARM, Tip { orientation: turned, ..Tip::at(DVec3::ZERO) });
    service.press(haply_service::GRIP, Buttons(3));
    let both = |reading: Result<palpate_devices::Reading, DeviceFault>| {
        reading
            .is_ok_and(|reading| reading.buttons == Buttons(3) && reading.pose.orientation.angle_between(turned) < 1e-6)
    };
    tick_until(&mut *device, DVec3::ZERO, "buttons and orientation", both);
    service.wake(haply_service::GRIP, false);
    // What is held is let go, and the tool stays as it was.
    tick_until(&mut *device, DVec3::ZERO, "no buttons", |reading| {
        reading
            .is_ok_and(|reading| reading.buttons == Buttons(0) && reading.pose.orientation.angle_between(turned) < 1e-6)
    });
    service.wake(haply_service::GRIP, true);
    tick_until(&mut *device, DVec3::ZERO, "buttons and orientation", both);
}
