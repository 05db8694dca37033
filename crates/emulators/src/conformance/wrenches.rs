//! Checks of the forces on the motors: signs, units, limits, and nothing when nobody writes.

use std::ops::ControlFlow;
use std::time::Instant;

use glam::DVec3;
use palpate_devices::Wrench;

use super::readings::close_to;
use super::rig::{PERIOD, Rig};
use super::spring::{PUSH, STIFFNESS, Spring};
use super::{Bench, BenchSlot, Check, CheckResult, Tip};

pub fn checks<B: Bench>() -> Vec<Check<B>> {
    vec![
        Check { name: "a spring pushes back", run: |slot| slot.with_open(pushes_back) },
        Check { name: "torques are N m about right, away and up", run: |slot| slot.with_open(torques) },
        Check { name: "forces beyond its largest are clamped", run: |slot| slot.with_open(clamps) },
        Check { name: "a force that is not a number is none", run: |slot| slot.with_open(refuses_nan) },
        Check { name: "motors are off when the loop stops writing", run: |slot| slot.with_open(stops) },
        Check { name: "motors are off when it is closed, and it opens again", run: closes },
    ]
}

/// Pushing right gives a force to the left, of the size that was written.
fn pushes_back<B: Bench>(rig: &mut Rig<B>) -> CheckResult {
    let facts = rig.facts;
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        for offset in [PUSH * axis, -PUSH * axis] {
            let seen = rig.settle(Spring::to(facts.middle), move |bench| bench.set_tip(Tip::at(offset)))?;
            let tolerance = facts.force_tolerance + STIFFNESS * facts.position_tolerance;
            close_to("the force", seen.motors.force, -STIFFNESS * offset, tolerance)?;
            close_to("the force", seen.motors.force, seen.written.force, facts.force_tolerance)?;
            close_to("the torque of a force alone", seen.motors.torque, DVec3::ZERO, 0.1 * facts.force_tolerance)?;
        }
    }
    rig.settle(Spring::to(facts.middle), |bench| bench.set_tip(Tip::default())).map(|_| ())
}

/// Writes a wrench until the motors must have it.
pub fn write_and_settle<B: Bench>(rig: &mut Rig<B>, wrench: Wrench) -> Result<Wrench, String> {
    rig.after(rig.facts.late_ticks, move |bench, device, now_ns| {
        let reading = device.read(now_ns, PERIOD.as_secs_f64());
        match reading.and(device.write(wrench)) {
            Ok(()) => Ok(bench.motors()),
            Err(fault) => Err(format!("{wrench:?} is answered by a fault: {fault}")),
        }
    })
}

fn torques<B: Bench>(rig: &mut Rig<B>) -> CheckResult {
    let largest = rig.limits.max_torque;
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        // Motors of rotation that there are not get nothing, and forces are as they were.
        let torque = if largest > 0.0 { 0.5 * largest * axis } else { 0.05 * axis };
        let expected = if largest > 0.0 { torque } else { DVec3::ZERO };
        let motors = write_and_settle(rig, Wrench { force: 0.5 * axis, torque })?;
        close_to("the torque", motors.torque, expected, 0.1 * rig.facts.force_tolerance)?;
        close_to("the force", motors.force, 0.5 * axis, rig.facts.force_tolerance)?;
    }
    Ok(())
}

fn clamps<B: Bench>(rig: &mut Rig<B>) -> CheckResult {
    let (largest, largest_torque, tolerance) = (rig.limits.max_force, rig.limits.max_torque, rig.facts.force_tolerance);
    if largest.is_infinite() {
        return Ok(());
    }
    let direction = DVec3::new(0.6, 0.0, -0.8);
    let within = write_and_settle(rig, Wrench { force: 0.95 * largest * direction, torque: DVec3::ZERO })?;
    close_to("a force within the limit", within.force, 0.95 * largest * direction, tolerance)?;
    let beyond = write_and_settle(rig, Wrench { force: 3.0 * largest * direction, torque: DVec3::ZERO })?;
    if !beyond.force.is_finite()
        || beyond.force.length() > largest + tolerance
        || beyond.force.dot(direction) < 0.9 * largest
    {
        return Err(format!("three times the largest force, {largest} N, reaches the motors as {}", beyond.force));
    }
    close_to("the direction of a clamped force", beyond.force.normalize(), direction, 1e-2)?;
    if largest_torque > 0.0 {
        let torque = 3.0 * largest_torque * direction;
        let beyond = write_and_settle(rig, Wrench { force: DVec3::ZERO, torque })?.torque;
        close_to("a clamped torque", beyond, largest_torque * direction, 0.1 * tolerance)?;
    }
    let after = write_and_settle(rig, Wrench::default())?;
    close_to("no force", after.force, DVec3::ZERO, tolerance)
}

/// The driver may call it a fault, but the motors must not keep what they had.
fn refuses_nan<B: Bench>(rig: &mut Rig<B>) -> CheckResult {
    for broken in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        write_and_settle(rig, Wrench { force: DVec3::X, torque: DVec3::ZERO })?;
        let motors = rig.after(rig.facts.late_ticks, move |bench, device, now_ns| {
            let _ = device.read(now_ns, PERIOD.as_secs_f64());
            let _ = device.write(Wrench { force: DVec3::new(0.5, broken, 0.0), torque: DVec3::ZERO });
            Ok(bench.motors())
        })?;
        close_to("the force", motors.force, DVec3::ZERO, rig.facts.force_tolerance)?;
        // The fault, if it was one, is over with the next good wrench.
        let _ = write_and_settle(rig, Wrench::default());
    }
    Ok(())
}

/// Ticks that leave the device alone, as a loop does that hangs.
fn stops<B: Bench>(rig: &mut Rig<B>) -> CheckResult {
    let held = write_and_settle(rig, Wrench { force: DVec3::X, torque: DVec3::ZERO })?;
    close_to("the force", held.force, DVec3::X, rig.facts.force_tolerance)?;
    let (began, holds) = (Instant::now(), rig.facts.force_holds);
    let force = rig.each_tick(60_000, move |bench, _, _| {
        // One more tick's length, for the machine that runs the suite sleeps when it likes.
        match began.elapsed() > holds + PERIOD {
            true => ControlFlow::Break(Ok(bench.motors().force)),
            false => ControlFlow::Continue(()),
        }
    })?;
    close_to("the force after the loop has stopped", force, DVec3::ZERO, rig.facts.force_tolerance)
}

fn closes<B: Bench>(slot: &mut BenchSlot<B>) -> CheckResult {
    for _ in 0..2 {
        let (tolerance, holds) = slot.with_open(|rig| {
            let held = write_and_settle(rig, Wrench { force: DVec3::Z, torque: DVec3::ZERO })?;
            close_to("the force", held.force, DVec3::Z, rig.facts.force_tolerance)?;
            Ok((rig.facts.force_tolerance, rig.facts.force_holds))
        })?;
        std::thread::sleep(holds);
        let left = slot.bench().motors().force;
        close_to("the force after closing", left, DVec3::ZERO, tolerance)?;
    }
    Ok(())
}
