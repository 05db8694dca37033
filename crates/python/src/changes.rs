//! Devices of a simulation, and what comes into it or goes out of it, also while its loop runs.

use std::sync::{Arc, PoisonError};

use palpate_core::simulation::{BodyModel, Kept, Model, ToolModel};
use palpate_core::{Error, Result};
use palpate_devices::simulated::{Handle, Target, simulated};
use palpate_devices::{Device, DeviceLimits, Mounted, Workspace};
use palpate_scene::placement;
use palpate_servo::{SceneChange, Settings};
use pyo3::prelude::*;

use crate::connection::{
    Connected, LimitsArguments, LoopDevice, OpenedDevice, WorkspaceArguments, limits_of, limits_tuple,
};
use crate::errors::to_python;
use crate::scene::{BodyArguments, ToolArguments, scene_body, tool};
use crate::simulation::{Parts, SimulationCore};

/// Bodies and tools of a changed scene, in order: those that stay by their rank before, with `None` for each that is new.
type Ranks = Vec<Option<usize>>;
/// Positions (m) and orientations (w x y z).
type Places = Vec<([f64; 3], [f64; 4])>;

/// Gives a tool a device for the next start, or at once where the loop runs.
#[pyfunction]
pub fn connect(
    py: Python<'_>,
    core: &SimulationCore,
    tool: usize,
    device: &mut OpenedDevice,
    workspace: WorkspaceArguments,
    limits: LimitsArguments,
) -> PyResult<()> {
    let _alone = core.changing(py);
    let connected = Connected::new(py, device, workspace, limits)?;
    let limits = connected.limits;
    let (changed, runs) = {
        let parts = core.parts(py);
        (parts.with_stiffness(parts.held_by(tool, &limits)), parts.servo.is_some())
    };
    if runs && connected.scheduler.is_some() {
        let message = "the device's driver calls the loop itself: stop the loop, and start it with the device";
        return Err(to_python(py, Error::Invalid(message.into())));
    }
    let model = py.detach(|| changed.model()).map_err(|e| to_python(py, e))?;
    if !runs {
        let mut parts = core.parts(py);
        parts.device_limits[tool] = limits;
        parts.connected[tool] = Some(connected);
        parts.model = model;
        return Ok(());
    }
    let kept = kept_of(&ranks(model.bodies.len()), &ranks(model.tools.len()));
    let mut devices: Vec<_> = model.tools.iter().map(|_| None).collect();
    let mut parts = core.parts(py);
    devices[tool] = Some(parts.device_of(tool, Some(connected)));
    parts.exchange(py, model, kept, devices, &Settings::default())?;
    parts.device_limits[tool] = limits;
    Ok(())
}

/// Lets go of devices that no loop has taken.
#[pyfunction]
pub fn disconnect(py: Python<'_>, core: &SimulationCore) {
    core.parts(py).connected.iter_mut().for_each(|device| *device = None);
}

/// What the device of each tool can render, in the scene.
#[pyfunction]
pub fn device_limits(py: Python<'_>, core: &SimulationCore) -> Vec<LimitsArguments> {
    core.parts(py).device_limits.iter().map(limits_tuple).collect()
}

/// Largest stiffness (N/m) that the scene asks for with each tool, and the one that its device leaves of it.
#[pyfunction]
pub fn tool_stiffness(py: Python<'_>, core: &SimulationCore) -> Vec<(f64, f64)> {
    let parts = core.parts(py);
    let asked = parts.asked.iter().map(|tool| tool.max_stiffness);
    asked.zip(parts.model.tools.iter().map(|tool| tool.max_stiffness)).collect()
}

/// Takes the devices of all tools to be such, before the loop starts: those of a recording, or of a scene.
#[pyfunction]
pub fn assume_devices(py: Python<'_>, core: &SimulationCore, limits: Vec<LimitsArguments>) -> PyResult<()> {
    let _alone = core.changing(py);
    let changed = {
        let mut parts = core.parts(py);
        for (tool, limits) in limits.into_iter().enumerate().take(parts.asked.len()) {
            parts.device_limits[tool] = limits_of(limits);
        }
        let tools = parts.asked.iter().zip(&parts.device_limits);
        parts.with_stiffness(tools.map(|(tool, device)| parts.held(tool, device)).collect())
    };
    let model = py.detach(|| changed.model()).map_err(|e| to_python(py, e))?;
    core.parts(py).model = model;
    Ok(())
}

/// Takes other bodies and tools: those that stay by their ranks, others in order; all bodies with their places. Devices of
/// new tools are simulated. The loop goes on if it runs. Gives the number of the scene that it is now. A body that stays may come with another store of the same surface,
/// in `exchanged` by its rank.
#[pyfunction]
#[pyo3(signature = (core, bodies, tools, exchanged=None))]
pub fn change(
    py: Python<'_>,
    core: &SimulationCore,
    bodies: (Ranks, Vec<BodyArguments<'_>>, Places),
    tools: (Ranks, Vec<ToolArguments>),
    exchanged: Option<(usize, BodyArguments<'_>)>,
) -> PyResult<u64> {
    let _alone = core.changing(py);
    let ((body_ranks, new_bodies, places), (tool_ranks, new_tools)) = (bodies, tools);
    let parts = new_bodies.iter().map(scene_body).collect::<PyResult<Vec<_>>>()?;
    let exchanged = exchanged.map(|(rank, body)| PyResult::Ok((rank, scene_body(&body)?))).transpose()?;
    let before = core.parts(py).model.clone();
    let make = || -> Result<_> {
        let mut built = parts.into_iter().map(|part| part.model());
        let mut made = new_tools.into_iter().map(tool);
        let mut exchanged = exchanged.map(|(rank, part)| Ok::<_, Error>((rank, part.model()?))).transpose()?;
        let bodies = body_ranks.iter().zip(places).map(|(rank, place)| {
            let body: BodyModel = match rank {
                Some(rank) if exchanged.as_ref().is_some_and(|(of, _)| of == rank) => {
                    let body = exchanged.take().map(|(_, body)| body).ok_or_else(missing)?;
                    same_surface(before.bodies.get(*rank).ok_or_else(missing)?, &body)?;
                    body
                }
                Some(rank) => before.bodies.get(*rank).cloned().ok_or_else(missing)?,
                None => built.next().ok_or_else(missing)??,
            };
            Ok(body.placed(placement(place.0, place.1)))
        });
        let bodies = bodies.collect::<Result<Vec<_>>>()?;
        let mut tools: Vec<(ToolModel, Option<(f64, f64)>)> = Vec::new();
        for rank in &tool_ranks {
            tools.push(match rank {
                Some(rank) => (before.tools.get(*rank).cloned().ok_or_else(missing)?, None),
                None => {
                    made.next().ok_or_else(missing)?.map(|(tool, radius, friction)| (tool, Some((radius, friction))))?
                }
            });
        }
        let model = before.changed(bodies, tools.iter().map(|(tool, _)| tool.clone()).collect())?;
        Ok((Arc::new(model), tools))
    };
    let (model, tools) = py.detach(make).map_err(|e| to_python(py, e))?;
    let (mut fresh, kept) = (Settings::default(), kept_of(&body_ranks, &tool_ranks));
    for (rank, (_, own)) in tools.iter().enumerate() {
        (fresh.contact_radius[rank], fresh.friction[rank]) = own.unwrap_or_default();
    }
    let settings = core.parts(py).settings.carried_over(&fresh, &kept);
    let radii = settings.contact_radius[..model.tools.len()].to_vec();
    let checked = py.detach(|| radii.iter().try_for_each(|&radius| model.check_contact_radius(radius)));
    checked.map_err(|e| to_python(py, e))?;
    let mut parts = core.parts(py);
    let devices = tool_ranks.iter().map(|rank| match rank {
        Some(_) => None,
        None => Some(parts.device_of(usize::MAX, None)),
    });
    let devices: Vec<_> = devices.collect();
    parts.exchange(py, model.clone(), kept, devices, &fresh)?;
    let moved = |rank: &Option<usize>| rank.map_or(DeviceLimits::UNLIMITED, |rank| parts.device_limits[rank]);
    parts.device_limits = tool_ranks.iter().map(moved).collect();
    let asked = tool_ranks.iter().zip(&model.tools);
    parts.asked = asked.map(|(rank, new)| rank.map_or_else(|| new.clone(), |rank| parts.asked[rank].clone())).collect();
    parts.scene += 1;
    Ok(parts.scene)
}

/// Refuses a store of another surface.
fn same_surface(one: &BodyModel, other: &BodyModel) -> Result<()> {
    let (one, other) = (one.green(), other.green());
    if one.surface_nodes == other.surface_nodes && one.surface.positions == other.surface.positions {
        return Ok(());
    }
    Err(Error::Invalid("the other store is not of the same body: its surface differs".into()))
}

fn missing() -> Error {
    Error::Invalid("the change names a body or tool that there is not".into())
}

/// All of so many, as they are.
fn ranks(count: usize) -> Ranks {
    (0..count).map(Some).collect()
}

/// By ranks before, in the new order.
fn kept_of(bodies: &[Option<usize>], tools: &[Option<usize>]) -> Kept {
    let mut kept = Kept::default();
    kept.bodies.iter_mut().zip(bodies).for_each(|(to, &rank)| *to = rank);
    kept.tools.iter_mut().zip(tools).for_each(|(to, &rank)| *to = rank);
    kept
}

/// A model with tools that ask for no more than so much.
struct WithStiffness {
    model: Arc<Model>,
    /// None where all tools stay as they are.
    tools: Option<Vec<ToolModel>>,
}

impl WithStiffness {
    /// Prepares it, which takes a while.
    fn model(self) -> Result<Arc<Model>> {
        let Some(tools) = self.tools else { return Ok(self.model) };
        Ok(Arc::new(self.model.changed(self.model.bodies.clone(), tools)?))
    }
}

impl Parts {
    /// The device of a tool: the one that is connected, or a simulated one at its target, with the limits that the scene gives it.
    pub(crate) fn device_of(&self, tool: usize, connected: Option<Connected>) -> LoopDevice {
        if let Some(Connected { device, scheduler, .. }) = connected {
            let device = device.into_inner().unwrap_or_else(PoisonError::into_inner);
            return LoopDevice { device, handle: None, scheduler };
        }
        let (handle, device) = simulated();
        let limits = self.device_limits.get(tool).copied().unwrap_or(DeviceLimits::UNLIMITED);
        let device: Box<dyn Device> = match limits == DeviceLimits::UNLIMITED {
            true => Box::new(device),
            false => Box::new(Mounted::new(Box::new(device), Workspace::default(), &limits)),
        };
        LoopDevice { device, handle: Some(handle), scheduler: None }
    }

    /// Largest stiffness that a tool may ask of a device.
    fn held(&self, tool: &ToolModel, device: &DeviceLimits) -> f64 {
        tool.max_stiffness.min(device.largest_stiffness(1.0 / self.scheduling.rate))
    }

    /// The same of all tools, one of which gets another device.
    fn held_by(&self, changed: usize, device: &DeviceLimits) -> Vec<f64> {
        let of_tool = |(rank, tool)| self.held(tool, if rank == changed { device } else { &self.device_limits[rank] });
        self.asked.iter().enumerate().map(of_tool).collect()
    }

    /// What the model becomes with tools that ask for no more than so much.
    fn with_stiffness(&self, held: Vec<f64>) -> WithStiffness {
        let same = self.model.tools.iter().zip(&held).all(|(tool, &held)| tool.max_stiffness == held);
        let tools = self.asked.iter().zip(held);
        let tools = tools.map(|(tool, max_stiffness)| ToolModel { max_stiffness, ..tool.clone() });
        WithStiffness { model: self.model.clone(), tools: (!same).then(|| tools.collect()) }
    }

    /// Takes a model some of whose bodies and tools were there before, in the loop too if it runs, with devices where they are
    /// new, and settings of what is new.
    fn exchange(
        &mut self,
        py: Python<'_>,
        model: Arc<Model>,
        kept: Kept,
        devices: Vec<Option<LoopDevice>>,
        fresh: &Settings,
    ) -> PyResult<()> {
        // As they are now: others may have changed them while the model was prepared.
        let settings = self.settings.carried_over(fresh, &kept);
        let tools = &kept.tools[..model.tools.len()];
        let strain = self.strain.changed(&model, &kept);
        let (handles, devices): (Vec<_>, Vec<_>) =
            devices.into_iter().map(|new| new.map_or((None, None), |new| (Some(new.handle), Some(new.device)))).unzip();
        let change = SceneChange { model: model.clone(), kept, devices, settings, strain: strain.clone() };
        if let Some(servo) = &mut self.servo {
            py.detach(|| servo.change(change)).map_err(|e| to_python(py, e))?;
            let mut before: Vec<_> = std::mem::take(&mut self.handles).into_iter().map(Some).collect();
            let of_tool = |(new, rank): (Option<Option<Handle>>, &Option<usize>)| {
                new.unwrap_or_else(|| rank.and_then(|rank| before.get_mut(rank)?.take()).flatten())
            };
            self.handles = handles.into_iter().zip(tools).map(of_tool).collect();
        }
        let target = |rank: &Option<usize>| rank.map_or_else(Target::default, |rank| self.targets[rank]);
        self.targets = tools.iter().map(target).collect();
        let mut connected: Vec<_> = std::mem::take(&mut self.connected);
        let stays = |rank: &Option<usize>| rank.and_then(|rank| connected.get_mut(rank)?.take());
        self.connected = tools.iter().map(stays).collect();
        (self.model, self.settings, self.strain) = (model, settings, strain);
        Ok(())
    }
}
