//! States as the service writes them.

use glam::{DQuat, DVec3};
use serde_json::{Map, Value, json};

use super::arm::{Arm, Grip, MIDDLE};
use super::release::Release;
use super::world::{Session, World};

fn vector(v: DVec3) -> Value {
    json!({"x": v.x, "y": v.y, "z": v.z})
}

fn quaternion(q: DQuat) -> Value {
    json!({"w": q.w, "x": q.x, "y": q.y, "z": q.z})
}

/// A transform that does nothing.
fn identity(release: Release) -> Value {
    match release {
        Release::V35 => json!({}),
        _ => {
            json!({"position": vector(DVec3::ZERO), "rotation": quaternion(DQuat::IDENTITY), "scale": vector(DVec3::ONE)})
        }
    }
}

/// A message for a session: with the configuration of everything if it is a `full` one.
pub fn render(world: &World, number: u64, full: bool) -> Value {
    let session = world.sessions.get(&number).cloned().unwrap_or_default();
    let release = world.release;
    let plugged = world.arms.iter().filter(|arm| arm.plugged);
    let arms = plugged.map(|arm| (arm.id.clone(), render_arm(world, arm, &session, number, full)));
    let mut message = Map::new();
    message.insert("inverse3".into(), collected(release, arms));
    let grips = world.grips.iter().map(|grip| (grip.id.clone(), render_grip(release, grip, full)));
    message.insert("wireless_verse_grip".into(), collected(release, grips));
    // Grips by cable and those with an extension: there are none.
    message.insert("verse_grip".into(), collected(release, std::iter::empty()));
    if release >= Release::V34 {
        message.insert("custom_verse_grip".into(), collected(release, std::iter::empty()));
    }
    message.insert("session_id".into(), json!(number));
    if release >= Release::V35 {
        let basis = json!({"permutation": session.basis.as_deref().unwrap_or("XYZ")});
        let profile = json!({"name": session.profile.as_deref().unwrap_or("default")});
        let config = json!({"profile": profile, "started_time": 0, "basis": basis});
        message.insert("session".into(), json!({"session_id": number, "config": config}));
    }
    Value::Object(message)
}

/// Entries as an array, or before 3.1 as a map.
fn collected(release: Release, entries: impl Iterator<Item = (String, Value)>) -> Value {
    if release == Release::V30 { Value::Object(entries.collect()) } else { entries.map(|(_, entry)| entry).collect() }
}

fn render_arm(world: &World, arm: &Arm, session: &Session, number: u64, full: bool) -> Value {
    let release = world.release;
    let mut entry = json!({"device_id": arm.id, "state": arm_state(release, arm, session), "status": {
        "calibrated": arm.calibrated,
        "in_use": arm.commanded_by().is_some_and(|other| other != number),
        "power_supply": true,
        "ready": true,
        "started": true,
    }});
    if full {
        entry["config"] = arm_config(release, arm, session);
    }
    entry
}

fn arm_state(release: Release, arm: &Arm, session: &Session) -> Value {
    let is_centred = release.has_presets() && session.preset(&arm.id).ends_with("_centered");
    let position = arm.measured.position + if is_centred { DVec3::ZERO } else { MIDDLE };
    let has_command = arm.commanded_by().is_some();
    let angles = json!({"a0": 0, "a1": 0.0, "a2": 0});
    let mut state = json!({
        "cursor_position": vector(position),
        "cursor_velocity": vector(arm.measured.velocity),
        "angular_position": angles,
        "angular_velocity": angles,
        "body_orientation": quaternion(DQuat::IDENTITY),
        "mode": "idle",
        "control_domain": if has_command { "cartesian" } else { "undefined" },
        "control_mode": if has_command { "force" } else { "idle" },
        "transform": identity(release),
    });
    if release.repeats_commands() {
        state["current_cursor_force"] = vector(arm.motors.force);
        state["current_cursor_position"] = vector(DVec3::ZERO);
        state["current_angular_torques"] = angles.clone();
        state["current_angular_position"] = angles;
    }
    if release >= Release::V35 {
        state["transform_velocity"] = identity(release);
    }
    state
}

fn arm_config(release: Release, arm: &Arm, session: &Session) -> Value {
    let number = if arm.kind == "minverse" { 6 } else { 4 };
    // Both are seen: a number, and the name.
    let device_type = if release == Release::V31 { json!(arm.kind) } else { json!(number) };
    let mut config = json!({
        "type": arm.kind,
        "device_info": {
            "major_version": 7, "minor_version": 3, "id": 1, "device_type": device_type,
            "uuid": "00000000000000000000000000000001",
        },
        "port": "/dev/ttyACM0",
        "extended_device_id": arm.id,
        "extended_firmware_version": "7.3",
        "gravity_compensation": {"enabled": true, "scaling_factor": 1},
        "handedness": "right",
        "streaming_mode": "USB",
        "torque_scaling": {"enabled": true},
        "home_return": {"enabled": false},
    });
    if release.has_presets() {
        config["preset"] = json!(session.preset(&arm.id));
        config["basis"] = json!({"permutation": session.basis.as_deref().unwrap_or("XYZ")});
        config["mount"] = identity(release);
        config["filters"] = json!({"force_gate": {"gain": 0.3}, "damping": {"scalar": 0.0}});
    } else {
        config["cursor_offset"] = vector(DVec3::ZERO);
        config["coordinate_origin"] = json!("device_base");
    }
    config
}

fn render_grip(release: Release, grip: &Grip, full: bool) -> Value {
    let state = json!({
        "hall": 0, "orientation": quaternion(grip.orientation), "transform": identity(release),
        "buttons": {"a": grip.holds(0), "b": grip.holds(1), "c": grip.holds(2)},
        "battery_level": 0.8, "battery_voltage": 3.9,
    });
    let status = json!({"connected": grip.awake, "awake": grip.awake, "ready": grip.awake});
    let mut entry = json!({"device_id": grip.id, "state": state, "status": status});
    if full {
        entry["config"] = json!({
            "port": "/dev/ttyACM1", "type": "wireless_verse_grip", "major_version": 1, "minor_version": 2,
            "hardware_version": 1, "streaming_mode": "Radio",
        });
    }
    entry
}
