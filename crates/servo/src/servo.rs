//! The loop's own thread and its wait-free ends.
//!
//! The latest state goes out and the latest settings come in through triple buffers; every tick goes into a bounded ring,
//! and is dropped and counted where nobody drains it. Nothing that another thread does can make the loop wait.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use glam::DVec3;
use palpate_core::simulation::{Energy, Input, MAX_TOOLS, Model, Snapshot, Strike};
use palpate_devices::{Device, DeviceState};
use rtrb::{Consumer, Producer, RingBuffer};
use triple_buffer::triple_buffer;

use crate::RATE;
use crate::clock::{lock_memory, next_deadline, now_ns, request_realtime_priority, sleep_until_ns};
use crate::safety::{Fault, SafetyLimits};
use crate::statistics::{Histogram, Summary};
use crate::ticker::Ticker;

/// Rows of the log kept for a reader: 20 seconds.
const LOG_ROWS: usize = 20_000;
/// Ticks between two summaries of the statistics.
const SUMMARY_TICKS: u64 = 64;
/// Period of the loop, ns.
const PERIOD_NS: u64 = (1e9 / RATE) as u64;

/// What the frame side may change while the loop runs.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Contact radius of contacts that begin from now on, m.
    pub contact_radius: f64,
    /// Young's modulus over that of the Green's function.
    pub stiffness_scale: f64,
    /// Each new value lets go of everything and clears a fault.
    pub resets: u32,
    /// Seconds that a body in motion advances in a second: below one is slow motion.
    pub time_scale: f64,
    /// A blow for a body in motion.
    pub strike: Strike,
    /// Each new value gives the blow once.
    pub strikes: u32,
    /// Surface node (rank) whose displacement is logged.
    pub watch: u32,
}

/// What the operating system granted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RealtimeStatus {
    /// Real-time scheduling.
    pub priority: bool,
    /// Locked memory.
    pub locked_memory: bool,
}

/// The latest tick, for drawing.
#[derive(Clone)]
pub struct Published {
    /// What happened.
    pub status: Status,
    /// What is drawn.
    pub state: Snapshot,
}

/// Numbers of the latest tick.
#[derive(Clone, Copy, Default)]
pub struct Status {
    /// Time since the start, s.
    pub time: f64,
    /// Ticks since the start.
    pub ticks: u64,
    /// Deadlines that passed while a tick was late.
    pub missed_deadlines: u64,
    /// Log rows lost because nobody drained them.
    pub dropped_rows: u64,
    /// Forces on the devices, N.
    pub forces: [DVec3; MAX_TOOLS],
    /// What the devices said.
    pub devices: [DeviceState; MAX_TOOLS],
    /// Time a tick computes, us.
    pub compute: Summary,
    /// Delay between deadline and waking up, us.
    pub wakeup: Summary,
    /// Latched fault.
    pub fault: Option<Fault>,
    /// Whether a tick panicked; the loop has then stopped, forces at zero.
    pub crashed: bool,
    /// What the operating system granted.
    pub realtime: RealtimeStatus,
}

/// One tick of the first tool.
#[derive(Clone, Copy, Debug, Default)]
pub struct LogRow {
    /// Time since the start, s.
    pub time: f64,
    /// Tip position, m.
    pub position: DVec3,
    /// Force on the device, N.
    pub force: DVec3,
    /// Computing time, us.
    pub compute_us: f64,
    /// Delay between deadline and waking up, us.
    pub wakeup_us: f64,
    /// Displacement of the watched node, m.
    pub watched: DVec3,
    /// Time that a body in motion has gone through, s.
    pub body_time: f64,
    /// Its energies.
    pub energy: Energy,
}

/// A running loop.
pub struct Servo {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    settings: triple_buffer::Input<Settings>,
    published: triple_buffer::Output<Published>,
    log: Consumer<LogRow>,
}

impl Servo {
    /// Starts the loop with one device a tool, at most [`MAX_TOOLS`].
    ///
    /// # Errors
    /// The operating system's, if it gives no thread.
    pub fn start(
        model: Arc<Model>,
        devices: Vec<Box<dyn Device>>,
        limits: SafetyLimits,
        settings: Settings,
    ) -> std::io::Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        let (settings_in, settings_out) = triple_buffer(&settings);
        let (published_in, published_out) =
            triple_buffer(&Published { status: Status::default(), state: Snapshot::new(&model) });
        let (rows, log) = RingBuffer::new(LOG_ROWS);
        let mut servo_loop = Loop {
            stop: stop.clone(),
            ticker: Ticker::new(model.clone(), limits),
            devices,
            settings: settings_out,
            resets: settings.resets,
            strikes: settings.strikes,
            watch: settings.watch,
            published: published_in,
            status: Status::default(),
            rows,
            compute: Histogram::default(),
            wakeup: Histogram::default(),
        };
        // Locking the memory of a large process takes a tenth of a second: wait, so that the first target set after the
        // start is seen by a running loop.
        let (ready_in, ready_out) = std::sync::mpsc::sync_channel(1);
        let thread = std::thread::Builder::new().name("palpate-servo".into()).spawn(move || {
            servo_loop.status.realtime =
                RealtimeStatus { priority: request_realtime_priority(), locked_memory: lock_memory() };
            let _ = ready_in.send(());
            servo_loop.run();
        })?;
        let _ = ready_out.recv();
        Ok(Self { stop, thread: Some(thread), settings: settings_in, published: published_out, log })
    }

    /// Changes the settings; wait-free.
    pub fn set(&mut self, settings: Settings) {
        self.settings.write(settings);
    }

    /// The latest tick; wait-free.
    pub fn latest(&mut self) -> &Published {
        self.published.read()
    }

    /// Hands out the rows of the log since the last call.
    pub fn drain_log(&mut self, mut each: impl FnMut(LogRow)) {
        while let Ok(row) = self.log.pop() {
            each(row);
        }
    }

    /// Stops the loop; the devices are left at zero force.
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

/// What the thread owns.
struct Loop {
    stop: Arc<AtomicBool>,
    ticker: Ticker,
    devices: Vec<Box<dyn Device>>,
    settings: triple_buffer::Output<Settings>,
    resets: u32,
    strikes: u32,
    watch: u32,
    published: triple_buffer::Input<Published>,
    status: Status,
    rows: Producer<LogRow>,
    compute: Histogram,
    wakeup: Histogram,
}

impl Loop {
    /// Ticks until stopped. A panic would be a fault of ours: it ends the loop with the forces at zero.
    fn run(&mut self) {
        let outcome = catch_unwind(AssertUnwindSafe(|| self.ticks()));
        self.devices.iter_mut().for_each(|device| device.write(DVec3::ZERO));
        self.status.crashed = outcome.is_err();
        self.status.forces = Default::default();
        self.published.input_buffer_mut().status = self.status;
        self.ticker.snapshot_into(&mut self.published.input_buffer_mut().state);
        self.published.publish();
    }

    fn ticks(&mut self) {
        let start = now_ns();
        let mut deadline = start + PERIOD_NS;
        while !self.stop.load(Ordering::Relaxed) {
            sleep_until_ns(deadline);
            let woken = now_ns();
            self.tick((deadline - start) as f64 * 1e-9);
            let finished = now_ns();
            self.account(woken - deadline, finished - woken);
            let (next, missed) = next_deadline(deadline, now_ns(), PERIOD_NS);
            deadline = next;
            self.status.missed_deadlines += missed;
        }
    }

    /// Reads the devices, computes, makes safe, writes the devices.
    fn tick(&mut self, time: f64) {
        let settings = *self.settings.read();
        let input = Input {
            contact_radius: settings.contact_radius,
            stiffness_scale: settings.stiffness_scale,
            reset: settings.resets != self.resets,
            advance: settings.time_scale / RATE,
            strike: (settings.strikes != self.strikes).then_some(settings.strike),
            ..Input::default()
        };
        (self.resets, self.strikes, self.watch) = (settings.resets, settings.strikes, settings.watch);
        for (state, device) in self.status.devices.iter_mut().zip(&mut self.devices) {
            *state = device.read(1.0 / RATE);
        }
        let output = self.ticker.tick(&self.status.devices, &input, 1.0 / RATE);
        for (device, &force) in self.devices.iter_mut().zip(&output.forces) {
            device.write(force);
        }
        (self.status.time, self.status.forces, self.status.fault) = (time, output.forces, output.fault);
    }

    /// Statistics, hand-off and log, after the force is out.
    fn account(&mut self, wakeup_ns: u64, compute_ns: u64) {
        self.wakeup.record(wakeup_ns);
        self.compute.record(compute_ns);
        self.status.ticks += 1;
        if self.status.ticks % SUMMARY_TICKS == 1 {
            (self.status.wakeup, self.status.compute) = (self.wakeup.summary(), self.compute.summary());
        }
        let published = self.published.input_buffer_mut();
        self.ticker.snapshot_into(&mut published.state);
        let drawn = &published.state;
        let row = LogRow {
            time: self.status.time,
            position: self.status.devices[0].position,
            force: self.status.forces[0],
            compute_us: compute_ns as f64 * 1e-3,
            wakeup_us: wakeup_ns as f64 * 1e-3,
            watched: self.ticker.displacement_of(self.watch as usize),
            body_time: drawn.body_time,
            energy: drawn.energy.unwrap_or_default(),
        };
        self.status.dropped_rows += u64::from(self.rows.push(row).is_err());
        published.status = self.status;
        self.published.publish();
    }
}
