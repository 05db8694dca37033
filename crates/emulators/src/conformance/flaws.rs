//! Tests of the suite itself: a device without a flaw passes, one with a flaw fails the check that is about it.

use glam::DVec3;
use palpate_devices::{Buttons, DeviceFault, OpenError};

use super::ideal::{ERROR, Flaw, Ideal, MIDDLE};
use super::{BenchSlot, assert_conforms, checks};

#[test]
fn an_exact_device_passes() {
    assert_conforms(Ideal::new(None));
}

fn is_found(flaw: Flaw, found_by: &str) {
    let mut slot = BenchSlot(Some(Ideal::new(Some(flaw))));
    let check = checks().into_iter().find(|check| check.name == found_by).expect("a check of this name");
    assert!((check.run)(&mut slot).is_err(), "{found_by:?} does not find {flaw:?}");
}

#[test]
fn every_flaw_of_readings_is_found_by_the_check_that_is_about_it() {
    let positions = "positions are metres, right, away and up";
    let velocities = "velocities are m/s, right, away and up";
    is_found(Flaw::Reading(|reading| reading.pose.position.x *= -1.0), positions);
    is_found(Flaw::Reading(|reading| reading.pose.position *= 1e3), positions);
    is_found(
        Flaw::Reading(|reading| {
            let DVec3 { x, y, z } = reading.pose.position - MIDDLE;
            reading.pose.position = MIDDLE + DVec3::new(x, z, -y);
        }),
        positions,
    );
    is_found(Flaw::LateReadings, positions);
    is_found(Flaw::Reading(|reading| reading.twist.linear.y *= -1.0), velocities);
    is_found(Flaw::Reading(|reading| reading.twist.linear *= 1.05), velocities);
    is_found(
        Flaw::Reading(|reading| reading.pose.orientation = reading.pose.orientation.inverse()),
        "orientations turn about right, away and up",
    );
    is_found(
        Flaw::Reading(|reading| reading.buttons = Buttons(reading.buttons.0 << 1 & 0b111 | reading.buttons.0 >> 2)),
        "buttons are bits, and button 0 grabs",
    );
    is_found(Flaw::Unnamed, "tells its name and its limits");
}

#[test]
fn every_flaw_of_forces_is_found_by_the_check_that_is_about_it() {
    let spring = "a spring pushes back";
    is_found(Flaw::Wrench(|put, _| put.force = -put.force), spring);
    is_found(Flaw::Wrench(|put, _| put.force *= 1.05), spring);
    is_found(Flaw::LateForces, spring);
    is_found(Flaw::Wrench(|put, _| put.torque *= 1e3), "torques are N m about right, away and up");
    let unclamped = Flaw::Wrench(|put, wrench| {
        if wrench.force.is_finite() {
            put.force = wrench.force;
        }
    });
    is_found(unclamped, "forces beyond its largest are clamped");
    let from_nan = Flaw::Wrench(|put, wrench| {
        if !wrench.force.is_finite() {
            put.force = DVec3::X;
        }
    });
    is_found(from_nan, "a force that is not a number is none");
    is_found(Flaw::ForceWithoutLoop, "motors are off when the loop stops writing");
    is_found(Flaw::ForceAfterClosing, "motors are off when it is closed, and it opens again");
}

#[test]
fn every_flaw_of_faults_is_found_by_the_check_that_is_about_it() {
    let unplugged = "unplugged: no force, and plugged in it works again";
    let error = "a driver's error: no force, and then it works again";
    let sometimes =
        Flaw::Fault(|hardware, fault| fault.or((hardware.ticks.is_multiple_of(2_000)).then_some(DeviceFault::Stale)));
    is_found(sometimes, "no tick of many is missed");
    is_found(Flaw::Fault(|_, fault| fault.filter(|fault| *fault != DeviceFault::Disconnected)), unplugged);
    let unrecovered = Flaw::Fault(|hardware, fault| fault.or(hardware.lost.then_some(DeviceFault::Disconnected)));
    is_found(unrecovered, unplugged);
    is_found(Flaw::ForceAfterFault, error);
    let other = Flaw::Fault(|_, fault| fault.map(|fault| if fault == ERROR { DeviceFault::Driver(8) } else { fault }));
    is_found(other, error);
    is_found(
        Flaw::Fault(|_, fault| fault.filter(|fault| *fault != DeviceFault::Stale)),
        "slow replies: stale, and then it works again",
    );
    is_found(
        Flaw::Fault(|_, fault| fault.filter(|fault| *fault != DeviceFault::NotFinite)),
        "positions that are no numbers: no force",
    );
    is_found(Flaw::Refusal(|_| None), "a wrong version is refused");
    is_found(Flaw::Refusal(|_| None), "a device that is not there is refused");
    is_found(Flaw::Refusal(|error| Some(OpenError::new(error.what, ""))), "a wrong version is refused");
}
