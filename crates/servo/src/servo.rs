//! The loop's own thread.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use palpate_core::simulation::Model;
use palpate_core::{Error, Result};
use palpate_devices::Device;
use rtrb::Consumer;

use crate::clock::{next_deadline, now_ns, sleep_until_ns};
use crate::force_loop::ForceLoop;
use crate::handoff::{LoopHandle, Published};
use crate::log::{LogRow, RealtimeStatus};
use crate::preparer::{StrainPreparer, StrainWorker};
use crate::record::TickRecord;
use crate::safety::SafetyLimits;
use crate::scheduling::Scheduling;
use crate::settings::Settings;

/// How long, and how often at most, the end of a recording is waited for: a loop that ticks takes note within one.
const WAIT: Duration = Duration::from_millis(1);
const MOST_WAITS: u32 = 1000;

/// A running loop.
pub struct Servo {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    handle: LoopHandle,
    realtime: RealtimeStatus,
    /// Prepares strain responses while the loop runs.
    _worker: StrainWorker,
}

impl Servo {
    /// Starts the loop with one device a tool on a thread scheduled as told, and beside it a thread that prepares the strain
    /// of contacts.
    ///
    /// # Errors
    /// See [`ForceLoop::new`] and [`Scheduling::check`]; a rate beyond what a device takes; no thread from the operating
    /// system. A priority that the system refuses is none: see [`Servo::realtime`].
    pub fn start(
        model: Arc<Model>,
        devices: Vec<Box<dyn Device>>,
        limits: SafetyLimits,
        settings: Settings,
        scheduling: Scheduling,
        strain: StrainPreparer,
    ) -> Result<Self> {
        scheduling.check()?;
        let (mut force_loop, mut handle) = ForceLoop::new(model, devices, limits, settings)?;
        let worker = force_loop.limit_strain(&mut handle, strain)?;
        let period = 1.0 / scheduling.rate;
        force_loop.check_period(period)?;
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = stop.clone();
        // Locking the memory of a large process takes a tenth of a second: wait, so that the first target set after the
        // start is seen by a running loop.
        let (ready_in, ready_out) = std::sync::mpsc::sync_channel(1);
        let ticks = move || {
            let granted = scheduling.apply();
            let realtime = granted.as_ref().copied().unwrap_or_default();
            force_loop.set_realtime(realtime);
            let refused = granted.is_err();
            let _ = ready_in.send(granted);
            if !refused {
                run(&mut force_loop, period, &stopped);
            }
        };
        let thread = std::thread::Builder::new().name("palpate-servo".into()).spawn(ticks);
        let thread = thread.map_err(|source| Error::Io { path: "palpate-servo".into(), source })?;
        let realtime = ready_out.recv().unwrap_or_else(|_| Ok(RealtimeStatus::default()))?;
        Ok(Self { stop, thread: Some(thread), handle, realtime, _worker: worker })
    }

    /// What the operating system granted the loop's thread.
    pub fn realtime(&self) -> RealtimeStatus {
        self.realtime
    }

    /// Changes the settings; wait-free.
    ///
    /// # Errors
    /// See [`Settings::check`]; the loop then keeps those it has.
    pub fn set(&mut self, settings: Settings) -> Result<()> {
        self.handle.set(settings)
    }

    /// The latest tick; wait-free.
    pub fn latest(&mut self) -> &Published {
        self.handle.latest()
    }

    /// Hands out the rows of the log since the last call.
    pub fn drain_log(&mut self, each: impl FnMut(LogRow)) {
        self.handle.drain_log(each);
    }

    /// See [`LoopHandle::begin_recording`].
    ///
    /// # Errors
    /// A loop that is being recorded already.
    pub fn begin_recording(&mut self) -> Result<Consumer<TickRecord>> {
        self.handle.begin_recording()
    }

    /// Ends the recording and waits until the loop has taken note of it: how many ticks it made meanwhile.
    pub fn end_recording(&mut self) -> u64 {
        self.handle.end_recording();
        let mut left = MOST_WAITS;
        while self.handle.latest().status.recording.records && left > 0 {
            std::thread::sleep(WAIT);
            left -= 1;
        }
        self.handle.latest().status.recording.ticks
    }

    /// Stops the loop; the devices are left without a wrench.
    pub fn stop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Drop for Servo {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Ticks on a grid of deadlines until stopped.
fn run(force_loop: &mut ForceLoop, period: f64, stop: &AtomicBool) {
    let period_ns = (1e9 * period).round() as u64;
    let mut deadline = now_ns() + period_ns;
    while !stop.load(Ordering::Relaxed) {
        sleep_until_ns(deadline);
        force_loop.tick(deadline, period);
        // Deadlines that have passed meanwhile are counted by the tick.
        deadline = next_deadline(deadline, now_ns(), period_ns);
    }
}
