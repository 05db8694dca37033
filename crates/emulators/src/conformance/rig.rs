//! Test rig that takes the place of the force loop: it ticks an open device on the thread that its driver requires.

use std::ops::ControlFlow;
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use palpate_devices::{Device, DeviceLimits, OpenError, Reading, ReadyDevice, Scheduler, Wrench};

use super::spring::Spring;
use super::{Bench, Facts};

/// Time between two ticks.
pub const PERIOD: Duration = Duration::from_millis(1);

/// How long the suite waits for a driver's scheduler that should be ticking.
const TIMEOUT: Duration = Duration::from_secs(20);

/// What a job does at each tick: with the bench, the device and the time, ns.
type Job<B> = Box<dyn FnMut(&mut B, &mut dyn Device, u64) -> ControlFlow<()> + Send>;

/// What the ticks are made of. It is locked for the length of a tick: a suite may, a force loop must not.
struct RigState<B> {
    bench: B,
    device: Box<dyn Device>,
    job: Option<Job<B>>,
    /// Ticks without pause between them.
    fast: bool,
    began: Instant,
}

impl<B> RigState<B> {
    /// One tick of the job; between jobs a loop with nothing to render.
    fn tick(&mut self) {
        let now_ns = self.began.elapsed().as_nanos() as u64;
        let Some(job) = &mut self.job else {
            let _ = self.device.read(now_ns, PERIOD.as_secs_f64());
            let _ = self.device.write(Wrench::default());
            return;
        };
        if job(&mut self.bench, &mut *self.device, now_ns).is_break() {
            self.job = None;
        }
    }
}

fn locked<B>(state: &Mutex<RigState<B>>) -> std::sync::MutexGuard<'_, RigState<B>> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What was seen at the end of a tick.
pub struct Observation {
    pub reading: Reading,
    pub written: Wrench,
    pub motors: Wrench,
}

/// A bench with its driver open.
pub struct Rig<B: Bench> {
    pub facts: Facts,
    pub limits: DeviceLimits,
    state: Arc<Mutex<RigState<B>>>,
    scheduler: Option<Arc<dyn Scheduler>>,
}

impl<B: Bench> Rig<B> {
    pub fn open(mut bench: B) -> Result<Self, (B, OpenError)> {
        let facts = bench.facts();
        let ReadyDevice { device, scheduler } = match bench.open() {
            Ok(opened) => opened,
            Err(error) => return Err((bench, error)),
        };
        let limits = device.limits();
        let state = Arc::new(Mutex::new(RigState { bench, device, job: None, fast: false, began: Instant::now() }));
        if let Some(scheduler) = &scheduler {
            let ticked = Arc::clone(&state);
            if let Err(error) = scheduler.start(Box::new(move || locked(&ticked).tick())) {
                return Err((taken(state).bench, error));
            }
        }
        Ok(Self { facts, limits, state, scheduler })
    }

    /// Calls `job` at each tick until it breaks with a result, `most` ticks at most.
    pub fn each_tick<R: Send + 'static>(
        &mut self,
        most: usize,
        mut job: impl FnMut(&mut B, &mut dyn Device, u64) -> ControlFlow<Result<R, String>> + Send + 'static,
    ) -> Result<R, String> {
        let (sender, results) = channel();
        let mut ticks = 0;
        locked(&self.state).job = Some(Box::new(move |bench, device, now_ns| {
            ticks += 1;
            match job(bench, device, now_ns) {
                ControlFlow::Break(result) => {
                    let _ = sender.send(result);
                    ControlFlow::Break(())
                }
                ControlFlow::Continue(()) if ticks >= most => {
                    let _ = sender.send(Err(format!("no result after {most} ticks")));
                    ControlFlow::Break(())
                }
                ControlFlow::Continue(()) => ControlFlow::Continue(()),
            }
        }));
        match self.scheduler {
            Some(_) => self.wait(&results, most),
            None => self.tick_here(&results),
        }
    }

    /// Calls `job` at each of some ticks and once more: the last result.
    pub fn after<R: Send + 'static>(
        &mut self,
        mut ticks: usize,
        mut job: impl FnMut(&mut B, &mut dyn Device, u64) -> Result<R, String> + Send + 'static,
    ) -> Result<R, String> {
        self.each_tick(ticks + 1, move |bench, device, now_ns| {
            let result = job(bench, device, now_ns);
            if ticks == 0 {
                return ControlFlow::Break(result);
            }
            ticks -= 1;
            ControlFlow::Continue(())
        })
    }

    /// The driver's thread ticks.
    fn wait<R>(&self, results: &Receiver<Result<R, String>>, most: usize) -> Result<R, String> {
        let in_time = results.recv_timeout(TIMEOUT + 2 * PERIOD * most as u32);
        in_time.unwrap_or_else(|_| Err("the driver's scheduler does not tick".to_owned()))
    }

    /// This thread ticks. A deadline that is missed is not made up for: the ticks that follow would be too close.
    fn tick_here<R>(&self, results: &Receiver<Result<R, String>>) -> Result<R, String> {
        let mut deadline = Instant::now();
        loop {
            let fast = {
                let mut state = locked(&self.state);
                state.tick();
                state.fast
            };
            if let Ok(result) = results.try_recv() {
                return result;
            }
            let now = Instant::now();
            deadline = (deadline + PERIOD).max(now);
            if !fast {
                std::thread::sleep(deadline - now);
            }
        }
    }

    /// Does something to the device, and lets the spring answer until reading and motors must show it.
    pub fn settle(
        &mut self,
        mut spring: Spring,
        act: impl FnOnce(&mut B) + Send + 'static,
    ) -> Result<Observation, String> {
        let mut act = Some(act);
        self.after(2 * self.facts.late_ticks, move |bench, device, now_ns| {
            if let Some(act) = act.take() {
                act(bench);
            }
            let (reading, written) = spring.tick(device, now_ns);
            match (reading, spring.fault) {
                (Ok(reading), None) => Ok(Observation { reading, written, motors: bench.motors() }),
                (Err(fault), _) | (_, Some(fault)) => Err(format!("a fault of a device that is well: {fault}")),
            }
        })
    }

    /// Ticks as fast as possible, where the device allows it.
    pub fn run_fast(&mut self, as_fast_as_possible: bool) {
        let mut state = locked(&self.state);
        state.fast = as_fast_as_possible && self.facts.can_run_fast;
        let fast = state.fast;
        state.bench.run_fast(fast);
    }

    /// Name by which a person knows the device.
    pub fn name(&self) -> String {
        locked(&self.state).device.name().to_owned()
    }

    /// Stops the ticks and closes the driver.
    pub fn close(self) -> B {
        if let Some(scheduler) = &self.scheduler {
            scheduler.stop();
        }
        taken(self.state).bench
    }
}

/// What a stopped scheduler has given back. The job goes with it, for it may hold what a driver waits for.
fn taken<B>(mut state: Arc<Mutex<RigState<B>>>) -> RigState<B> {
    let began = Instant::now();
    loop {
        match Arc::try_unwrap(state) {
            Ok(alone) => return alone.into_inner().unwrap_or_else(PoisonError::into_inner),
            Err(shared) if began.elapsed() < TIMEOUT => state = shared,
            Err(_) => panic!("the driver's scheduler has been stopped and still holds its tick"),
        }
        std::thread::sleep(PERIOD);
    }
}
