//! Scheduler of the OpenHaptics library: one thread for all its devices, which calls the tick.
//!
//! Rules of the vendor: one frame for each device and tick; no calls from other threads while the scheduler runs; devices are
//! added, removed and reconnected only while it is stopped. The watchdog thread does that. While the scheduler is stopped for an
//! unplugged device, the watchdog calls the tick: the loop then reports the fault and continues with devices of other drivers,
//! while all devices of this driver are disconnected.
#![allow(unsafe_code)] // The callback gets its scheduler as an untyped pointer.

use std::cell::Cell;
use std::ffi::{CString, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, RwLock, RwLockReadGuard, TryLockError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::ffi::{CALLBACK_CONTINUE, CallbackCode, Enum, Handle, INVALID_HANDLE, SchedulerHandle, error};
use super::library::Hd;
use super::{Traits, prepared};
use crate::{OpenError, Scheduler};

/// Ticks per second: the library's default, and the rate of every device of the vendor.
const RATE: f64 = 1000.0;

/// Interval at which the watchdog thread polls.
const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// Time for which the loop continues with an unplugged device before the scheduler is stopped, so that it publishes the fault.
const UNPLUG_GRACE: Duration = Duration::from_millis(60);

/// Time between two attempts to find an unplugged device.
const ATTEMPT: Duration = Duration::from_millis(500);

/// Longest wait for the ticks with zero force before the scheduler is stopped.
const ZERO_FORCE_TIMEOUT: Duration = Duration::from_millis(50);

thread_local! {
    /// The scheduler whose tick runs on this thread.
    static TICKING: Cell<*const HdScheduler> = const { Cell::new(std::ptr::null()) };
}

type Tick = Box<dyn FnMut() + Send>;

/// A device of the scheduler, shared with the tick.
pub struct Slot {
    /// Its name in the vendor's setup; the default device has none.
    pub name: Option<CString>,
    pub traits: Traits,
    handle: AtomicU32,
    lost: AtomicBool,
    /// Its driver object has been dropped.
    closing: AtomicBool,
    /// Whether it has had its frame in this tick.
    framed: AtomicBool,
    /// Its error that the frame of another device has read.
    foreign_error: AtomicU32,
}

impl Slot {
    /// Its handle, while it is plugged in.
    pub fn handle(&self) -> Option<Handle> {
        let handle = self.handle.load(Ordering::Acquire);
        (handle != INVALID_HANDLE && !self.lost.load(Ordering::Acquire)).then_some(handle)
    }

    /// Its handle, while the library has one: a device marked as lost may still receive forces.
    pub fn last_handle(&self) -> Option<Handle> {
        let handle = self.handle.load(Ordering::Acquire);
        (handle != INVALID_HANDLE).then_some(handle)
    }

    pub fn mark_lost(&self) {
        self.lost.store(true, Ordering::Release);
    }

    pub fn note_frame(&self) {
        self.framed.store(true, Ordering::Relaxed);
    }

    pub fn take_foreign_error(&self) -> Option<Enum> {
        let code = self.foreign_error.swap(error::SUCCESS, Ordering::Relaxed);
        (code != error::SUCCESS).then_some(code)
    }
}

/// State that changes only while the scheduler is stopped.
#[derive(Default)]
struct Control {
    running: Option<SchedulerHandle>,
    watchdog: Option<JoinHandle<()>>,
}

/// The scheduler of one library. It is never freed, for the library may call it at any time.
pub struct HdScheduler {
    pub hd: Hd,
    control: Mutex<Control>,
    /// Changed only while the library's scheduler is stopped, so that a tick can always read them.
    slots: RwLock<Vec<Arc<Slot>>>,
    tick: Mutex<Option<Tick>>,
    /// Number of completed ticks.
    ticks: AtomicU64,
    /// Set before the library's scheduler is stopped: frames have zero force.
    quiet: AtomicBool,
    /// Set while the library's scheduler is stopped for an unplugged device.
    suspended: AtomicBool,
    stopping: AtomicBool,
    /// Whether the tick has panicked.
    panicked: AtomicBool,
    /// The same object for all devices: a loop recognises by it that they share a scheduler.
    handout: OnceLock<Arc<dyn Scheduler>>,
}

/// Called by the library at each of its ticks.
unsafe extern "system" fn callback(scheduler: *mut c_void) -> CallbackCode {
    // SAFETY: the pointer is that of a scheduler, which is never freed.
    let scheduler = unsafe { &*scheduler.cast::<HdScheduler>().cast_const() };
    scheduler.tick();
    CALLBACK_CONTINUE
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl HdScheduler {
    /// The scheduler of a library; later calls return the same.
    pub fn of(hd: Hd) -> &'static HdScheduler {
        static ALL: Mutex<Vec<&'static HdScheduler>> = Mutex::new(Vec::new());
        let mut all = locked(&ALL);
        if let Some(scheduler) = all.iter().find(|scheduler| scheduler.hd.is(hd)) {
            return scheduler;
        }
        let scheduler: &'static HdScheduler = Box::leak(Box::new(HdScheduler {
            hd,
            control: Mutex::default(),
            slots: RwLock::default(),
            tick: Mutex::default(),
            ticks: AtomicU64::new(0),
            quiet: AtomicBool::new(false),
            suspended: AtomicBool::new(false),
            stopping: AtomicBool::new(false),
            panicked: AtomicBool::new(false),
            handout: OnceLock::new(),
        }));
        all.push(scheduler);
        scheduler
    }

    /// The scheduler for a loop.
    pub fn handout(&'static self) -> Arc<dyn Scheduler> {
        self.handout.get_or_init(|| Arc::new(LoopScheduler(self))).clone()
    }

    fn slots(&self) -> RwLockReadGuard<'_, Vec<Arc<Slot>>> {
        self.slots.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether this thread may read and write devices now: in a tick of the library.
    pub fn is_ticking(&self) -> bool {
        std::ptr::eq(TICKING.get(), self) && !self.is_suspended()
    }

    /// Whether frames must have zero force.
    pub fn is_force_off(&self) -> bool {
        self.quiet.load(Ordering::Acquire)
    }

    /// Whether the library's scheduler is stopped for an unplugged device.
    pub fn is_suspended(&self) -> bool {
        self.suspended.load(Ordering::Acquire)
    }

    /// One tick. The locks are free, for other threads take them only while the library's scheduler is stopped.
    fn tick(&self) {
        let (Ok(slots), Ok(mut tick)) = (self.slots.try_read(), self.tick.try_lock()) else { return };
        slots.iter().for_each(|slot| slot.framed.store(false, Ordering::Relaxed));
        TICKING.set(self);
        let callable = tick.as_mut().filter(|_| !self.panicked.load(Ordering::Acquire));
        // A panic must not reach the library. A loop catches its own; a tick that panics nevertheless is not called again.
        let panicked = callable.is_some_and(|tick| catch_unwind(AssertUnwindSafe(tick)).is_err());
        if !self.is_suspended() {
            slots.iter().for_each(|slot| self.release(slot));
        }
        TICKING.set(std::ptr::null());
        self.ticks.fetch_add(1, Ordering::AcqRel);
        self.panicked.fetch_or(panicked, Ordering::AcqRel);
    }

    /// A frame with zero force for a device without one in this tick: it would keep its last force, even if it is marked as lost.
    fn release(&self, slot: &Slot) {
        let Some(handle) = slot.last_handle().filter(|_| !slot.framed.load(Ordering::Relaxed)) else { return };
        self.hd.begin_frame(handle);
        self.hd.end_frame(handle);
        if self.errors(handle) == Some(error::COMMUNICATION) {
            slot.mark_lost();
        }
    }

    /// Clears the library's error stack, which all devices share. Returns an error of this device, or of none.
    pub fn errors(&self, handle: Handle) -> Option<Enum> {
        let mut own = None;
        self.hd.drain_errors(|code, device| {
            if device == handle || !self.deliver_error(code, device) {
                own = Some(code);
            }
        });
        own
    }

    /// Stores an error for its device, which reads it in its next frame.
    fn deliver_error(&self, code: Enum, device: Handle) -> bool {
        match self.slots.try_read() {
            Ok(slots) => slots
                .iter()
                .find(|slot| slot.last_handle() == Some(device))
                .inspect(|slot| slot.foreign_error.store(code, Ordering::Relaxed))
                .is_some(),
            Err(_) => false,
        }
    }

    /// Adds a device while no loop runs: the devices of a running loop would have neither measurements nor forces meanwhile.
    pub fn add(&self, name: Option<CString>) -> Result<Arc<Slot>, OpenError> {
        let control = self.control_in_time()?;
        if self.open().iter().any(|slot| slot.name == name) {
            let what = "the device is in use by this program";
            return Err(OpenError::new(what, "use another one, or close it first"));
        }
        if control.running.is_some() {
            let what = "a loop of this program runs with OpenHaptics, which takes no other device meanwhile";
            return Err(OpenError::new(what, "stop the loop first, and open all its devices before it starts"));
        }
        self.sweep();
        let (handle, traits) = prepared(self.hd, name.as_ref())?;
        let slot = Arc::new(Slot {
            name,
            traits,
            handle: AtomicU32::new(handle),
            lost: AtomicBool::new(false),
            closing: AtomicBool::new(false),
            framed: AtomicBool::new(false),
            foreign_error: AtomicU32::new(error::SUCCESS),
        });
        self.slots.write().unwrap_or_else(PoisonError::into_inner).push(Arc::clone(&slot));
        Ok(slot)
    }

    /// The lock that is held while the scheduler is stopped. The watchdog holds it for long only while it waits for a device.
    fn control_in_time(&self) -> Result<MutexGuard<'_, Control>, OpenError> {
        let began = Instant::now();
        while began.elapsed() < ATTEMPT {
            match self.control.try_lock() {
                Ok(control) => return Ok(control),
                Err(TryLockError::Poisoned(poisoned)) => return Ok(poisoned.into_inner()),
                Err(TryLockError::WouldBlock) => std::thread::sleep(POLL_INTERVAL),
            }
        }
        let what = "another device of OpenHaptics is unplugged and waited for";
        Err(OpenError::new(what, "plug it in or close it, then try again"))
    }

    /// Calls `act` with the scheduler stopped, and starts it again. Devices are disconnected until it starts.
    fn paused(&self, act: impl FnOnce()) {
        self.stop_quietly();
        act();
        while !self.starts() {
            self.hd.stop_scheduler();
            self.hd.first_error();
            self.tick_dormant();
        }
    }

    /// Stops the library's scheduler after two ticks with zero force: devices would keep their last force.
    fn stop_quietly(&self) {
        self.quiet.store(true, Ordering::Release);
        // The first of three ticks may have begun before.
        let (enough, began) = (self.ticks.load(Ordering::Acquire) + 3, Instant::now());
        while self.ticks.load(Ordering::Acquire) < enough && began.elapsed() < ZERO_FORCE_TIMEOUT {
            std::thread::sleep(Duration::from_micros(500));
        }
        self.hd.stop_scheduler();
        self.quiet.store(false, Ordering::Release);
    }

    /// Starts the library's scheduler. Returns whether it ticks, or is to stop anyway. Its ticks read its error stack.
    fn starts(&self) -> bool {
        let (before, began) = (self.ticks.load(Ordering::Acquire), Instant::now());
        self.hd.start_scheduler();
        while self.ticks.load(Ordering::Acquire) == before && !self.stopping.load(Ordering::Acquire) {
            if began.elapsed() > ATTEMPT {
                return false;
            }
            std::thread::sleep(Duration::from_micros(500));
        }
        true
    }

    /// Removes a device whose driver object is dropped: at once, or later by the watchdog.
    pub fn remove(&self, slot: &Slot) {
        slot.closing.store(true, Ordering::Release);
        if let Ok(control) = self.control.try_lock()
            && control.running.is_none()
        {
            self.sweep();
        }
    }

    /// The open devices.
    pub fn open(&self) -> Vec<Arc<Slot>> {
        self.slots().iter().filter(|slot| !slot.closing.load(Ordering::Acquire)).cloned().collect()
    }

    /// Calls `act`, which no tick may interrupt, unless a loop runs.
    pub fn while_idle<R>(&self, act: impl FnOnce() -> R) -> Option<R> {
        let control = self.control.try_lock().ok()?;
        if control.running.is_some() {
            return None;
        }
        self.sweep();
        Some(act())
    }

    /// Closes the removed devices. The scheduler must be stopped.
    fn sweep(&self) {
        self.slots.write().unwrap_or_else(PoisonError::into_inner).retain(|slot| {
            let closing = slot.closing.load(Ordering::Acquire);
            let handle = slot.handle.load(Ordering::Acquire);
            if closing && handle != INVALID_HANDLE {
                self.hd.disable_device(handle);
            }
            !closing
        });
    }

    fn any(&self, is: impl Fn(&Slot) -> bool) -> bool {
        self.slots().iter().any(|slot| is(slot))
    }

    /// The watchdog: runs until the scheduler is to stop.
    fn watch(&self) {
        while !self.stopping.load(Ordering::Acquire) {
            std::thread::sleep(POLL_INTERVAL);
            let lost = self.any(|slot| slot.lost.load(Ordering::Acquire));
            let closing = self.any(|slot| slot.closing.load(Ordering::Acquire));
            if !lost && !closing {
                continue;
            }
            let Ok(_control) = self.control.try_lock() else { continue };
            if lost {
                std::thread::sleep(UNPLUG_GRACE);
            }
            self.paused(|| self.wait_for_lost());
        }
    }

    /// Closes the removed devices, and waits until every lost device is back. The scheduler must be stopped.
    fn wait_for_lost(&self) {
        let is_lost = |slot: &Slot| slot.lost.load(Ordering::Acquire);
        loop {
            self.sweep();
            let lost: Vec<Arc<Slot>> = self.slots().iter().filter(|slot| is_lost(slot)).cloned().collect();
            lost.iter().for_each(|slot| self.bring_back(slot));
            if !self.any(is_lost) || self.stopping.load(Ordering::Acquire) {
                return;
            }
            self.tick_dormant();
        }
    }

    /// Ticks without the library until the next attempt. The scheduler must be stopped.
    fn tick_dormant(&self) {
        self.suspended.store(true, Ordering::Release);
        let began = Instant::now();
        while began.elapsed() < ATTEMPT && !self.stopping.load(Ordering::Acquire) {
            self.tick();
            std::thread::sleep(Duration::from_secs_f64(1.0 / RATE));
        }
        self.suspended.store(false, Ordering::Release);
    }

    fn bring_back(&self, slot: &Slot) {
        let old_handle = slot.handle.swap(INVALID_HANDLE, Ordering::AcqRel);
        if old_handle != INVALID_HANDLE {
            self.hd.disable_device(old_handle);
            self.hd.first_error();
        }
        if let Ok((handle, _)) = prepared(self.hd, slot.name.as_ref()) {
            slot.foreign_error.store(error::SUCCESS, Ordering::Relaxed);
            slot.handle.store(handle, Ordering::Release);
            slot.lost.store(false, Ordering::Release);
        }
    }
}

/// Handle of a loop to the scheduler.
struct LoopScheduler(&'static HdScheduler);

impl Scheduler for LoopScheduler {
    fn rate(&self) -> f64 {
        RATE
    }

    fn start(&self, tick: Tick) -> Result<(), OpenError> {
        let scheduler = self.0;
        let mut control = locked(&scheduler.control);
        if control.running.is_some() {
            return Err(OpenError::new("OpenHaptics is in use by another loop of this program", "end that one first"));
        }
        *locked(&scheduler.tick) = Some(tick);
        scheduler.stopping.store(false, Ordering::Release);
        scheduler.panicked.store(false, Ordering::Release);
        let hd = scheduler.hd;
        hd.first_error();
        let data = std::ptr::from_ref(scheduler).cast_mut().cast::<c_void>();
        // SAFETY: the callback reads a scheduler, and this one is never freed.
        let scheduled = unsafe { hd.schedule(callback, data) };
        hd.start_scheduler();
        let watchdog = match hd.first_error() {
            None => std::thread::Builder::new()
                .name("palpate-openhaptics".to_owned())
                .spawn(|| scheduler.watch())
                .map_err(|error| format!("the system gives no thread ({error})")),
            Some(code) => Err(format!("the scheduler of OpenHaptics does not start ({})", hd.error_text(code))),
        };
        match watchdog {
            Ok(watchdog) => {
                *control = Control { running: Some(scheduled), watchdog: Some(watchdog) };
                Ok(())
            }
            Err(what) => {
                hd.stop_scheduler();
                hd.unschedule(scheduled);
                let tick = locked(&scheduler.tick).take();
                drop(control);
                drop(tick);
                Err(OpenError::new(what, "close other programs that use the device, and check its driver"))
            }
        }
    }

    fn stop(&self) {
        let scheduler = self.0;
        scheduler.stopping.store(true, Ordering::Release);
        // The watchdog may hold the lock while it waits for a device; it releases it when `stopping` is set.
        let watchdog = locked(&scheduler.control).watchdog.take();
        if let Some(watchdog) = watchdog {
            let _ = watchdog.join();
        }
        let mut control = locked(&scheduler.control);
        let Some(scheduled) = control.running.take() else { return };
        scheduler.stop_quietly();
        scheduler.hd.unschedule(scheduled);
        scheduler.hd.first_error();
        // Dropping the tick removes the devices that it owns; the scheduler is stopped.
        let tick = locked(&scheduler.tick).take();
        drop(control);
        drop(tick);
        scheduler.sweep();
    }
}
