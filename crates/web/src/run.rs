//! Runs of given positions, tick by tick without a clock: as `palpate.Simulation.run` makes them.

use glam::DVec3;
use palpate_core::simulation::Pose;
use palpate_core::{Error, Result};
use palpate_scene::unit_quaternion;
use palpate_servo::{Recording, Script, run};

use crate::session::Session;

/// Beside the ticks of the running loop, from rest: force on the device of the first tool, N, for each of its positions
/// (ticks x 3), m. The other tools stay out of the scene. A position that is not finite takes the first out too.
///
/// # Errors
/// Positions that are no rows of three.
pub fn forces(session: &Session, positions: &[f64]) -> Result<Vec<f64>> {
    let tools = session.scene.tools.len();
    let away = Pose::at(DVec3::NAN);
    let of_tick = |&row: &[f64; 3]| (0..tools).map(move |tool| if tool == 0 { Pose::at(row.into()) } else { away });
    let poses: Vec<Pose> = rows(positions)?.iter().flat_map(of_tick).collect();
    let made = play(session, &poses)?;
    Ok(made.forces.chunks_exact(tools).flat_map(|forces| forces[0].to_array()).collect())
}

/// The time that each tick takes, us, and after all of them the forces on the devices, N: positions of all tools
/// (ticks x tools x 3), m, each turned by one orientation (w x y z).
///
/// # Errors
/// Positions that are no rows of three for each tool, or a fault.
pub fn times(session: &Session, positions: &[f64], orientation: [f64; 4]) -> Result<Vec<f64>> {
    let orientation = unit_quaternion(orientation);
    let poses: Vec<Pose> = rows(positions)?.iter().map(|&row| Pose { position: row.into(), orientation }).collect();
    let made = play(session, &poses)?;
    if let Some(fault) = made.fault {
        return Err(Error::Invalid(fault.to_string()));
    }
    let times = made.compute_ns.iter().map(|&ns| 1e-3 * ns as f64);
    Ok(times.chain(made.forces.iter().flat_map(|f| f.to_array())).collect())
}

fn rows(positions: &[f64]) -> Result<&[[f64; 3]]> {
    match positions.as_chunks::<3>() {
        (rows, []) => Ok(rows),
        _ => Err(Error::Invalid(format!("positions are rows of three numbers, got {}", positions.len()))),
    }
}

fn play(session: &Session, poses: &[Pose]) -> Result<Recording> {
    let scene = &session.scene;
    let script = Script {
        period: 1.0 / scene.scheduling.rate,
        poses,
        grabs: &[],
        strikes: &[],
        watch: &[],
        devices: &scene.devices,
    };
    run(&scene.model, scene.limits, scene.settings, &scene.strain, &script, |_| {})
}
