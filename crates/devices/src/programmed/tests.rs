use std::time::Duration;

use glam::DVec3;

use super::*;
use crate::Buttons;

const PERIOD: f64 = 1e-3;

fn device() -> (ProgramEnd, ProgrammedDevice) {
    programmed("pad", DeviceLimits { max_force: 3.0, delay: 0.002, ..DeviceLimits::UNLIMITED }, 500.0)
}

fn publish(end: &mut ProgramEnd, x: f64) {
    end.publish(Pose::at(DVec3::new(x, 0.0, 0.0)), Twist::default(), Buttons(2));
}

fn force(x: f64) -> Wrench {
    Wrench { force: DVec3::new(x, 0.0, 0.0), ..Wrench::default() }
}

#[test]
fn polling_adds_its_delay_to_the_limits() {
    let (_end, device) = device();
    // 1.5 polls of 2 ms, and 2 ms of the device's own.
    assert!((device.limits().delay - 0.005).abs() < 1e-15);
    assert_eq!((device.limits().max_force, device.name()), (3.0, "pad"));
}

#[test]
fn a_reading_arrives_at_the_next_tick_and_is_held() {
    let (mut end, mut device) = device();
    let first = device.read(7, PERIOD).expect("nothing has been said");
    assert!(!first.active);
    publish(&mut end, 0.1);
    let read = device.read(0, PERIOD).expect("a reading");
    assert!(read.active && read.pose.position.x == 0.1 && read.buttons == Buttons(2));
    assert_eq!(device.read(0, PERIOD), Ok(read), "the latest is held, with the time at which it was measured");
    publish(&mut end, 0.2);
    let next = device.read(0, PERIOD).expect("a reading");
    assert!(next.pose.position.x == 0.2 && next.timestamp_ns > read.timestamp_ns);
    end.publish_absent();
    assert!(device.read(0, PERIOD).is_ok_and(|reading| !reading.active));
}

#[test]
fn a_program_that_says_nothing_more_is_stale_until_it_does() {
    let (mut end, mut device) = device();
    publish(&mut end, 0.1);
    let silent: Vec<_> = (0..60).map(|_| device.read(0, PERIOD)).collect();
    // The first tick takes the reading, 50 more are within 50 ms of it.
    assert_eq!(silent.iter().position(|reading| *reading == Err(DeviceFault::Stale)), Some(51));
    publish(&mut end, 0.1);
    assert!(device.read(0, PERIOD).is_ok());
}

#[test]
fn a_failure_is_told_at_the_next_tick_and_stands_until_a_reading() {
    let (mut end, mut device) = device();
    publish(&mut end, 0.1);
    end.fail(DeviceFault::Program);
    for _ in 0..3 {
        assert_eq!(device.read(0, PERIOD), Err(DeviceFault::Program));
    }
    publish(&mut end, 0.1);
    assert!(device.read(0, PERIOD).is_ok());
    end.fail(DeviceFault::NotFinite);
    drop(end);
    assert_eq!(device.read(0, PERIOD), Err(DeviceFault::NotFinite), "what was said last is not lost");
}

#[test]
fn a_program_that_has_gone_is_disconnected_at_once() {
    let (mut end, mut device) = device();
    publish(&mut end, 0.1);
    drop(end);
    assert_eq!(device.read(0, PERIOD), Err(DeviceFault::Disconnected));
}

#[test]
fn the_latest_wrench_is_fetched_and_its_age_told() {
    let (mut end, mut device) = device();
    assert_eq!(end.wrench(), (Wrench::default(), None));
    device.write(force(1.0)).expect("memory takes any wrench");
    device.write(force(2.0)).expect("memory takes any wrench");
    for _ in 0..2 {
        let (wrench, age) = end.wrench();
        assert_eq!(wrench, force(2.0));
        assert!(age.is_some_and(|age| age.as_secs_f64() < LONGEST_HOLD));
    }
}

#[test]
fn a_wrench_that_no_tick_renews_is_not_put_out() {
    let (mut end, mut device) = device();
    device.write(force(1.0)).expect("memory takes any wrench");
    std::thread::sleep(Duration::from_secs_f64(1.2 * LONGEST_HOLD));
    let (wrench, age) = end.wrench();
    assert_eq!(wrench, Wrench::default());
    assert!(age.is_some_and(|age| age.as_secs_f64() > LONGEST_HOLD));
    device.write(force(1.5)).expect("memory takes any wrench");
    assert_eq!(end.wrench().0, force(1.5));
}

#[test]
fn no_wrench_outlives_the_loop() {
    let (mut end, mut device) = device();
    device.write(force(1.0)).expect("memory takes any wrench");
    assert_eq!(end.wrench().0, force(1.0));
    drop(device);
    assert!(end.loop_has_ended());
    assert_eq!(end.wrench().0, Wrench::default());
}
