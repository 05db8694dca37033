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
use palpate_devices::simulated::{self, simulated_with};
use palpate_scene::{BodyId, PreparedScene, ToolId, carried_over, unit_quaternion};
use palpate_servo::{ForceLoop, LoopHandle, Published, Servo, StrainWorker, check_period};

use crate::arguments::{free_handle, shared, store_handle};
use crate::device::{DeviceEnd, program_device};
use crate::scene::SceneGraph;
use crate::status::{Outcome, Refusal, Status, catching_panics};
use crate::store::Store;

/// A force loop. One thread at a time may tick it; any other threads may read frames and change settings meanwhile.
pub struct Loop {
    tick: Mutex<TickSide>,
    frame: Mutex<FrameSide>,
    /// Held while another scene is prepared.
    changing: Mutex<()>,
    /// Number of the scene that it was made of.
    scene: u64,
}

// What the header says of threads.
const _: fn() = || {
    fn is_shared_by_threads<T: Sync>() {}
    is_shared_by_threads::<Loop>();
    is_shared_by_threads::<Store>();
};

/// What a tick needs.
pub(crate) struct TickSide {
    /// None while the loop's own thread runs.
    pub force_loop: Option<ForceLoop>,
    pub ends: Vec<DeviceEnd>,
}

/// What frames and settings need.
pub(crate) struct FrameSide {
    pub prepared: PreparedScene,
    runner: Runner,
    /// The tick that was read last.
    pub latest: Published,
}

/// Who ticks.
enum Runner {
    Program { handle: Box<LoopHandle>, _worker: StrainWorker },
    Thread { servo: Box<Servo>, targets: Vec<simulated::Handle> },
}

impl FrameSide {
    /// The latest tick.
    pub fn refresh(&mut self) -> &Published {
        self.latest.clone_from(self.runner.handle().latest());
        &self.latest
    }

    /// Rank of a body in the loop.
    pub fn body(&self, handle: u32) -> Outcome<usize> {
        self.prepared.rank_of_body(BodyId(handle)).ok_or_else(|| unknown("body", handle))
    }

    /// Rank of a tool in the loop.
    pub fn tool(&self, handle: u32) -> Outcome<usize> {
        self.prepared.rank_of_tool(ToolId(handle)).ok_or_else(|| unknown("tool", handle))
    }

    /// The end to which changes are sent.
    pub fn handle(&mut self) -> &mut LoopHandle {
        self.runner.handle()
    }

    /// Refuses devices of the program that cannot be ticked with a time between two ticks, s.
    pub fn check_period(&self, period: f64) -> Outcome {
        if let Runner::Thread { .. } = self.runner {
            return Err(running());
        }
        Ok(check_period(&self.prepared.model, &self.prepared.devices, period)?)
    }

    /// Changes a setting of a tool or body, or of the scene (rank 0); one that is refused changes nothing.
    pub fn set(&mut self, name: &str, rank: usize, value: f64) -> Outcome {
        let mut settings = self.prepared.settings;
        settings.set(name, rank, value)?;
        self.runner.handle().set(settings)?;
        self.prepared.settings = settings;
        Ok(())
    }
}

impl Runner {
    fn handle(&mut self) -> &mut LoopHandle {
        match self {
            Self::Program { handle, .. } => handle,
            Self::Thread { servo, .. } => servo,
        }
    }
}

/// A loop for the program to tick, at rest.
fn to_be_ticked(prepared: &PreparedScene) -> Outcome<(TickSide, Runner)> {
    let (ends, devices): (Vec<_>, Vec<_>) = prepared
        .devices
        .iter()
        .map(|limits| {
            let (end, device) = program_device(*limits);
            (end, Box::new(device) as Box<dyn Device>)
        })
        .unzip();
    let (mut force_loop, mut handle) =
        ForceLoop::new(prepared.model.clone(), devices, prepared.limits, prepared.settings)?;
    let worker = force_loop.limit_strain(&mut handle, prepared.strain.clone())?;
    let side = TickSide { force_loop: Some(force_loop), ends };
    Ok((side, Runner::Program { handle: Box::new(handle), _worker: worker }))
}

impl Loop {
    fn new(graph: &SceneGraph) -> Outcome<Self> {
        let prepared = graph.scene.prepare()?;
        let (tick, mut runner) = to_be_ticked(&prepared)?;
        let latest = runner.handle().latest().clone();
        let frame = FrameSide { runner, latest, prepared };
        Ok(Self { tick: Mutex::new(tick), frame: Mutex::new(frame), changing: Mutex::new(()), scene: graph.number })
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

    fn start(&self) -> Outcome {
        let mut frame = self.frame();
        if let Runner::Thread { .. } = frame.runner {
            return Err(Refusal::state("the loop's own thread runs already"));
        }
        let (targets, devices) = frame.prepared.devices.iter().map(simulated_with).unzip();
        let PreparedScene { model, limits, settings, scheduling, strain, .. } = frame.prepared.clone();
        let servo = Servo::start(model, devices, limits, settings, scheduling, strain, None)?;
        // Not before: a start that is refused must not have kept the program from ticking.
        self.try_tick()?.force_loop = None;
        frame.runner = Runner::Thread { servo: Box::new(servo), targets };
        Ok(())
    }

    fn stop(&self) -> Outcome {
        let mut frame = self.frame();
        if let Runner::Program { .. } = frame.runner {
            return Ok(());
        }
        let (side, runner) = to_be_ticked(&frame.prepared)?;
        // Dropping the servo ends its thread and leaves the devices without a wrench.
        frame.runner = runner;
        *self.tick.lock().unwrap_or_else(PoisonError::into_inner) = side;
        Ok(())
    }

    fn change(&self, graph: &SceneGraph) -> Outcome {
        if graph.number != self.scene {
            // Its handles are other bodies and tools.
            return Err(Refusal::argument("scene is not the one that the loop was made of"));
        }
        let _one_at_a_time = self.changing.lock().unwrap_or_else(PoisonError::into_inner);
        // Beside the loop, frames and settings.
        let before = self.frame().prepared.clone();
        let (next, previous_ranks) = graph.scene.prepare_change(&before)?;
        let mut frame = self.frame();
        let FrameSide { prepared, runner, latest } = &mut *frame;
        let Runner::Thread { servo, targets } = runner else {
            return Err(Refusal::state(
                "the scene changes under the loop's own thread only: call palpate_loop_start first, or make a new loop",
            ));
        };
        let tools = previous_ranks.tools.iter().zip(&next.devices);
        let (fresh, devices) = tools.map(|(old, limits)| old.is_none().then(|| simulated_with(limits)).unzip()).unzip();
        prepared.continue_with(next, previous_ranks, Some(servo.as_mut()), devices)?;
        *targets = carried_over(std::mem::take(targets), fresh, &previous_ranks);
        *latest = servo.latest().clone();
        Ok(())
    }
}

pub(crate) fn running() -> Refusal {
    Refusal::state("the loop's own thread ticks it: call palpate_loop_stop first")
}

fn unknown(what: &str, handle: u32) -> Refusal {
    Refusal::argument(format!("the loop has no {what} of the handle {handle}"))
}

/// Makes the loop of a scene as it is now, at rest, to be ticked by the program: seconds for large bodies. What changes in the
/// scene later does not change it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_new(scene: *const SceneGraph, force_loop: *mut *mut Loop) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointer.
        let new_loop = Loop::new(unsafe { shared(scene, "scene") }?)?;
        // SAFETY: the caller's pointer.
        unsafe { store_handle(new_loop, force_loop, "loop") }
    })
}

/// Ends a loop and frees it; no thread may be in a call with it. Null is nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_free(force_loop: *mut Loop) {
    // SAFETY: the caller's pointer.
    catching_panics(|| unsafe { free_handle(force_loop) });
}

/// Starts a thread of the loop's own at the rate of the scene, with simulated devices that palpate_loop_set_target moves.
/// Tools are out of the scene until then. The program cannot tick until palpate_loop_stop.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_start(force_loop: *mut Loop) -> Status {
    // SAFETY: the caller's pointer.
    catching_panics(|| unsafe { shared(force_loop, "loop")?.start() })
}

/// Stops that thread. The loop is at rest then, and for the program to tick; settings stay. Once more, it does nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_stop(force_loop: *mut Loop) -> Status {
    // SAFETY: the caller's pointer.
    catching_panics(|| unsafe { shared(force_loop, "loop")?.stop() })
}

/// Exchanges the bodies and tools of a loop for those of its scene as it is now, while the loop's own thread runs: contacts
/// between those that stay go on, and new tools are out of the scene until they get a target. `scene` must be the one that the
/// loop was made of. Takes as long as it takes to prepare what is new; the loop ticks meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_loop_change(force_loop: *mut Loop, scene: *const SceneGraph) -> Status {
    catching_panics(|| {
        // SAFETY: the caller's pointers.
        let (own, scene) = unsafe { (shared(force_loop, "loop")?, shared(scene, "scene")?) };
        own.change(scene)
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
    catching_panics(|| {
        // SAFETY: the caller's pointers.
        let (own, target) = unsafe { (shared(force_loop, "loop")?, shared(target, "target")?) };
        let pose = pose(target.position, target.orientation);
        let velocity = DVec3::from(target.velocity);
        if !(pose.is_finite() && velocity.is_finite()) {
            return Err(Refusal::argument("target is not finite"));
        }
        let mut frame = own.frame();
        let tool = frame.tool(tool)?;
        let Runner::Thread { targets, .. } = &mut frame.runner else {
            return Err(Refusal::state("targets are for the loop's own thread: call palpate_loop_start first"));
        };
        let (active, grab) = (target.active != 0, target.grab != 0);
        targets[tool].set(simulated::Target { pose, velocity, active, grab });
        Ok(())
    })
}

/// A pose; without an orientation, four zeros, it is not turned.
pub(crate) fn pose(position: [f64; 3], orientation: [f64; 4]) -> Pose {
    match orientation {
        [0.0, 0.0, 0.0, 0.0] => Pose::at(position.into()),
        _ => Pose { position: position.into(), orientation: unit_quaternion(orientation) },
    }
}
