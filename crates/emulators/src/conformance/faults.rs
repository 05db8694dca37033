//! Fault checks: cables, errors, versions, delays, numbers that are not finite. No force outlives a fault by more
//! than a tick, and a device that has recovered works again in the same program.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use glam::DVec3;
use palpate_devices::{DeviceFault, OpenError};

use super::readings::close_to;
use super::rig::{PERIOD, Rig};
use super::spring::{PUSH, STIFFNESS, Spring};
use super::{Bench, BenchSlot, Check, CheckResult, Disturbance, Tip};

pub fn checks<B: Bench>() -> Vec<Check<B>> {
    vec![
        Check { name: "unplugged: no force, and plugged in it works again", run: |slot| slot.with_open(unplugged) },
        Check { name: "a driver's error: no force, and then it works again", run: |slot| slot.with_open(driver_error) },
        Check { name: "slow replies: stale, and then it works again", run: |slot| slot.with_open(slow_replies) },
        Check { name: "positions that are no numbers: no force", run: |slot| slot.with_open(not_finite) },
        Check { name: "a wrong version is refused", run: |slot| refused(slot, Disturbance::WrongVersion) },
        Check { name: "a device that is not there is refused", run: |slot| refused(slot, Disturbance::Unplugged) },
    ]
}

/// How long a fault is watched, where its ticks are slow.
const FAULT_WATCH: Duration = Duration::from_millis(300);

/// Time after which a fault must have been said.
fn fault_deadline<B: Bench>(rig: &Rig<B>) -> f64 {
    (rig.facts.stale_after + PERIOD * (2 + rig.facts.late_ticks as u32)).as_secs_f64()
}

/// Presses against the spring until something goes wrong; the fault. From the tick after the one that says so (or as many
/// later as the device is late) the motors have no force, for as long as it goes on.
fn without_force<B: Bench>(rig: &mut Rig<B>, disturbance: Disturbance) -> Result<DeviceFault, String> {
    let facts = rig.facts;
    let pressed = rig.settle(Spring::to(facts.middle), |bench| bench.set_tip(Tip::at(PUSH * DVec3::X)))?;
    close_to(
        "the force",
        pressed.motors.force,
        -STIFFNESS * PUSH * DVec3::X,
        STIFFNESS * facts.position_tolerance + facts.force_tolerance,
    )?;
    let (most, mut spring, mut began) = (fault_deadline(rig), Spring::to(facts.middle), None);
    let (mut after_fault, mut said_at) = (0, None);
    rig.each_tick(60_000, move |bench, device, now_ns| {
        let began = *began.get_or_insert_with(|| {
            bench.disturb(Some(disturbance));
            Instant::now()
        });
        let asked_after = began.elapsed().as_secs_f64();
        let (reading, _) = spring.tick(device, now_ns);
        if reading.is_ok_and(|reading| !reading.pose.is_finite()) {
            return ControlFlow::Break(Err("a reading has a position that is no number, without a fault".to_owned()));
        }
        let Some(fault) = spring.fault else {
            if asked_after > most {
                return ControlFlow::Break(Err(format!("no fault {asked_after} s after {disturbance:?}")));
            }
            return ControlFlow::Continue(());
        };
        let force = bench.motors().force;
        if after_fault > facts.late_ticks && force.length() > facts.force_tolerance {
            return ControlFlow::Break(Err(format!("{force} N, {after_fault} ticks after the fault: {fault}")));
        }
        after_fault += 1;
        // Slow replies may make slow ticks.
        let long = said_at.get_or_insert_with(Instant::now).elapsed() > FAULT_WATCH;
        let enough = if long { 2 } else { 50 } + facts.late_ticks;
        if after_fault > enough { ControlFlow::Break(Ok(fault)) } else { ControlFlow::Continue(()) }
    })
}

/// Whether the device, well again, gives readings in time, and after a reset forces.
fn recovers<B: Bench>(rig: &mut Rig<B>) -> CheckResult {
    let (facts, mut spring, mut began) = (rig.facts, Spring::to(rig.facts.middle), None);
    let mut good = 0;
    spring.fault = Some(DeviceFault::Stale);
    rig.each_tick(120_000, move |bench, device, now_ns| {
        let began = *began.get_or_insert_with(|| {
            bench.disturb(None);
            Instant::now()
        });
        let (reading, _) = spring.tick(device, now_ns);
        good = if reading.is_ok() { good + 1 } else { 0 };
        let force = bench.motors().force;
        if good > 2 * facts.late_ticks && force.length() > facts.force_tolerance {
            return ControlFlow::Break(Err(format!("{force} N before the reset")));
        }
        match reading {
            // A device that is back stays back.
            Ok(_) if good > 20 => ControlFlow::Break(Ok(())),
            Err(fault) if began.elapsed() > facts.recovers_within => {
                ControlFlow::Break(Err(format!("well again for {:?} and still: {fault}", began.elapsed())))
            }
            _ => ControlFlow::Continue(()),
        }
    })?;
    let pressed = rig.settle(Spring::to(facts.middle), |bench| bench.set_tip(Tip::at(-PUSH * DVec3::Y)))?;
    let tolerance = STIFFNESS * facts.position_tolerance + facts.force_tolerance;
    close_to("the force after the reset", pressed.motors.force, STIFFNESS * PUSH * DVec3::Y, tolerance)
}

/// A fault without force that is one of those expected, and afterwards works again.
fn faults_with<B: Bench>(rig: &mut Rig<B>, disturbance: Disturbance, expected: &[DeviceFault]) -> CheckResult {
    let fault = without_force(rig, disturbance)?;
    if !expected.contains(&fault) {
        return Err(format!("{disturbance:?} gives {fault:?}, none of {expected:?}"));
    }
    recovers(rig)
}

fn unplugged<B: Bench>(rig: &mut Rig<B>) -> CheckResult {
    let expected = [DeviceFault::Disconnected, DeviceFault::Stale];
    (0..2).try_for_each(|_| faults_with(rig, Disturbance::Unplugged, &expected))
}

fn driver_error<B: Bench>(rig: &mut Rig<B>) -> CheckResult {
    let expected = [rig.facts.driver_error];
    faults_with(rig, Disturbance::DriverError, &expected)
}

fn slow_replies<B: Bench>(rig: &mut Rig<B>) -> CheckResult {
    faults_with(rig, Disturbance::SlowReplies, &[DeviceFault::Stale])
}

fn not_finite<B: Bench>(rig: &mut Rig<B>) -> CheckResult {
    faults_with(rig, Disturbance::NotFinite, &[DeviceFault::NotFinite])
}

/// Does not open, with one line that says what is wrong and what to do; and opens when all is well.
fn refused<B: Bench>(slot: &mut BenchSlot<B>, disturbance: Disturbance) -> CheckResult {
    slot.bench().disturb(Some(disturbance));
    let error = match slot.bench().open() {
        Err(error) => error,
        Ok(_) => return Err(format!("opens at {disturbance:?}")),
    };
    useful(&error)?;
    slot.bench().disturb(None);
    let waited = Instant::now();
    loop {
        match slot.with_open(|_| Ok(())) {
            Ok(()) => return Ok(()),
            Err(still) if waited.elapsed() > slot.bench().facts().recovers_within => return Err(still),
            Err(_) => std::thread::sleep(10 * PERIOD),
        }
    }
}

fn useful(error: &OpenError) -> CheckResult {
    let line = error.to_string();
    if error.what.trim().is_empty() || error.advice.trim().is_empty() || line.contains('\n') || line.len() > 1000 {
        return Err(format!("the error does not say what to do in one line: {line:?}"));
    }
    Ok(())
}
