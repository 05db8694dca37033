//! Ticks along a script without a clock: the same script gives the same bits, in C as in Python.
#![allow(unsafe_code)] // called from C with raw pointers
#![allow(clippy::missing_safety_doc)] // palpate.h states at its top what holds for all pointers

use glam::DQuat;
use palpate_core::simulation::Pose;
use palpate_scene::{device_pose, wxyz};
use palpate_servo::Script;

use crate::arguments::{array, array_mut, optional_mut, require_count, shared};
use crate::scene::SceneGraph;
use crate::status::{Refusal, Status, catching_panics, set_last_error};

/// Moves the tools of a scene through positions, one tick a row: `positions` (ticks x tools, x y z, m; NAN takes a tool out of the
/// scene) and `orientations` (ticks x tools, w x y z; null does not turn them). `forces` gets the force on each device
/// after the safety stage (ticks x tools, N), `torques` that about each tip (N m), or is null.
///
/// Returns PALPATE_FAULT where a fault has latched; forces are zero from there on.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_scene_run(
    scene: *const SceneGraph,
    ticks: usize,
    tools: usize,
    positions: *const f64,
    orientations: *const f64,
    forces: *mut f64,
    torques: *mut f64,
) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointer.
        let prepared = unsafe { shared(scene, "scene") }?.scene.prepare()?;
        require_count("tools", tools, prepared.model.tools.len())?;
        let count = ticks
            .checked_mul(tools)
            .ok_or_else(|| Refusal::argument(format!("ticks is {ticks}, more than memory holds")))?;
        // SAFETY: the caller's pointers, to `count` of three or four numbers.
        let (positions, forces, torques) = unsafe {
            (
                array(positions.cast::<[f64; 3]>(), count, "positions")?,
                array_mut(forces.cast::<[f64; 3]>(), count, "forces")?,
                optional_mut(torques.cast::<[f64; 3]>(), count),
            )
        };
        let turned = match orientations.is_null() {
            true => None,
            // SAFETY: the caller's pointer.
            false => Some(unsafe { array(orientations.cast::<[f64; 4]>(), count, "orientations") }?),
        };
        let orientation = |rank: usize| turned.map_or(wxyz(DQuat::IDENTITY), |turned| turned[rank]);
        let pose = |(rank, &at): (usize, &[f64; 3])| device_pose(at, orientation(rank));
        let poses: Vec<Pose> = positions.iter().enumerate().map(pose).collect();
        let period = 1.0 / prepared.scheduling.rate;
        let script = Script { period, poses: &poses, grabs: &[], strikes: &[], watch: &[], devices: &prepared.devices };
        let (model, settings) = (&prepared.model, prepared.settings);
        let recording = palpate_servo::run(model, prepared.limits, settings, &prepared.strain, &script, |_| {})?;
        forces.iter_mut().zip(&recording.forces).for_each(|(to, f)| *to = f.to_array());
        torques.into_iter().flatten().zip(&recording.torques).for_each(|(to, t)| *to = t.to_array());
        Ok(match recording.fault {
            Some(fault) => {
                set_last_error(fault.to_string());
                Status::PalpateFault
            }
            None => Status::PalpateOk,
        })
    })
}
