//! The loop's own thread.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;
use std::time::Duration;

use palpate_core::simulation::{KnownSeries, Model, PreviousRanks};
use palpate_core::{Error, Result};
use palpate_devices::{Device, DeviceFault, DeviceLimits, Reading, Scheduler, Wrench};

use crate::caller::{Caller, Worker, tick_until};
use crate::change::ChangeHandle;
use crate::force_loop::{ForceLoop, Successor};
use crate::handoff::LoopHandle;
use crate::log::RealtimeStatus;
use crate::platform::lock;
use crate::preparer::{StrainPreparer, StrainWorker};
use crate::safety::SafetyLimits;
use crate::scheduling::Scheduling;
use crate::series::memory_of;
use crate::settings::Settings;

/// Interval between two polls, and most polls: for the end of a recording, and for room for another change.
const POLL_INTERVAL: Duration = Duration::from_millis(1);
const MAX_POLLS: u32 = 1000;
const MAX_ROOM_POLLS: u32 = 100;

/// A running loop.
pub struct Servo {
    caller: Caller,
    handle: LoopHandle,
    changes: Option<ChangeHandle<Successor>>,
    realtime: RealtimeStatus,
    limits: SafetyLimits,
    /// Time between two ticks, s.
    period: f64,
    /// What each tool's device can render.
    devices: Vec<DeviceLimits>,
    /// Prepares strain responses while the loop runs.
    worker: StrainWorker,
}

impl Servo {
    /// Starts the loop with one device a tool, and beside it a thread that prepares the strain of contacts. Where some device
    /// has a `scheduler`, its driver calls the tick at its own rate; else a thread does, scheduled as told.
    ///
    /// # Errors
    /// See [`ForceLoop::new`] and [`Scheduling::check`]; a rate beyond what a device takes; no thread from the operating
    /// system; a driver that does not start. A priority that the system refuses is none: see [`Servo::realtime`].
    pub fn start(
        model: Arc<Model>,
        devices: Vec<Box<dyn Device>>,
        limits: SafetyLimits,
        settings: Settings,
        scheduling: Scheduling,
        strain: StrainPreparer,
        scheduler: Option<Arc<dyn Scheduler>>,
    ) -> Result<Self> {
        scheduling.check()?;
        let device_limits = devices.iter().map(|device| device.limits()).collect();
        let (mut force_loop, mut handle) = ForceLoop::new(model, devices, limits, settings)?;
        let worker = force_loop.limit_strain(&mut handle, strain)?;
        let period = 1.0 / scheduler.as_ref().map_or(scheduling.rate, |scheduler| scheduler.rate());
        force_loop.check_period(period)?;
        let changes = force_loop.take_change_handle();
        let (caller, realtime) = match scheduler {
            Some(driver) => {
                let tick = move |now_ns| force_loop.tick(now_ns, period);
                (Caller::driver(driver, tick)?, RealtimeStatus::default())
            }
            None => start_thread(force_loop, period, scheduling)?,
        };
        Ok(Self { caller, handle, changes, realtime, limits, period, devices: device_limits, worker })
    }

    /// Exchanges bodies, tools and devices while the loop runs; contacts between those that stay go on.
    ///
    /// # Errors
    /// See [`ForceLoop::new`]; a rate beyond what a new device takes; a tool without a device; a loop that is being recorded, or
    /// does not tick. The loop then goes on as it was.
    pub fn change(&mut self, change: SceneChange) -> Result<()> {
        let SceneChange { model, previous_ranks, devices, settings, strain } = change;
        if self.handle.is_recorded() {
            return Err(Error::Invalid(
                "the scene cannot be changed while it is recorded: stop the recording first".into(),
            ));
        }
        let keeps_device = devices.iter().map(Option::is_none).collect();
        let mut placed: Vec<Box<dyn Device>> = Vec::new();
        for (tool, device) in devices.into_iter().enumerate() {
            let placeholder =
                || previous_ranks.tools.get(tool).copied().flatten().and_then(|old| self.devices.get(old));
            let missing = || Error::Invalid(format!("tool {tool} is new, and has no device"));
            placed.push(match device {
                Some(device) => device,
                None => Box::new(PlaceholderDevice(*placeholder().ok_or_else(missing)?)),
            });
        }
        let limits = placed.iter().map(|device| device.limits()).collect();
        let (mut next, mut next_handle) = ForceLoop::new(model, placed, self.limits, settings)?;
        next.check_period(self.period)?;
        if self.realtime.locked_memory {
            // Where the limit of the process is reached, the loop still goes on.
            lock(next.memory());
        }
        let worker = next.limit_strain(&mut next_handle, strain)?;
        let silent = || Error::Invalid("the loop does not tick: the scene stays as it was".into());
        let changes = self.changes.as_mut().ok_or_else(silent)?;
        if !changes.offer(Successor { force_loop: next, previous_ranks, keeps_device }) {
            return Err(silent());
        }
        self.handle.switch_to(next_handle);
        (self.devices, self.worker) = (limits, worker);
        Ok(())
    }

    /// What the operating system granted the loop's thread.
    pub fn realtime(&self) -> RealtimeStatus {
        self.realtime
    }

    /// Changes the settings. Waits for a tick where very many changes wait already.
    ///
    /// # Errors
    /// See [`LoopHandle::set`]; the loop then keeps those it has.
    pub fn set(&mut self, settings: Settings) -> Result<()> {
        self.wait_for_room();
        self.handle.set(settings)
    }

    /// See [`LoopHandle::offer_series`]; their memory is locked as the loop's is.
    pub fn offer_series(&mut self, body: usize, series: Arc<KnownSeries>) -> bool {
        if self.realtime.locked_memory {
            lock(memory_of(&series));
        }
        self.handle.offer_series(body, series)
    }

    /// See [`LoopHandle::reset`].
    ///
    /// # Errors
    /// So many changes that the loop cannot be ticking.
    pub fn reset(&mut self) -> Result<()> {
        self.wait_for_room();
        self.handle.reset()
    }

    /// A loop that ticks makes room within one.
    fn wait_for_room(&self) {
        wait_while(MAX_ROOM_POLLS, || self.handle.is_full());
    }

    /// Ends the recording and waits until the loop has taken note of it: how many ticks it made meanwhile.
    pub fn end_recording(&mut self) -> u64 {
        self.handle.end_recording();
        wait_while(MAX_POLLS, || self.handle.latest().status.recording.records);
        self.handle.latest().status.recording.ticks
    }

    /// Stops the loop; the devices are left without a wrench.
    pub fn stop(&mut self) {
        self.caller.stop();
    }
}

/// Waits while something holds, for so many polls at most.
fn wait_while(polls: u32, mut holds: impl FnMut() -> bool) {
    for _ in 0..polls {
        if !holds() {
            break;
        }
        std::thread::sleep(POLL_INTERVAL);
    }
}

/// Changes are sent to it, and ticks are read there.
impl Deref for Servo {
    type Target = LoopHandle;

    fn deref(&self) -> &LoopHandle {
        &self.handle
    }
}

impl DerefMut for Servo {
    fn deref_mut(&mut self) -> &mut LoopHandle {
        &mut self.handle
    }
}

impl Drop for Servo {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Another scene for a running loop.
pub struct SceneChange {
    /// Its bodies and tools.
    pub model: Arc<Model>,
    /// Which of them were there before.
    pub previous_ranks: PreviousRanks,
    /// One a tool: a new device, or none for a tool that keeps the one it has.
    pub devices: Vec<Option<Box<dyn Device>>>,
    /// From now on.
    pub settings: Settings,
    /// What measures the strain of the bodies.
    pub strain: StrainPreparer,
}

/// Placeholder for a device that the new loop takes over from the previous one.
struct PlaceholderDevice(DeviceLimits);

impl Device for PlaceholderDevice {
    fn name(&self) -> &str {
        "no device yet"
    }

    fn read(&mut self, _now_ns: u64, _period: f64) -> std::result::Result<Reading, DeviceFault> {
        Err(DeviceFault::Disconnected)
    }

    fn write(&mut self, _wrench: Wrench) -> std::result::Result<(), DeviceFault> {
        Ok(())
    }

    fn limits(&self) -> DeviceLimits {
        self.0
    }
}

/// Has a thread of its own call the tick.
fn start_thread(mut force_loop: ForceLoop, period: f64, scheduling: Scheduling) -> Result<(Caller, RealtimeStatus)> {
    // Locking the memory of a large body takes a tenth of a second: wait, so that the first target set after the
    // start is seen by a running loop.
    let (ready_in, ready_out) = std::sync::mpsc::sync_channel(1);
    let worker = Worker::start("palpate-servo", move |stop| {
        let granted = scheduling.apply(force_loop.memory());
        let realtime = granted.as_ref().copied().unwrap_or_default();
        force_loop.set_realtime(realtime);
        let refused = granted.is_err();
        let _ = ready_in.send(granted);
        if !refused {
            tick_until(stop, period, |deadline| force_loop.tick(deadline, period));
        }
    })?;
    let ended = || Error::Invalid("the loop's thread ended before its first tick".into());
    let realtime = ready_out.recv().map_err(|_| ended())??;
    Ok((Caller::Thread(worker), realtime))
}
