//! The driver of the Touch and the PHANTOM devices against an emulated library.

use std::sync::Arc;
use std::time::Duration;

use glam::DVec3;
use palpate_devices::{Connection, Device, DeviceFault, Reading, ReadyDevice, Wrench, openhaptics};
use palpate_emulators::Tip;
use palpate_emulators::conformance::Disturbance;
use palpate_emulators::library::EmulatedLibrary;

fn emulated(models: &str) -> EmulatedLibrary {
    EmulatedLibrary::with_devices("palpate_emulated_hd", models)
}

/// Ticks of the library, with what a device says in each; a loop that stops after some of them.
fn ticks<R: Send + 'static>(
    opened: Vec<ReadyDevice>,
    count: usize,
    mut each: impl FnMut(usize, &mut [Box<dyn Device>]) -> R + Send + 'static,
) -> Vec<R> {
    let scheduler = opened[0].scheduler.clone().expect("the library has its own loop");
    let mut devices: Vec<Box<dyn Device>> = opened.into_iter().map(|opened| opened.device).collect();
    let (sender, results) = std::sync::mpsc::channel();
    let mut tick = 0;
    let begun = scheduler.start(Box::new(move || {
        if tick < count {
            let _ = sender.send(each(tick, &mut devices));
        }
        tick += 1;
    }));
    begun.expect("the scheduler starts");
    let all = (0..count).map(|_| results.recv_timeout(Duration::from_secs(20)).expect("a tick")).collect();
    scheduler.stop();
    all
}

#[test]
fn two_devices_share_a_tick_and_are_told_apart() {
    let emulated = emulated("Touch, Left=PHANTOM Omni");
    let opened = vec![
        openhaptics::open(&emulated.connection(None)).expect("the default device"),
        openhaptics::open(&emulated.connection(Some("Left"))).expect("the other one"),
    ];
    let schedulers = [&opened[0], &opened[1]].map(|one| one.scheduler.clone().expect("the library has its own loop"));
    assert!(Arc::ptr_eq(&schedulers[0], &schedulers[1]), "a loop must see that they share it");
    let again = openhaptics::open(&emulated.connection(Some("Left"))).err().expect("in use").to_string();
    assert!(again.contains("in use"), "{again}");
    let unknown = openhaptics::open(&emulated.connection(Some("Right"))).err().expect("nobody").to_string();
    assert!(unknown.contains("Right") && unknown.contains("Touch Setup"), "{unknown}");
    assert!(opened[1].device.name().contains("PHANTOM Omni"));
    assert_eq!((opened[0].device.limits().max_stiffness, opened[1].device.limits().max_stiffness), (400.0, 700.0));
    let steering = emulated.steering();
    steering.set_tip(0, Tip::at(0.01 * DVec3::X));
    steering.set_tip(1, Tip::at(0.02 * DVec3::Y));
    let forces = ticks(opened, 20, move |tick, devices| {
        // From the middle on, the second one is unplugged; its errors lie on the stack of both.
        steering.disturb(1, if tick < 10 { None } else { Some(Disturbance::Unplugged) });
        let readings = [devices[0].read(tick as u64, 1e-3), devices[1].read(tick as u64, 1e-3)];
        let _ = devices[0].write(Wrench { force: DVec3::X, torque: DVec3::ZERO });
        let _ = devices[1].write(Wrench { force: DVec3::Z, torque: DVec3::ZERO });
        (readings, [steering.motors(0).force, steering.motors(1).force])
    });
    let place = |reading: Result<Reading, DeviceFault>| reading.map(|reading| reading.pose.position);
    let ([first, second], motors) = forces[5];
    assert!((place(first).expect("a reading") - 0.01 * DVec3::X).length() < 1e-12);
    assert!((place(second).expect("a reading") - 0.02 * DVec3::Y).length() < 1e-12);
    assert_eq!(motors, [DVec3::X, DVec3::Z]);
    let ([first, second], motors) = forces[15];
    assert!(first.is_ok(), "{first:?}");
    assert_eq!(second, Err(DeviceFault::Disconnected));
    assert_eq!(motors, [DVec3::X, DVec3::ZERO]);
    assert_eq!(steering.motors(0).force, DVec3::ZERO);
}

#[test]
fn a_device_that_is_not_calibrated_gets_no_force() {
    let emulated = emulated("Touch");
    emulated.disturb(0, Some(Disturbance::Uncalibrated));
    let error = openhaptics::open(&emulated.connection(None)).err().expect("refused").to_string();
    assert!(error.contains("not calibrated") && error.contains("inkwell"), "{error}");
    emulated.disturb(0, None);
    assert!(openhaptics::open(&emulated.connection(None)).is_ok());
}

/// A tick that panics is not called again, the library goes on, and nobody keeps a force.
#[test]
fn a_panic_does_not_reach_the_library() {
    let emulated = emulated("Touch");
    let ReadyDevice { mut device, scheduler } = openhaptics::open(&emulated.connection(None)).expect("opens");
    let scheduler = scheduler.expect("the library has its own loop");
    let mut tick = 0;
    let begun = scheduler.start(Box::new(move || {
        tick += 1;
        let _ = device.read(tick, 1e-3);
        let _ = device.write(Wrench { force: DVec3::X, torque: DVec3::ZERO });
        assert!(tick < 5, "as a test");
    }));
    begun.expect("the scheduler starts");
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!(emulated.motors(0).force, DVec3::ZERO);
    let second = scheduler.start(Box::new(|| ())).expect_err("it runs").to_string();
    assert!(second.contains("in use"), "{second}");
    scheduler.stop();
    scheduler.stop();
}

#[test]
fn the_list_tells_what_there_is_and_what_is_in_the_way() {
    let emulated = emulated("Touch");
    let listing = openhaptics::list(&emulated.connection(None));
    assert!(listing.missing.is_none() && listing.found.len() == 1 && listing.found[0].obstacle.is_none());
    assert!(listing.found[0].name.contains("Touch") && listing.found[0].limits.max_stiffness == 400.0);
    assert!(listing.facts.iter().any(|(name, fact)| *name == "version" && fact == "3.4.0"));
    let opened = openhaptics::open(&emulated.connection(None)).expect("opens after it was listed");
    let listing = openhaptics::list(&emulated.connection(None));
    assert!(listing.found[0].obstacle.as_ref().is_some_and(|obstacle| obstacle.what.contains("in use")));
    drop(opened);
    emulated.reset("");
    let missing = openhaptics::list(&emulated.connection(None)).missing.expect("nothing is there").to_string();
    assert!(missing.contains("Touch Setup"), "{missing}");
    let nowhere = Connection { library: Some("/nowhere/libHD.so".into()), ..Connection::default() };
    let missing = openhaptics::list(&nowhere).missing.expect("no library").to_string();
    assert!(missing.contains("/nowhere/libHD.so") && missing.contains("PALPATE_OPENHAPTICS_LIBRARY"), "{missing}");
}

/// Whatever the library says: no panic, no number that is none, no force that nobody wrote.
#[test]
fn nonsense_is_survived() {
    let emulated = emulated("Touch");
    let opened = vec![openhaptics::open(&emulated.connection(None)).expect("opens")];
    let steering = emulated.steering();
    steering.run_fast(true);
    let good = ticks(opened, 20_000, move |tick, devices| {
        // Some errors say that the device is gone; then it is well for a while, to come back.
        steering.disturb(0, if tick % 1000 < 900 { Some(Disturbance::Nonsense) } else { None });
        let reading = devices[0].read(1000 * tick as u64, 1e-3);
        if let Ok(reading) = reading {
            assert!(reading.pose.is_finite() && reading.twist.linear.is_finite() && reading.twist.angular.is_finite());
        }
        let _ = devices[0].write(Wrench { force: 0.5 * DVec3::X, torque: DVec3::ZERO });
        let force = steering.motors(0).force;
        assert!(force == DVec3::ZERO || (force - 0.5 * DVec3::X).length() < 1e-12, "{force}");
        reading.is_ok()
    });
    steering.run_fast(false);
    println!("{} good readings of {}", good.iter().filter(|good| **good).count(), good.len());
    for _ in 0..200 {
        steering.disturb(0, Some(Disturbance::Nonsense));
        let _ = openhaptics::list(&emulated.connection(None));
    }
}

/// Motors that are too warm are a fault, and come back: the amplifiers let the force through more and more.
#[test]
fn warm_motors_are_told_and_cool() {
    let emulated = emulated("Touch");
    let opened = vec![openhaptics::open(&emulated.connection(None)).expect("opens")];
    let steering = emulated.steering();
    let rows = ticks(opened, 300, move |tick, devices| {
        steering.disturb(0, if (5..10).contains(&tick) { Some(Disturbance::MotorsOff) } else { None });
        let reading = devices[0].read(tick as u64, 1e-3).map(|_| ());
        let _ = devices[0].write(Wrench { force: DVec3::X, torque: DVec3::ZERO });
        (reading, steering.motors(0).force.x)
    });
    assert_eq!(rows[4], (Ok(()), 1.0));
    assert_eq!(rows[7], (Err(DeviceFault::MotorsOff), 0.0));
    assert!(rows[12].0.is_ok() && rows[12].1 > 0.0 && rows[12].1 < 0.1, "{:?}", rows[12]);
    assert_eq!(rows[299], (Ok(()), 1.0));
}

const PUSHED: Wrench = Wrench { force: DVec3::X, torque: DVec3::ZERO };

/// A loop that another one replaces is dropped by whoever asked for it, while the library's thread ticks.
#[test]
fn another_thread_than_the_librarys_calls_nothing_of_it() {
    let emulated = emulated("Touch");
    let steering = emulated.steering();
    let opened = vec![openhaptics::open(&emulated.connection(None)).expect("opens")];
    let rows = ticks(opened, 3, move |tick, devices| {
        let before = steering.motors(0).force;
        let first = &mut devices[0];
        let elsewhere = (tick == 1).then(|| {
            std::thread::scope(|scope| {
                let other = scope.spawn(|| (first.write(Wrench::default()), first.write(PUSHED).is_err()));
                other.join().expect("no panic")
            })
        });
        if elsewhere.is_none() {
            let _ = first.read(tick as u64, 1e-3);
            let _ = first.write(PUSHED);
        }
        (elsewhere, before)
    });
    assert_eq!(rows[1], (Some((Ok(()), true)), DVec3::X));
    assert_eq!(rows[2], (None, DVec3::ZERO), "the frame without a force is the library's thread's");
}

/// A device that says it is broken and is not: the tick that says so has no force on the motors any more.
#[test]
fn a_device_that_cannot_be_read_is_let_go_at_once() {
    let emulated = emulated("Touch");
    let opened = vec![openhaptics::open(&emulated.connection(None)).expect("opens")];
    let steering = emulated.steering();
    let rows = ticks(opened, 12, move |tick, devices| {
        if tick == 10 {
            steering.disturb(0, Some(Disturbance::ReadsFail));
        }
        let reading = devices[0].read(tick as u64, 1e-3).map(|_| ());
        let _ = devices[0].write(if reading.is_ok() { PUSHED } else { Wrench::default() });
        (reading, steering.motors(0).force)
    });
    assert_eq!(rows[9], (Ok(()), DVec3::X));
    assert_eq!(rows[10], (Err(DeviceFault::Disconnected), DVec3::ZERO));
}

/// Before the library is stopped for a device that is lost, the others have no force: they would keep it.
#[test]
fn no_force_outlives_the_ticks_of_the_library() {
    let emulated = emulated("Touch, Left=PHANTOM Omni");
    let opened = vec![
        openhaptics::open(&emulated.connection(None)).expect("the default device"),
        openhaptics::open(&emulated.connection(Some("Left"))).expect("the other one"),
    ];
    let steering = emulated.steering();
    let rows = ticks(opened, 300, move |tick, devices| {
        if tick == 10 {
            steering.disturb(1, Some(Disturbance::Unplugged));
        }
        let force = steering.motors(0).force;
        let reading = devices[0].read(tick as u64, 1e-3).map(|_| ());
        let _ = devices[0].write(PUSHED);
        let _ = devices[1].read(tick as u64, 1e-3);
        let _ = devices[1].write(Wrench::default());
        (reading, force)
    });
    let first =
        rows.iter().find(|(reading, _)| *reading == Err(DeviceFault::Disconnected)).expect("the library is stopped");
    assert_eq!(first.1, DVec3::ZERO);
}

#[test]
fn a_loop_that_runs_is_not_stopped_for_another_device() {
    let emulated = emulated("Touch, Left=PHANTOM Omni");
    let ReadyDevice { mut device, scheduler } = openhaptics::open(&emulated.connection(None)).expect("opens");
    let scheduler = scheduler.expect("the library has its own loop");
    let begun = scheduler.start(Box::new(move || {
        let _ = device.read(0, 1e-3);
        let _ = device.write(PUSHED);
    }));
    begun.expect("the scheduler starts");
    let refused = openhaptics::open(&emulated.connection(Some("Left"))).err().map(|error| error.to_string());
    scheduler.stop();
    assert!(refused.as_ref().is_some_and(|error| error.contains("stop the loop first")), "{refused:?}");
    assert!(openhaptics::open(&emulated.connection(Some("Left"))).is_ok());
}

/// The loop goes on and says what is wrong, and is well again with the library.
#[test]
fn a_scheduler_that_does_not_start_again_is_a_fault() {
    let emulated = emulated("Touch");
    let ReadyDevice { mut device, scheduler } = openhaptics::open(&emulated.connection(None)).expect("opens");
    let scheduler = scheduler.expect("the library has its own loop");
    let (sender, readings) = std::sync::mpsc::channel();
    let begun = scheduler.start(Box::new(move || {
        let _ = sender.send(device.read(0, 1e-3).map(|_| ()));
        let _ = device.write(Wrench::default());
    }));
    begun.expect("the scheduler starts");
    let until = |wanted: Result<(), DeviceFault>| {
        while readings.recv_timeout(Duration::from_secs(5)).expect("the loop ticks") != wanted {}
    };
    until(Ok(()));
    emulated.disturb(0, Some(Disturbance::Unplugged));
    until(Err(DeviceFault::Disconnected));
    emulated.disturb(0, Some(Disturbance::SchedulerFails));
    std::thread::sleep(Duration::from_millis(1500));
    while readings.try_recv().is_ok() {}
    assert_eq!(readings.recv_timeout(Duration::from_millis(300)), Ok(Err(DeviceFault::Disconnected)));
    emulated.disturb(0, None);
    until(Ok(()));
    scheduler.stop();
}
