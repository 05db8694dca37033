//! A gentle check of one device by itself: its readings, and whether it pushes in the commanded direction.
//!
//! A tick reads the device and writes it as a force loop does, through the same safety stage; what is computed in between is
//! no body but a task: to watch, or to push along a direction with a force that rises evenly and then ends. A tip that runs away,
//! for nobody holds it, ends the push too.

use glam::DVec3;
use palpate_core::Result;
use palpate_devices::{Device, DeviceLimits, Reading, ReadyDevice, Wrench};
use triple_buffer::{Input, Output, triple_buffer};

use crate::caller::{Caller, Worker, tick_until};
use crate::safety::{FaultReason, SafetyLimits, SafetyStage};
use crate::settings::refuse_unless;

/// Largest force that a check may ask for, N: a sixth of the weakest device's.
pub const LARGEST_FORCE: f64 = 0.5;

/// A push ends where the tip has gone this far, m: a hand that holds it loosely yields less.
const MAX_TRAVEL: f64 = 0.05;

/// Time between two ticks of a thread of ours, s.
const PERIOD: f64 = 1e-3;

/// What to do, from the next tick on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Task {
    /// Direction of the force on the hand, a unit vector; zero to watch only.
    pub direction: DVec3,
    /// Force at the end, N.
    pub force: f64,
    /// Time over which it rises, s.
    pub seconds: f64,
}

/// What has been seen since a task began.
#[derive(Clone, Copy, Debug, Default)]
pub struct Observation {
    /// Number of the task.
    pub task: u64,
    /// Time since then, s.
    pub time: f64,
    /// Readings of a tool in the scene.
    pub readings: u64,
    /// Those that the device measured anew, and the longest time between two, s.
    pub fresh: u64,
    /// The longest time between two of them, by ticks, s.
    pub longest_gap: f64,
    /// Mean of the position, m, and its standard deviation by axis.
    pub mean: DVec3,
    /// Standard deviation of the position by axis, m.
    pub deviation: DVec3,
    /// Lowest and highest position by axis, m.
    pub lowest: DVec3,
    /// Highest position by axis, m.
    pub highest: DVec3,
    /// Where the tip was first and last, m.
    pub first: DVec3,
    /// Where it was last, m.
    pub last: DVec3,
    /// Buttons that were held at any time.
    pub buttons: u32,
    /// Largest force put out, N.
    pub largest_force: f64,
    /// Whether a push has come to its end.
    pub done: bool,
    /// Whether the tip ran away from it.
    pub ran_away: bool,
    /// Why there is no force.
    pub fault: Option<FaultReason>,
}

/// A device under check, ticked by a thread of its own or by its driver.
pub struct SelfCheck {
    name: String,
    limits: DeviceLimits,
    tasks: Input<(u64, Task)>,
    seen: Output<Observation>,
    number: u64,
    caller: Caller,
}

impl SelfCheck {
    /// Begins to watch.
    ///
    /// # Errors
    /// A driver that does not start; no thread from the operating system.
    pub fn start(opened: ReadyDevice) -> Result<Self> {
        let ReadyDevice { device, scheduler } = opened;
        let (tasks, asked) = triple_buffer(&(0, Task::default()));
        let (published, seen) = triple_buffer(&Observation::default());
        let (name, limits) = (device.name().to_owned(), device.limits());
        let mut ticker = Ticker::new(device, asked, published);
        let caller = match scheduler {
            Some(driver) => {
                let period = 1.0 / driver.rate();
                Caller::driver(driver, move |now_ns| ticker.tick(now_ns, period))?
            }
            None => Caller::Thread(Worker::start("palpate-check", move |stop| {
                tick_until(stop, PERIOD, |deadline| ticker.tick(deadline, PERIOD));
            })?),
        };
        Ok(Self { name, limits, tasks, seen, number: 0, caller })
    }

    /// What a person knows the device by.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What it can render.
    pub fn limits(&self) -> DeviceLimits {
        self.limits
    }

    /// Begins another task in place of the present one.
    ///
    /// # Errors
    /// A direction that is neither a unit vector nor zero, a force above [`LARGEST_FORCE`], a rise that takes no time.
    pub fn begin(&mut self, task: Task) -> Result<()> {
        let length = task.direction.length();
        refuse_unless(length == 0.0 || (length - 1.0).abs() < 1e-9, || {
            format!("a push needs a unit vector, got one of length {length}")
        })?;
        refuse_unless((0.0..=LARGEST_FORCE).contains(&task.force), || {
            format!("a check pushes with 0 to {LARGEST_FORCE} N, got {}", task.force)
        })?;
        refuse_unless(task.seconds > 0.0 || length == 0.0, || {
            format!("a push must take its time, got {} s", task.seconds)
        })?;
        self.number += 1;
        self.tasks.write((self.number, task));
        Ok(())
    }

    /// What has been seen of the task, of a push up to its end; wait-free. None until its first tick.
    pub fn observation(&mut self) -> Option<Observation> {
        Some(*self.seen.read()).filter(|seen| seen.task == self.number && seen.time > 0.0)
    }

    /// Ends the check; the device is left without a force.
    pub fn stop(&mut self) {
        self.caller.stop();
    }
}

impl Drop for SelfCheck {
    fn drop(&mut self) {
        self.stop();
    }
}

/// What ticks.
struct Ticker {
    device: Box<dyn Device>,
    stage: SafetyStage,
    tasks: Output<(u64, Task)>,
    published: Input<Observation>,
    task: Task,
    /// Time of its first tick, ns.
    begun_ns: u64,
    seen: Observation,
    /// Sum of squares about the mean, by axis, m^2.
    squares: DVec3,
    /// Time stamp of the latest measurement, and the time since, s.
    latest: Option<(u64, f64)>,
}

impl Ticker {
    fn new(device: Box<dyn Device>, tasks: Output<(u64, Task)>, published: Input<Observation>) -> Self {
        let device_limits = device.limits();
        let defaults = SafetyLimits::default();
        let limits = SafetyLimits {
            max_force: LARGEST_FORCE.min(device_limits.max_force),
            max_torque: f64::MIN_POSITIVE,
            max_damping: defaults.max_damping.min(device_limits.max_damping),
            max_angular_damping: 0.0,
            max_speed: device_limits.max_speed.unwrap_or(f64::INFINITY),
            // The rise of a push is slower by far: the stage withholds nothing of it.
            ..defaults
        };
        Self {
            device,
            stage: SafetyStage::new(limits, false),
            tasks,
            published,
            task: Task::default(),
            begun_ns: 0,
            seen: Observation::default(),
            squares: DVec3::ZERO,
            latest: None,
        }
    }

    /// Never allocates, locks or blocks.
    fn tick(&mut self, now_ns: u64, period: f64) {
        let (number, task) = *self.tasks.read();
        if number != self.seen.task {
            (self.task, self.squares, self.begun_ns) = (task, DVec3::ZERO, now_ns);
            self.seen = Observation { task: number, fault: self.seen.fault, ..Observation::default() };
        }
        // By the clock: ticks that were missed count too.
        self.seen.time = 1e-9 * now_ns.saturating_sub(self.begun_ns) as f64 + period;
        let result = self.device.read(now_ns, period);
        let reading = self
            .stage
            .accept_reading(result, now_ns, period)
            .filter(|reading| reading.active && reading.pose.is_finite());
        // What is told of a push is up to its end.
        if let Some(reading) = reading.as_ref().filter(|_| !self.seen.done) {
            self.account(reading, period);
        }
        let asked = self.asked(reading.is_some());
        let wrench = self.stage.apply(asked, 1.0, period);
        self.seen.largest_force = self.seen.largest_force.max(wrench.force.length());
        if let Err(fault) = self.device.write(wrench) {
            self.stage.latch(FaultReason::Device(fault));
        }
        self.seen.fault = self.stage.fault();
        self.seen.done |= self.seen.fault.is_some();
        self.published.write(self.seen);
    }

    /// The wrench of the task; none on a tool that is out of the scene.
    fn asked(&mut self, present: bool) -> Wrench {
        let Task { direction, force, seconds } = self.task;
        if direction == DVec3::ZERO {
            return Wrench::default();
        }
        let seen = &mut self.seen;
        seen.ran_away |= seen.first.distance(seen.last) > MAX_TRAVEL;
        seen.done |= seen.time >= seconds || seen.ran_away || !present;
        let now = if seen.done { 0.0 } else { force * seen.time / seconds };
        Wrench { force: now * direction, ..Wrench::default() }
    }

    /// Mean and deviation by Welford's recursion.
    fn account(&mut self, reading: &Reading, period: f64) {
        let (seen, position) = (&mut self.seen, reading.pose.position);
        seen.readings += 1;
        if seen.readings == 1 {
            (seen.first, seen.lowest, seen.highest) = (position, position, position);
        }
        (seen.lowest, seen.highest, seen.last) = (seen.lowest.min(position), seen.highest.max(position), position);
        seen.buttons |= reading.buttons.0;
        let off = position - seen.mean;
        seen.mean += off / seen.readings as f64;
        self.squares += off * (position - seen.mean);
        seen.deviation = (self.squares / seen.readings as f64).map(f64::sqrt);
        let (stamp, since) = self.latest.unwrap_or((0, 0.0));
        if self.latest.is_none() || stamp != reading.timestamp_ns {
            seen.fresh += 1;
            if seen.fresh > 1 {
                seen.longest_gap = seen.longest_gap.max(since + period);
            }
            self.latest = Some((reading.timestamp_ns, 0.0));
        } else {
            self.latest = Some((stamp, since + period));
        }
    }
}

/// The device is left without a wrench.
impl Drop for Ticker {
    fn drop(&mut self) {
        let _ = self.device.write(Wrench::default());
    }
}

#[cfg(test)]
mod tests;
