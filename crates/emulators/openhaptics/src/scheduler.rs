//! The library's thread: each tick calls what is scheduled, what matters most first.

use std::cell::Cell;
use std::ffi::{c_ulong, c_ushort, c_void};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use palpate_emulators::conformance::Disturbance;

use crate::numbers::error;
use crate::world::world;

pub type Callback = unsafe extern "system" fn(*mut c_void) -> u32;

/// What a callback returns that is not to be called again.
const DONE: u32 = 0;

/// How long a tick waits for a device that answers slowly.
const SLOW: Duration = Duration::from_millis(250);

/// A callback, its data as the number of its address.
#[derive(Clone, Copy)]
struct Scheduled {
    handle: c_ulong,
    callback: Callback,
    data: usize,
    priority: c_ushort,
}

struct Schedule {
    scheduled: Vec<Scheduled>,
    next: c_ulong,
    thread: Option<JoinHandle<()>>,
    rate: u32,
    tick_began: Option<Instant>,
}

static SCHEDULE: Mutex<Schedule> =
    Mutex::new(Schedule { scheduled: Vec::new(), next: 1, thread: None, rate: 1000, tick_began: None });
static RUNNING: AtomicBool = AtomicBool::new(false);
static HURRIED: AtomicBool = AtomicBool::new(false);
static REFUSES: AtomicBool = AtomicBool::new(false);
static TICKS: AtomicU64 = AtomicU64::new(0);

thread_local! {
    static IS_SERVO: Cell<bool> = const { Cell::new(false) };
}

fn schedule() -> MutexGuard<'static, Schedule> {
    SCHEDULE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Whether this is the library's thread.
pub fn is_servo() -> bool {
    IS_SERVO.get()
}

pub fn is_running() -> bool {
    RUNNING.load(Ordering::Acquire)
}

/// Number of the tick, while the scheduler runs.
pub fn tick() -> Option<u64> {
    is_running().then(|| TICKS.load(Ordering::Acquire))
}

/// Time between two ticks, s.
pub fn period() -> f64 {
    1.0 / f64::from(schedule().rate)
}

pub fn rate() -> u32 {
    schedule().rate
}

/// Without pauses between ticks.
pub fn hurry(on: bool) {
    HURRIED.store(on, Ordering::Release);
}

pub fn set_rate(hertz: c_ulong) -> bool {
    let known = [500, 1000, 2000].into_iter().find(|rate| c_ulong::from(*rate) == hertz);
    if let Some(rate) = known {
        schedule().rate = rate;
    }
    known.is_some()
}

/// s, since the tick began.
pub fn since_tick() -> f64 {
    schedule().tick_began.map_or(0.0, |began| began.elapsed().as_secs_f64())
}

pub fn add(callback: Callback, data: *mut c_void, priority: c_ushort) -> c_ulong {
    let mut schedule = schedule();
    let handle = schedule.next;
    schedule.next += 1;
    schedule.scheduled.push(Scheduled { handle, callback, data: data as usize, priority });
    schedule.scheduled.sort_by_key(|one| std::cmp::Reverse(one.priority));
    handle
}

pub fn is_scheduled(handle: c_ulong) -> bool {
    schedule().scheduled.iter().any(|one| one.handle == handle)
}

/// Whether it was scheduled. When it returns, it is not being called, unless it asks so itself.
pub fn remove(handle: c_ulong) -> bool {
    let before = {
        let mut schedule = schedule();
        let before = schedule.scheduled.len();
        schedule.scheduled.retain(|one| one.handle != handle);
        before != schedule.scheduled.len()
    };
    let now = TICKS.load(Ordering::Acquire);
    while is_running() && !is_servo() && TICKS.load(Ordering::Acquire) == now {
        std::thread::yield_now();
    }
    before
}

/// Whether it does not start from now on.
pub fn refuse_to_start(refuses: bool) {
    REFUSES.store(refuses, Ordering::Release);
}

pub fn start() {
    if REFUSES.load(Ordering::Acquire) {
        return world().raise(error::TIMER, crate::numbers::INVALID_HANDLE);
    }
    let mut schedule = schedule();
    if RUNNING.swap(true, Ordering::AcqRel) {
        return;
    }
    match std::thread::Builder::new().name("emulated HD".to_owned()).spawn(run) {
        Ok(thread) => schedule.thread = Some(thread),
        Err(_) => {
            RUNNING.store(false, Ordering::Release);
            drop(schedule);
            world().raise(error::TIMER, crate::numbers::INVALID_HANDLE);
        }
    }
}

/// When it returns, no callback runs, unless one of them has called it. The motors keep their force until the amplifiers drop
/// out.
pub fn stop() {
    RUNNING.store(false, Ordering::Release);
    if is_servo() {
        return;
    }
    let thread = schedule().thread.take();
    if let Some(thread) = thread {
        let _ = thread.join();
    }
}

fn run() {
    IS_SERVO.set(true);
    let mut last = Instant::now();
    let mut deadline = last;
    while is_running() {
        let period = Duration::from_secs_f64(period());
        let hurried = HURRIED.load(Ordering::Acquire);
        if !hurried {
            deadline = (deadline + period).max(Instant::now());
            std::thread::sleep(deadline - Instant::now().min(deadline));
        }
        let slow = world().devices.iter().any(|device| device.disturbance == Some(Disturbance::SlowReplies));
        if slow {
            std::thread::sleep(SLOW);
        }
        let now = Instant::now();
        let elapsed = if hurried { period } else { now - last };
        last = now;
        TICKS.fetch_add(1, Ordering::AcqRel);
        world().devices.iter_mut().for_each(|device| device.advance(elapsed.as_secs_f64()));
        let scheduled = {
            let mut schedule = schedule();
            schedule.tick_began = Some(now);
            schedule.scheduled.clone()
        };
        for one in scheduled {
            // SAFETY: who scheduled it has promised that it may be called with its data until it is unscheduled.
            if unsafe { (one.callback)(one.data as *mut c_void) } == DONE {
                schedule().scheduled.retain(|other| other.handle != one.handle);
            }
        }
    }
}
