//! Adding, replacing and removing bodies, tools and devices of a simulation, also while its loop runs.

use std::sync::{Arc, PoisonError};
use std::time::Duration;

use palpate_core::simulation::{MAX_BODIES, MAX_TOOLS, PreviousRanks};
use palpate_core::{Error, Result};
use palpate_devices::DeviceLimits;
use palpate_devices::simulated::{Target, simulated_with};
use palpate_scene::{Body, BodyId, PreparedScene, Scene, ToolId, carried_over, placement};
use pyo3::prelude::*;

use crate::connection::{
    Connected, LimitsArguments, LoopDevice, OpenedDevice, WorkspaceArguments, limits_of, limits_tuple,
};
use crate::errors::Answer;
use crate::scene::{BodyArguments, ToolArguments, scene_body, scene_tool};
use crate::series::Series;
use crate::simulation::{RunningParts, SimulationCore};
use crate::strain::StrainMeasure;

/// Interval between two polls for a tick, and most polls.
const POLL_INTERVAL: Duration = Duration::from_millis(1);
const MAX_POLLS: u32 = 1000;

/// Gives a tool a device for the next start, or at once where the loop runs.
#[pyfunction]
pub fn connect(
    py: Python<'_>,
    core: &SimulationCore,
    tool: usize,
    device: &mut OpenedDevice,
    workspace: WorkspaceArguments,
    limits: LimitsArguments,
) -> Answer<()> {
    let _alone = core.changing(py);
    let connected = Connected::new(device, workspace, limits)?;
    let (limits, runs) = (connected.limits, core.parts(py).servo.is_some());
    if runs && connected.scheduler.is_some() {
        let message = "the device's driver calls the loop itself: stop the loop, and start it with the device";
        return Err(Error::Invalid(message.into()).into());
    }
    let change = core.prepare_change(py, |scene| {
        let id = tool_at(scene, tool)?;
        scene.set_device(id, limits);
        Ok(())
    })?;
    let mut parts = core.parts(py);
    let mut devices: Vec<_> = change.next.tools.iter().map(|_| None).collect();
    match runs {
        true => devices[tool] = Some(parts.device_of(tool, Some(connected))),
        false => parts.connected[tool] = Some(connected),
    }
    parts.exchange(py, change, devices)
}

/// Lets go of devices that no loop has taken.
#[pyfunction]
pub fn disconnect(py: Python<'_>, core: &SimulationCore) {
    core.parts(py).connected.iter_mut().for_each(|device| *device = None);
}

/// What the device of each tool can render, in the scene.
#[pyfunction]
pub fn device_limits(py: Python<'_>, core: &SimulationCore) -> Vec<LimitsArguments> {
    core.parts(py).prepared.devices.iter().map(limits_tuple).collect()
}

/// Largest stiffness (N/m) that the scene asks for with each tool, and the one that its device leaves of it.
#[pyfunction]
pub fn tool_stiffness(py: Python<'_>, core: &SimulationCore) -> Vec<(f64, f64)> {
    let parts = core.parts(py);
    let asked = parts.scene.tools().map(|(_, tool)| tool.max_stiffness);
    asked.zip(parts.prepared.model.tools.iter().map(|tool| tool.max_stiffness)).collect()
}

/// Takes the devices of all tools to be such, before the loop starts: those of a recording, or of a scene.
#[pyfunction]
pub fn assume_devices(py: Python<'_>, core: &SimulationCore, limits: Vec<LimitsArguments>) -> Answer<()> {
    core.change_scene(py, |scene| {
        let tools: Vec<_> = scene.tools().map(|(id, _)| id).collect();
        for (id, limits) in tools.into_iter().zip(limits) {
            scene.set_device(id, limits_of(limits));
        }
        Ok(())
    })
}

/// Gives every body a measure of its strain, in their order: from now on it can be limited.
#[pyfunction]
pub fn set_strain_measures(
    py: Python<'_>,
    core: &SimulationCore,
    measures: Vec<PyRef<'_, StrainMeasure>>,
) -> Answer<()> {
    let measures: Vec<_> = measures.iter().map(|measure| measure.measure.clone()).collect();
    core.change_scene(py, |scene| {
        let bodies: Vec<_> = scene.bodies().map(|(id, _)| id).collect();
        for (id, measure) in bodies.into_iter().zip(measures) {
            scene.set_strain_measure(id, measure);
        }
        Ok(())
    })
}

/// Adds a body, whose strain can be limited if it comes with a measure of it; the number of the scene that it is now.
#[pyfunction]
pub fn add_body(
    py: Python<'_>,
    core: &SimulationCore,
    body: BodyArguments<'_>,
    measure: Option<PyRef<'_, StrainMeasure>>,
) -> Answer<u64> {
    let body = Body { strain: measure.map(|measure| measure.measure.clone()), ..scene_body(&body)? };
    core.change_nodes(py, |scene| scene.add_body(body).map(|_| ()))
}

/// Exchanges a body for one of another store of the same surface.
#[pyfunction]
pub fn replace_body(py: Python<'_>, core: &SimulationCore, rank: usize, body: BodyArguments<'_>) -> Answer<u64> {
    let body = scene_body(&body)?;
    core.change_nodes(py, |scene| scene.replace_body(body_at(scene, rank)?, body))
}

/// Gives a body higher orders of its displacement below spheres of a radius, m. A running loop takes them up as soon as they change no
/// force. Whether there was room for them: a loop that ticks makes room.
#[pyfunction]
pub fn set_series(py: Python<'_>, core: &SimulationCore, body: usize, radius: f64, series: &Series) -> Answer<bool> {
    let _alone = core.changing(py);
    let series = py.detach(|| series.for_loop(radius));
    let mut parts = core.parts(py);
    let id = body_at(&parts.scene, body)?;
    let model = parts.prepared.model.with_series(body, series.clone())?;
    let before = std::mem::replace(&mut parts.prepared.model, Arc::new(model));
    let earlier = before.bodies[body].series().iter().filter(|earlier| earlier.radius == series.radius);
    parts.earlier_series.extend(earlier.map(|earlier| (id, earlier.radius, earlier.blocks.clone())));
    parts.scene.set_series(id, series.clone());
    Ok(parts.servo.as_mut().is_none_or(|servo| servo.offer_series(body, series)))
}

/// Has a running loop take up no more series, or go on taking them. Which blocks of places each tool has of each body: tool, body, and
/// whether each block is known; nothing where none is.
#[pyfunction]
pub fn hold_series(py: Python<'_>, core: &SimulationCore, held: bool) -> Vec<(usize, usize, Vec<bool>)> {
    let mut first = None;
    for _ in 0..MAX_POLLS {
        let mut parts = core.parts(py);
        let Some(servo) = &mut parts.servo else { break };
        servo.hold_series(held);
        let status = servo.latest().status;
        // A tick that has begun before may still take some.
        if status.ticks >= *first.get_or_insert(status.ticks + 2) || !held {
            return parts.known_blocks(&status.series_blocks);
        }
        drop(parts);
        py.detach(|| std::thread::sleep(POLL_INTERVAL));
    }
    Vec::new()
}

/// Positions (m) of the tools that are in the scene of a running loop, by tool.
#[pyfunction]
pub fn tool_positions(py: Python<'_>, core: &SimulationCore) -> Vec<(usize, [f64; 3])> {
    let mut parts = core.parts(py);
    let tools = parts.prepared.model.tools.len();
    let Some(servo) = &mut parts.servo else { return Vec::new() };
    let readings = servo.latest().status.readings[..tools].iter().enumerate();
    readings.filter(|(_, reading)| reading.active).map(|(tool, at)| (tool, at.pose.position.to_array())).collect()
}

/// Removes a body.
#[pyfunction]
pub fn remove_body(py: Python<'_>, core: &SimulationCore, rank: usize) -> Answer<u64> {
    core.change_nodes(py, |scene| body_at(scene, rank).map(|id| drop(scene.remove_body(id))))
}

/// Puts a body at a position (m), with an orientation (w x y z).
#[pyfunction]
pub fn place_body(
    py: Python<'_>,
    core: &SimulationCore,
    rank: usize,
    position: [f64; 3],
    orientation: [f64; 4],
) -> Answer<u64> {
    core.change_nodes(py, |scene| {
        let id = body_at(scene, rank)?;
        scene.place_body(id, placement(position, orientation));
        Ok(())
    })
}

/// Adds a tool, whose device is simulated.
#[pyfunction]
pub fn add_tool(py: Python<'_>, core: &SimulationCore, tool: ToolArguments) -> Answer<u64> {
    core.change_nodes(py, |scene| scene.add_tool(scene_tool(tool)?).map(|_| ()))
}

/// Removes a tool.
#[pyfunction]
pub fn remove_tool(py: Python<'_>, core: &SimulationCore, rank: usize) -> Answer<u64> {
    core.change_nodes(py, |scene| tool_at(scene, rank).map(|id| drop(scene.remove_tool(id))))
}

fn body_at(scene: &Scene, rank: usize) -> Result<BodyId> {
    let missing = || Error::Invalid(format!("the scene has no body {rank}"));
    scene.bodies().nth(rank).map(|(id, _)| id).ok_or_else(missing)
}

fn tool_at(scene: &Scene, rank: usize) -> Result<ToolId> {
    let missing = || Error::Invalid(format!("the scene has no tool {rank}"));
    scene.tools().nth(rank).map(|(id, _)| id).ok_or_else(missing)
}

/// A scene that has been prepared beside the loop.
struct Change {
    scene: Scene,
    next: PreparedScene,
    previous_ranks: PreviousRanks,
}

impl SimulationCore {
    /// Prepares the scene as `edit` leaves it.
    fn prepare_change(&self, py: Python<'_>, edit: impl FnOnce(&mut Scene) -> Result<()> + Send) -> Answer<Change> {
        let (mut scene, before) = {
            let parts = self.parts(py);
            (parts.scene.clone(), parts.prepared.clone())
        };
        Ok(py.detach(|| -> Result<Change> {
            edit(&mut scene)?;
            let (next, previous_ranks) = scene.prepare_change(&before)?;
            Ok(Change { scene, next, previous_ranks })
        })?)
    }

    /// Changes what is known of bodies and tools, which all stay.
    fn change_scene(&self, py: Python<'_>, edit: impl FnOnce(&mut Scene) -> Result<()> + Send) -> Answer<()> {
        let _alone = self.changing(py);
        let change = self.prepare_change(py, edit)?;
        let devices = change.next.tools.iter().map(|_| None).collect();
        self.parts(py).exchange(py, change, devices)
    }

    /// Changes which bodies and tools there are; the number of the scene that it is now.
    fn change_nodes(&self, py: Python<'_>, edit: impl FnOnce(&mut Scene) -> Result<()> + Send) -> Answer<u64> {
        let _alone = self.changing(py);
        let change = self.prepare_change(py, edit)?;
        let mut parts = self.parts(py);
        let new = |old: &Option<usize>| old.is_none().then(|| parts.device_of(usize::MAX, None));
        let devices = change.previous_ranks.tools[..change.next.tools.len()].iter().map(new).collect();
        parts.exchange(py, change, devices)?;
        parts.number += 1;
        Ok(parts.number)
    }
}

impl RunningParts {
    /// The series of which so many blocks are known, for each tool and body that has some.
    fn known_blocks(&self, counts: &[[u32; MAX_BODIES]; MAX_TOOLS]) -> Vec<(usize, usize, Vec<bool>)> {
        let PreparedScene { model, bodies, .. } = &self.prepared;
        let mut found = Vec::new();
        for (tool, fixed) in model.tools.iter().enumerate() {
            for (body, id) in bodies.iter().enumerate() {
                let now = model.bodies[body].series().iter().map(|series| (series.radius, &series.blocks));
                let earlier = self.earlier_series.iter().filter(|(of, ..)| of == id);
                let mut all = now.chain(earlier.map(|(_, radius, blocks)| (*radius, blocks)));
                let count = |blocks: &[bool]| blocks.iter().filter(|known| **known).count() as u32;
                let given = all.find(|(radius, blocks)| *radius == fixed.radius && count(blocks) == counts[tool][body]);
                found.extend(given.map(|(_, blocks)| (tool, body, blocks.clone())));
            }
        }
        found
    }

    /// The device of a tool: the one that is connected, or a simulated one at its target, with the limits that the scene gives it.
    pub(crate) fn device_of(&self, tool: usize, connected: Option<Connected>) -> LoopDevice {
        if let Some(Connected { device, scheduler, .. }) = connected {
            let device = device.into_inner().unwrap_or_else(PoisonError::into_inner);
            return LoopDevice { device, handle: None, scheduler };
        }
        let (handle, device) = simulated_with(self.prepared.devices.get(tool).unwrap_or(&DeviceLimits::UNLIMITED));
        LoopDevice { device, handle: Some(handle), scheduler: None }
    }

    /// Goes on with a changed scene, in the loop too if it runs, with devices where they are new.
    fn exchange(&mut self, py: Python<'_>, change: Change, devices: Vec<Option<LoopDevice>>) -> Answer<()> {
        let Change { scene, next, previous_ranks } = change;
        let new_tools: Vec<_> = previous_ranks.tools[..next.tools.len()].iter().map(Option::is_none).collect();
        let (handles, devices) =
            devices.into_iter().map(|new| new.map(|new| (new.handle, new.device)).unzip()).unzip::<_, _, _, Vec<_>>();
        let Self { prepared, servo, .. } = self;
        py.detach(|| prepared.continue_with(next, previous_ranks, servo.as_mut(), devices))?;
        self.handles = carried_over(std::mem::take(&mut self.handles), handles, &previous_ranks);
        let connected = new_tools.iter().map(|new| new.then_some(None)).collect();
        self.connected = carried_over(std::mem::take(&mut self.connected), connected, &previous_ranks);
        let targets = new_tools.iter().map(|new| new.then(Target::default)).collect();
        self.targets = carried_over(std::mem::take(&mut self.targets), targets, &previous_ranks);
        self.scene = scene;
        Ok(())
    }
}
