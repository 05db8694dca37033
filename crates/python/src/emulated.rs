//! Run of a simulation on emulated devices, and the table of known devices.

use std::ops::ControlFlow;

use glam::DVec3;
use numpy::IntoPyArray;
use palpate_devices::emulated::{Command, Hand, HandTarget, Mechanics, Tip, Waypoint, emulated, known};
use palpate_devices::{Buttons, DeviceLimits};
use palpate_scene::PreparedScene;
use palpate_servo::{Emulation, SafetyLimits};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::Answer;
use crate::simulation::SimulationCore;

/// Mass (kg), damping (N s/m), dry friction (N), step of the encoder (m) and delay (s) of a tip.
type MechanicsArguments = [f64; 5];
/// Mass (kg), damping (N s/m) and stiffness (N/m) of a hand, and its waypoints: time (s) and place (m).
type HandArguments = ([f64; 3], Vec<(f64, [f64; 3])>);
/// Mechanics, largest force (N), stiffness (N/m) and damping (N s/m) of a device, place (m) and velocity (m/s) of its tip at
/// first, the hand that holds it, and whether it holds on to what it touches.
type DeviceArguments = (MechanicsArguments, [f64; 3], [[f64; 3]; 2], Option<HandArguments>, bool);

/// Known devices by name: largest force (N), stiffness (N/m) and damping (N s/m), and assumed mechanics.
#[pyfunction]
pub fn known_devices() -> Vec<(&'static str, [f64; 3], MechanicsArguments)> {
    let all = palpate_devices::known::ALL.iter().zip(known::ALL);
    let row = |((name, limits), (_, tip)): (&(&'static str, DeviceLimits), (&str, Mechanics))| {
        let Mechanics { mass, damping, dry_friction, encoder_step, delay } = tip;
        let limits = [limits.max_force, limits.max_stiffness, limits.max_damping];
        (*name, limits, [mass, damping, dry_friction, encoder_step, delay])
    };
    all.map(row).collect()
}

/// Ticks of a simulation on emulated devices, one a tool and `period` seconds apart: `until` is how many, and a distance, m, from
/// where it began beyond which a tip ends them before. `limits` are force (N), slew (N/s), ramp (s) and strongest damping (N s/m) of the safety stage, all
/// others being infinite; None for those of the scene.
#[pyfunction]
pub fn emulate<'py>(
    py: Python<'py>,
    core: &SimulationCore,
    devices: Vec<DeviceArguments>,
    limits: Option<[f64; 4]>,
    period: f64,
    until: (usize, f64),
) -> Answer<Bound<'py, PyDict>> {
    let (ticks, reach) = until;
    let starts: Vec<DVec3> = devices.iter().map(|(_, _, [start, _], _, _)| DVec3::from(*start)).collect();
    let devices = devices.into_iter().map(device).collect();
    let PreparedScene { model, limits: of_scene, settings, strain, .. } = core.prepared(py);
    let limits = limits.map_or(of_scene, stage);
    let mut columns: [Vec<f64>; 4] = Default::default();
    let mut fault = None;
    let emulation = Emulation { model: &model, limits, settings, strain: &strain, period };
    let ran = py.detach(|| {
        emulation.run(devices, |tick, _| {
            let mut runs_away = false;
            for (tool, start) in starts.iter().enumerate() {
                let true_motion = tick.true_motions[tool];
                let read_position = tick.readings[tool].pose.position;
                let row = [true_motion.position, true_motion.velocity, read_position, tick.wrenches[tool].force];
                columns.iter_mut().zip(row).for_each(|(column, vector)| column.extend(vector.to_array()));
                let away = true_motion.position.distance(*start);
                runs_away |= away > reach || !away.is_finite();
            }
            fault = fault.or(tick.fault);
            if runs_away || tick.number + 1 >= ticks { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })
    });
    ran?;
    let answer = PyDict::new(py);
    for (name, column) in ["positions", "velocities", "measured", "forces"].into_iter().zip(columns) {
        answer.set_item(name, column.into_pyarray(py))?;
    }
    answer.set_item("fault", fault.map(|fault| fault.to_string()))?;
    Ok(answer)
}

fn device(
    (mechanics, limits, [start, velocity], hand, grab): DeviceArguments,
) -> (palpate_devices::emulated::Handle, palpate_devices::emulated::EmulatedDevice) {
    let [mass, damping, dry_friction, encoder_step, delay] = mechanics;
    let mechanics = Mechanics { mass, damping, dry_friction, encoder_step, delay };
    let hand = hand.map(|([mass, damping, stiffness], waypoints)| {
        let waypoint = |(time, place): (f64, [f64; 3])| Waypoint { time, position: place.into() };
        let target = HandTarget::Along(waypoints.into_iter().map(waypoint).collect());
        Hand { mass, damping, stiffness, target }
    });
    let tip = Tip::new(mechanics, start.into(), hand).moving(velocity.into());
    let [max_force, max_stiffness, max_damping] = limits;
    let limits = DeviceLimits { max_force, max_stiffness, max_damping, ..DeviceLimits::UNLIMITED };
    let (mut handle, device) = emulated("emulated", tip, limits);
    let buttons = if grab { Buttons::GRAB } else { Buttons::default() };
    handle.set(Command { buttons, ..Command::default() });
    (handle, device)
}

/// A stage with four limits only.
fn stage([max_force, max_slew, ramp, max_damping]: [f64; 4]) -> SafetyLimits {
    let most = f64::INFINITY;
    SafetyLimits {
        max_force,
        max_slew,
        ramp,
        max_damping,
        max_torque: most,
        max_torque_slew: most,
        max_angular_damping: 0.0,
        max_reading_age: most,
        max_speed: most,
        max_compute: most,
        max_overruns: u32::MAX,
    }
}
