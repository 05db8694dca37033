//! The suite finds what it is there to find: a device without a flaw passes, one with a flaw fails the check that is about it.

use super::ideal::{Flaw, Ideal};
use super::{Seat, assert_conforms, checks};

#[test]
fn an_exact_device_passes() {
    assert_conforms(Ideal::new(None));
}

#[test]
fn every_flaw_is_found_by_the_check_that_is_about_it() {
    let found_by = [
        (Flaw::Unnamed, "tells its name and its limits"),
        (Flaw::MirroredPositions, "positions are metres, right, away and up"),
        (Flaw::Millimetres, "positions are metres, right, away and up"),
        (Flaw::SwappedAxes, "positions are metres, right, away and up"),
        (Flaw::LateReadings, "positions are metres, right, away and up"),
        (Flaw::MirroredVelocity, "velocities are m/s, right, away and up"),
        (Flaw::FastVelocity, "velocities are m/s, right, away and up"),
        (Flaw::InvertedOrientation, "orientations turn about right, away and up"),
        (Flaw::SwappedButtons, "buttons are bits, and button 0 grabs"),
        (Flaw::MirroredForce, "a spring pushes back"),
        (Flaw::StrongForce, "a spring pushes back"),
        (Flaw::LateForces, "a spring pushes back"),
        (Flaw::MillinewtonMetres, "torques are N m about right, away and up"),
        (Flaw::Unclamped, "forces beyond its largest are clamped"),
        (Flaw::ForceFromNan, "a force that is not a number is none"),
        (Flaw::ForceWithoutLoop, "motors are off when the loop stops writing"),
        (Flaw::ForceAfterClosing, "motors are off when it is closed, and it opens again"),
        (Flaw::SometimesFaulty, "no tick of many is missed"),
        (Flaw::SilentWhenUnplugged, "unplugged: no force, and plugged in it works again"),
        (Flaw::Unrecovered, "unplugged: no force, and plugged in it works again"),
        (Flaw::ForceAfterFault, "a driver's error: no force, and then it works again"),
        (Flaw::WrongError, "a driver's error: no force, and then it works again"),
        (Flaw::NeverStale, "slow replies: stale, and then it works again"),
        (Flaw::TellsNan, "positions that are no numbers: no force"),
        (Flaw::OpensWrongVersion, "a wrong version is refused"),
        (Flaw::BriefError, "a wrong version is refused"),
        (Flaw::OpensNothing, "a device that is not there is refused"),
    ];
    for (flaw, name) in found_by {
        let mut seat = Seat(Some(Ideal::new(Some(flaw))));
        let check = checks().into_iter().find(|check| check.name == name).expect("a check of this name");
        assert!((check.run)(&mut seat).is_err(), "{name:?} does not find {flaw:?}");
    }
}
