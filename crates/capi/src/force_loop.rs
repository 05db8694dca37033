//! The force loop of a scene: ticked by the program, or by a thread of its own.
//!
//! Two sides, each behind a lock of its own: that of the tick, which is only ever tried, never waited for; and that of
//! frames and settings, whose callers wait for each other. Between both stand the wait-free hand-offs of the servo.
#![allow(unsafe_code)] // called from C with raw pointers
#![allow(clippy::missing_safety_doc)] // palpate.h states at its top what holds for all pointers

use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};

use glam::DVec3;
use palpate_core::simulation::Pose;
use palpate_devices::Device;
use palpate_devices::simulated::{self, simulated};
use palpate_scene::{BodyId, Prepared, ToolId, unit_quaternion};
use palpate_servo::{ForceLoop, LoopHandle, Published, Servo, Settings, StrainWorker};

use crate::arguments::{hand_out, shared, take_back};
use crate::device::{DeviceEnd, brought};
use crate::scene::SceneGraph;
use crate::status::{Outcome, Refusal, Status, guarded};

/// A force loop. One thread at a time may tick it; any other threads may read frames and change settings meanwhile.
pub struct Loop {
    pub(crate) prepared: Prepared,
    bodies: Vec<BodyId>,
    tools: Vec<ToolId>,
    pub(crate) tick: Mutex<TickSide>,
    frame: Mutex<FrameSide>,
}

/// What a tick needs.
pub(crate) struct TickSide {
    /// None while the loop's own thread runs.
    pub force_loop: Option<ForceLoop>,
    pub ends: Vec<DeviceEnd>,
    /// Ticks so far.
    pub count: u64,
}

/// What frames and settings need.
pub(crate) struct FrameSide {
    runner: Runner,
    pub settings: Settings,
    /// The tick that was read last.
    pub latest: Published,
}

/// Who ticks.
enum Runner {
    Program { handle: LoopHandle, _worker: StrainWorker },
    Thread { servo: Servo, targets: Vec<simulated::Handle> },
}

impl FrameSide {
    /// The latest tick.
    pub fn refresh(&mut self) -> &Published {
        let latest = match &mut self.runner {
            Runner::Program { handle, .. } => handle.latest(),
            Runner::Thread { servo, .. } => servo.latest(),
        };
        self.latest.clone_from(latest);
        &self.latest
    }

    /// Changes the settings; one that is refused changes nothing.
    pub fn set(&mut self, settings: Settings) -> Outcome<()> {
        match &mut self.runner {
            Runner::Program { handle, .. } => handle.set(settings)?,
            Runner::Thread { servo, .. } => servo.set(settings)?,
        }
        self.settings = settings;
        Ok(())
    }
}

/// A loop for the program to tick, at rest.
fn to_be_ticked(prepared: &Prepared, settings: Settings) -> Outcome<(TickSide, Runner)> {
    let (ends, devices): (Vec<_>, Vec<_>) = prepared
        .devices
        .iter()
        .map(|limits| {
            let (end, device) = brought(*limits);
            (end, Box::new(device) as Box<dyn Device>)
        })
        .unzip();
    let (mut force_loop, mut handle) = ForceLoop::new(prepared.model.clone(), devices, prepared.limits, settings)?;
    let worker = force_loop.limit_strain(&mut handle, prepared.strain.clone())?;
    let side = TickSide { force_loop: Some(force_loop), ends, count: 0 };
    Ok((side, Runner::Program { handle, _worker: worker }))
}

impl Loop {
    fn new(graph: &SceneGraph) -> Outcome<Self> {
        let prepared = graph.scene.prepare()?;
        let (tick, mut runner) = to_be_ticked(&prepared, prepared.settings)?;
        let latest = match &mut runner {
            Runner::Program { handle, .. } => handle.latest().clone(),
            Runner::Thread { servo, .. } => servo.latest().clone(),
        };
        let frame = FrameSide { runner, settings: prepared.settings, latest };
        Ok(Self {
            bodies: graph.scene.bodies().map(|(id, _)| id).collect(),
            tools: graph.scene.tools().map(|(id, _)| id).collect(),
            tick: Mutex::new(tick),
            frame: Mutex::new(frame),
            prepared,
        })
    }

    /// The side of frames and settings; waits for others who are there, never for a tick.
    pub(crate) fn frame(&self) -> MutexGuard<'_, FrameSide> {
        self.frame.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The side of the tick; never waits.
    pub(crate) fn try_tick(&self) -> Outcome<MutexGuard<'_, TickSide>> {
        match self.tick.try_lock() {
            Ok(side) => Ok(side),
            Err(TryLockError::Poisoned(side)) => Ok(side.into_inner()),
            Err(TryLockError::WouldBlock) => Err(Refusal {
                status: Status::PalpateErrorBusy,
                message: "another thread is within a tick of this loop: tick it from one thread at a time".into(),
            }),
        }
    }

    /// Rank of a body in the loop.
    pub(crate) fn body(&self, handle: u32) -> Outcome<usize> {
        rank(&self.bodies, BodyId(handle)).ok_or_else(|| unknown("body", handle))
    }

    /// Rank of a tool in the loop.
    pub(crate) fn tool(&self, handle: u32) -> Outcome<usize> {
        rank(&self.tools, ToolId(handle)).ok_or_else(|| unknown("tool", handle))
    }

    /// Handles of a body and a tool by their ranks.
    pub(crate) fn handles(&self, body: usize, tool: usize) -> (u32, u32) {
        (self.bodies[body].0, self.tools[tool].0)
    }

    fn start(&self) -> Outcome<()> {
        let mut frame = self.frame();
        if let Runner::Thread { .. } = frame.runner {
            return Err(Refusal::state("the loop's own thread runs already"));
        }
        let mut tick = self.try_tick()?;
        let (targets, devices): (Vec<_>, Vec<_>) = self
            .tools
            .iter()
            .map(|_| {
                let (handle, device) = simulated();
                (handle, Box::new(device) as Box<dyn Device>)
            })
            .unzip();
        let Prepared { model, limits, scheduling, strain, .. } = &self.prepared;
        let (model, scheduling, strain) = (model.clone(), scheduling.clone(), strain.clone());
        let servo = Servo::start(model, devices, *limits, frame.settings, scheduling, strain)?;
        tick.force_loop = None;
        frame.runner = Runner::Thread { servo, targets };
        Ok(())
    }

    fn stop(&self) -> Outcome<()> {
        let mut frame = self.frame();
        if let Runner::Program { .. } = frame.runner {
            return Ok(());
        }
        let (side, runner) = to_be_ticked(&self.prepared, frame.settings)?;
        // Dropping the servo ends its thread and leaves the devices without a wrench.
        frame.runner = runner;
        *self.tick.lock().unwrap_or_else(PoisonError::into_inner) = side;
        Ok(())
    }
}

fn rank<T: PartialEq>(handles: &[T], handle: T) -> Option<usize> {
    handles.iter().position(|other| *other == handle)
}

fn unknown(what: &str, handle: u32) -> Refusal {
    Refusal::argument(format!("the loop has no {what} of the handle {handle}"))
}

/// Makes the loop of a scene as it is now, at rest, to be ticked by the program: seconds for large bodies. What changes in the
/// scene later does not change it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_new(scene: *const SceneGraph, force_loop: *mut *mut Loop) -> Status {
    guarded(|| {
        // SAFETY: the caller's pointer.
        let made = Loop::new(unsafe { shared(scene, "scene") }?)?;
        // SAFETY: the caller's pointer.
        unsafe { hand_out(made, force_loop, "loop") }?;
        Ok(Status::PalpateOk)
    })
}

/// Ends a loop and frees it; no thread may be in a call with it. Null is nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_free(force_loop: *mut Loop) {
    // SAFETY: the caller's pointer.
    guarded(|| unsafe {
        take_back(force_loop);
        Ok(Status::PalpateOk)
    });
}

/// Starts a thread of the loop's own at the rate of the scene, with simulated devices that palpate_loop_set_target moves.
/// Tools are out of the scene until then. The program cannot tick until palpate_loop_stop.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_start(force_loop: *mut Loop) -> Status {
    guarded(|| {
        // SAFETY: the caller's pointer.
        unsafe { shared(force_loop, "loop") }?.start()?;
        Ok(Status::PalpateOk)
    })
}

/// Stops that thread. The loop is at rest then, and for the program to tick; settings stay. Once more, it does nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_stop(force_loop: *mut Loop) -> Status {
    guarded(|| {
        // SAFETY: the caller's pointer.
        unsafe { shared(force_loop, "loop") }?.stop()?;
        Ok(Status::PalpateOk)
    })
}

/// Where a simulated tool should go; it follows as a light damped hand. Never grows.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Target {
    /// Of the tip, m, in the world.
    pub position: [f64; 3],
    /// World from tool, a unit quaternion w x y z; four zeros do not turn it.
    pub orientation: [f64; 4],
    /// At which the target goes on from there for a tenth of a second at most, m/s.
    pub velocity: [f64; 3],
    /// Whether the tool is in the scene: 0 or 1.
    pub active: u32,
    /// Whether it holds on to what it touches: 0 or 1.
    pub grab: u32,
}

/// Sends a simulated tool to a target, while the loop's own thread runs.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_set_target(force_loop: *mut Loop, tool: u32, target: *const Target) -> Status {
    guarded(|| {
        // SAFETY: the caller's pointers.
        let (own, target) = unsafe { (shared(force_loop, "loop")?, shared(target, "target")?) };
        let tool = own.tool(tool)?;
        let pose = pose(target.position, target.orientation);
        let velocity = DVec3::from(target.velocity);
        if !(pose.is_finite() && velocity.is_finite()) {
            return Err(Refusal::argument("target is not finite"));
        }
        let mut frame = own.frame();
        let Runner::Thread { targets, .. } = &mut frame.runner else {
            return Err(Refusal::state("targets are for the loop's own thread: call palpate_loop_start first"));
        };
        let (active, grab) = (target.active != 0, target.grab != 0);
        targets[tool].set(simulated::Target { pose, velocity, active, grab });
        Ok(Status::PalpateOk)
    })
}

/// A pose; without an orientation, four zeros, it is not turned.
pub(crate) fn pose(position: [f64; 3], orientation: [f64; 4]) -> Pose {
    match orientation {
        [0.0, 0.0, 0.0, 0.0] => Pose::at(position.into()),
        _ => Pose { position: position.into(), orientation: unit_quaternion(orientation) },
    }
}
