//! The library's thread: each tick calls what is scheduled.

use std::cell::Cell;
use std::ffi::{c_ulong, c_void};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use palpate_emulators::conformance::Disturbance;
use palpate_emulators::library::world;

use crate::device::Device;

pub type Callback = unsafe extern "system" fn(*mut c_void) -> u32;

/// Time between two ticks.
pub const PERIOD: Duration = Duration::from_millis(1);

/// How long a tick waits for a device that answers slowly.
const SLOW: Duration = Duration::from_millis(250);

/// A callback, its data as the number of its address.
#[derive(Clone, Copy)]
struct Scheduled {
    handle: c_ulong,
    callback: Callback,
    data: usize,
}

struct Schedule {
    scheduled: Vec<Scheduled>,
    next: c_ulong,
    thread: Option<JoinHandle<()>>,
}

static SCHEDULE: Mutex<Schedule> = Mutex::new(Schedule { scheduled: Vec::new(), next: 1, thread: None });
static RUNNING: AtomicBool = AtomicBool::new(false);
static TICKS: AtomicU64 = AtomicU64::new(0);

thread_local! {
    static IS_SERVO: Cell<bool> = const { Cell::new(false) };
}

fn schedule() -> MutexGuard<'static, Schedule> {
    SCHEDULE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Whether this thread may use devices: the library's, or any while it does not run.
pub fn may_call() -> bool {
    IS_SERVO.get() || !is_running()
}

fn is_running() -> bool {
    RUNNING.load(Ordering::Acquire)
}

/// Number of the tick, while the scheduler runs.
pub fn tick() -> Option<u64> {
    is_running().then(|| TICKS.load(Ordering::Acquire))
}

pub fn add(callback: Callback, data: *mut c_void) -> c_ulong {
    let mut schedule = schedule();
    let handle = schedule.next;
    schedule.next += 1;
    schedule.scheduled.push(Scheduled { handle, callback, data: data as usize });
    handle
}

/// Whether it was scheduled. The caller has stopped the scheduler.
pub fn remove(handle: c_ulong) -> bool {
    let mut schedule = schedule();
    let before = schedule.scheduled.len();
    schedule.scheduled.retain(|one| one.handle != handle);
    before != schedule.scheduled.len()
}

/// Whether it runs.
pub fn start() -> bool {
    if world::<Device>().has(Disturbance::SchedulerFails) {
        return false;
    }
    let mut schedule = schedule();
    if !RUNNING.swap(true, Ordering::AcqRel) {
        schedule.thread = std::thread::Builder::new().name("emulated HD".to_owned()).spawn(run).ok();
        RUNNING.store(schedule.thread.is_some(), Ordering::Release);
    }
    schedule.thread.is_some()
}

/// When it returns, no callback runs, unless one of them has called it. The motors keep their force until the amplifiers drop
/// out.
pub fn stop() {
    RUNNING.store(false, Ordering::Release);
    if IS_SERVO.get() {
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
        let fast = world::<Device>().library.fast;
        if !fast {
            deadline = (deadline + PERIOD).max(Instant::now());
            std::thread::sleep(deadline - Instant::now().min(deadline));
        }
        if world::<Device>().has(Disturbance::SlowReplies) {
            std::thread::sleep(SLOW);
        }
        let now = Instant::now();
        let elapsed = if fast { PERIOD } else { now - last };
        last = now;
        TICKS.fetch_add(1, Ordering::AcqRel);
        world::<Device>().devices.iter_mut().for_each(|device| device.advance(elapsed.as_secs_f64()));
        let scheduled = schedule().scheduled.clone();
        for one in scheduled {
            // SAFETY: who scheduled it has promised that it may be called with its data until it is unscheduled.
            unsafe { (one.callback)(one.data as *mut c_void) };
        }
    }
}
