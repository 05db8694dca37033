//! Runs of given positions, tick by tick without a clock: as `palpate.Simulation.run` makes them.

use palpate_core::simulation::Pose;
use palpate_core::{Error, Result};
use palpate_servo::{Script, run};

use crate::session::Session;

/// Beside the ticks of the running loop, from rest: force on the device of the first tool, N, for each of its positions
/// (ticks x 3), m. The other tools stay out of the scene. A position that is not finite takes the first out too.
///
/// # Errors
/// Positions that are no rows of three.
pub fn forces(session: &Session, positions: &[f64]) -> Result<Vec<f64>> {
    let (rows, rest) = positions.as_chunks::<3>();
    if !rest.is_empty() {
        return Err(Error::Invalid(format!("positions are rows of three numbers, got {}", positions.len())));
    }
    let scene = &session.scene;
    let tools = scene.tools.len();
    let away = Pose { position: glam::DVec3::NAN, ..Pose::default() };
    let of_tick = |&row: &[f64; 3]| (0..tools).map(move |tool| if tool == 0 { Session::pose(row) } else { away });
    let poses: Vec<Pose> = rows.iter().flat_map(of_tick).collect();
    let script = Script {
        period: 1.0 / scene.scheduling.rate,
        poses: &poses,
        grabs: &[],
        strikes: &[],
        watch: &[],
        devices: &scene.devices,
    };
    let made = run(&scene.model, scene.limits, scene.settings, &scene.strain, &script, |_| {})?;
    Ok(made.forces.chunks_exact(tools).flat_map(|forces| forces[0].to_array()).collect())
}
