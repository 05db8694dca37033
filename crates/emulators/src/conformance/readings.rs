//! Checks of readings: position, velocity, orientation, buttons.

use glam::{DQuat, DVec3};
use palpate_devices::{Buttons, Reading};

use super::rig::{PERIOD, Rig};
use super::spring::{PUSH, Spring};
use super::{Bench, Check, CheckResult, Tip};

pub fn checks<B: Bench>() -> Vec<Check<B>> {
    vec![
        Check { name: "tells its name and its limits", run: |slot| slot.with_open(names_itself) },
        Check { name: "positions are metres, right, away and up", run: |slot| slot.with_open(places) },
        Check { name: "velocities are m/s, right, away and up", run: |slot| slot.with_open(motion) },
        Check { name: "orientations turn about right, away and up", run: |slot| slot.with_open(turns) },
        Check { name: "buttons are bits, and button 0 grabs", run: |slot| slot.with_open(buttons) },
    ]
}

pub fn close_to(what: &str, seen: DVec3, expected: DVec3, tolerance: f64) -> CheckResult {
    let distance = (seen - expected).length();
    if distance.is_nan() || distance > tolerance {
        return Err(format!("{what} is {seen}, not {expected} within {tolerance}"));
    }
    Ok(())
}

fn names_itself<B: Bench>(rig: &mut Rig<B>) -> CheckResult {
    let (name, limits) = (rig.name(), rig.limits);
    if name.trim().is_empty() || name.contains('\n') {
        return Err(format!("its name is {name:?}"));
    }
    let positive = [limits.max_force, limits.max_stiffness, limits.max_damping, limits.max_speed.unwrap_or(1.0)];
    let none_negative = [limits.max_torque, limits.max_angular_damping, limits.delay];
    if !positive.iter().all(|limit| *limit > 0.0) || !none_negative.iter().all(|limit| *limit >= 0.0) {
        return Err(format!("its limits are {limits:?}"));
    }
    Ok(())
}

fn places<B: Bench>(rig: &mut Rig<B>) -> CheckResult {
    let (middle, tolerance) = (rig.facts.middle, rig.facts.position_tolerance);
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        for offset in [PUSH * axis, -PUSH * axis] {
            let place = middle + offset;
            let seen = rig.settle(Spring::to(middle), move |bench| bench.set_tip(Tip::at(offset)))?;
            close_to("the position", seen.reading.pose.position, place, tolerance)?;
            close_to("the velocity at rest", seen.reading.twist.linear, DVec3::ZERO, rig.facts.velocity_tolerance)?;
            if !seen.reading.active {
                return Err("a tip that is there is not active".to_owned());
            }
        }
    }
    Ok(())
}

/// Lets the tip go on from where it is put, until its velocity is told: the last reading.
fn moved<B: Bench>(rig: &mut Rig<B>, tip: Tip) -> Result<Reading, String> {
    let (facts, mut spring) = (rig.facts, Spring::to(rig.facts.middle));
    rig.settle(Spring::to(facts.middle), move |bench| bench.set_tip(tip))?;
    let ticks = (facts.velocity_settles.as_secs_f64() / PERIOD.as_secs_f64()).ceil() as usize + facts.late_ticks;
    rig.after(ticks, move |_, device, now_ns| {
        spring.tick(device, now_ns).0.map_err(|fault| format!("a fault of a device that is well: {fault}"))
    })
}

fn motion<B: Bench>(rig: &mut Rig<B>) -> CheckResult {
    let tolerance = rig.facts.velocity_tolerance;
    for velocity in [0.1 * DVec3::X, 0.1 * DVec3::Y, 0.1 * DVec3::Z, DVec3::new(-0.05, 0.03, -0.08)] {
        let tip = Tip { velocity, ..Tip::at(DVec3::ZERO) };
        let reading = moved(rig, tip)?;
        close_to("the velocity", reading.twist.linear, velocity, tolerance)?;
    }
    Ok(())
}

fn turns<B: Bench>(rig: &mut Rig<B>) -> CheckResult {
    if !rig.facts.turns {
        return Ok(());
    }
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        let orientation = DQuat::from_axis_angle(axis, 0.4);
        let tip = Tip { orientation, ..Tip::default() };
        let seen = rig.settle(Spring::to(rig.facts.middle), move |bench| bench.set_tip(tip))?;
        let turned = DQuat::to_scaled_axis(seen.reading.pose.orientation);
        close_to("the orientation's rotation vector", turned, 0.4 * axis, 1e-3)?;
        let tip = Tip { angular_velocity: 0.5 * axis, ..Tip::default() };
        let spin = moved(rig, tip)?.twist.angular;
        close_to("the angular velocity", spin, 0.5 * axis, 0.05)?;
    }
    Ok(())
}

fn buttons<B: Bench>(rig: &mut Rig<B>) -> CheckResult {
    for button in 0..rig.facts.buttons {
        for pressed in [Buttons(1 << button), Buttons(0)] {
            let seen = rig.settle(Spring::to(rig.facts.middle), move |bench| bench.press(pressed))?;
            if seen.reading.buttons != pressed {
                return Err(format!("{pressed:?} held, {:?} reported", seen.reading.buttons));
            }
        }
    }
    let all = Buttons((1 << rig.facts.buttons) - 1);
    let seen = rig.settle(Spring::to(rig.facts.middle), move |bench| bench.press(all))?;
    rig.settle(Spring::to(rig.facts.middle), |bench| bench.press(Buttons(0)))?;
    if seen.reading.buttons != all || (all.grab() && !seen.reading.buttons.grab()) {
        return Err(format!("{all:?} held, {:?} reported", seen.reading.buttons));
    }
    Ok(())
}
