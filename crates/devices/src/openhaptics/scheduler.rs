//! The scheduler of the library: one thread for all its devices, which calls the tick.
//!
//! The vendor's rules: one frame a device and tick; no calls from elsewhere while the scheduler runs; a device that comes, goes
//! or comes back is a matter of a stopped scheduler. A thread beside it, the keeper, does that. While the scheduler is stopped for
//! a device that is unplugged, the keeper calls the tick, so that the loop says what is wrong and goes on with devices of other
//! drivers; those of this one say that they are disconnected.
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

/// Ticks a second: the library's default, and what every device of the vendor has.
const RATE: f64 = 1000.0;

/// Time between two looks of the keeper.
const LOOK: Duration = Duration::from_millis(20);

/// Time for which the loop may tick on with a device that is unplugged before the scheduler is stopped: it publishes its fault.
const FAREWELL: Duration = Duration::from_millis(60);

/// Time between two attempts to find an unplugged device.
const ATTEMPT: Duration = Duration::from_millis(500);

/// Longest time for which the ticks without force are waited for before the scheduler is stopped.
const HUSH: Duration = Duration::from_millis(50);

thread_local! {
    /// The scheduler whose tick this thread is in.
    static TICKING: Cell<*const HdScheduler> = const { Cell::new(std::ptr::null()) };
}

type Tick = Box<dyn FnMut() + Send>;

/// A device of the scheduler, as it and the tick share it.
pub struct Slot {
    /// Its name in the vendor's setup; the default device has none.
    pub name: Option<CString>,
    pub traits: Traits,
    handle: AtomicU32,
    lost: AtomicBool,
    /// Nobody has it any more.
    closing: AtomicBool,
    /// Has had its frame in this tick.
    framed: AtomicBool,
    /// An error that was found in the frame of another device.
    foreign_error: AtomicU32,
}

impl Slot {
    /// Its number, while it is plugged in.
    pub fn handle(&self) -> Option<Handle> {
        let handle = self.handle.load(Ordering::Acquire);
        (handle != INVALID_HANDLE && !self.lost.load(Ordering::Acquire)).then_some(handle)
    }

    /// Its number, while the library has it: one that is taken for lost may still hear.
    pub fn last_handle(&self) -> Option<Handle> {
        let handle = self.handle.load(Ordering::Acquire);
        (handle != INVALID_HANDLE).then_some(handle)
    }

    pub fn lose(&self) {
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

/// What is changed only by who has stopped the scheduler, or is about to start it.
#[derive(Default)]
struct Control {
    running: Option<SchedulerHandle>,
    keeper: Option<JoinHandle<()>>,
}

/// The scheduler of one library, for as long as the process lives: the library may call it.
pub struct HdScheduler {
    pub hd: Hd,
    control: Mutex<Control>,
    /// Changed only while the library's scheduler is stopped: in a tick they can always be read.
    slots: RwLock<Vec<Arc<Slot>>>,
    tick: Mutex<Option<Tick>>,
    /// Ticks that are over.
    ticks: AtomicU64,
    /// Set before the library's scheduler is stopped: frames have no force.
    quiet: AtomicBool,
    /// Set while the library's scheduler is stopped for a device that is unplugged.
    dormant: AtomicBool,
    stopping: AtomicBool,
    /// The tick has panicked.
    panicked: AtomicBool,
    /// The same for all devices, so that a loop sees that they share it.
    handout: OnceLock<Arc<dyn Scheduler>>,
}

/// Called by the library at each of its ticks.
unsafe extern "system" fn callback(scheduler: *mut c_void) -> CallbackCode {
    // SAFETY: it was scheduled with a scheduler that is never freed.
    let scheduler = unsafe { &*scheduler.cast::<HdScheduler>().cast_const() };
    scheduler.tick();
    CALLBACK_CONTINUE
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl HdScheduler {
    /// Of a library, from the second call on the same.
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
            dormant: AtomicBool::new(false),
            stopping: AtomicBool::new(false),
            panicked: AtomicBool::new(false),
            handout: OnceLock::new(),
        }));
        all.push(scheduler);
        scheduler
    }

    /// What a loop has of it.
    pub fn handout(&'static self) -> Arc<dyn Scheduler> {
        self.handout.get_or_init(|| Arc::new(Handout(self))).clone()
    }

    fn slots(&self) -> RwLockReadGuard<'_, Vec<Arc<Slot>>> {
        self.slots.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether this thread may read and write devices now: in a tick of the library.
    pub fn is_ticking(&self) -> bool {
        std::ptr::eq(TICKING.get(), self) && !self.is_dormant()
    }

    /// Whether frames are to have no force.
    pub fn is_quiet(&self) -> bool {
        self.quiet.load(Ordering::Acquire)
    }

    /// Whether the library's scheduler is stopped for a device that is unplugged.
    pub fn is_dormant(&self) -> bool {
        self.dormant.load(Ordering::Acquire)
    }

    /// One tick. The locks are free: whoever else takes them has stopped the library's scheduler.
    fn tick(&self) {
        let (Ok(slots), Ok(mut tick)) = (self.slots.try_read(), self.tick.try_lock()) else { return };
        slots.iter().for_each(|slot| slot.framed.store(false, Ordering::Relaxed));
        TICKING.set(self);
        let callable = tick.as_mut().filter(|_| !self.panicked.load(Ordering::Acquire));
        // A panic must not reach the library. A loop catches its own; a tick that panics all the same is not called again.
        let panicked = callable.is_some_and(|tick| catch_unwind(AssertUnwindSafe(tick)).is_err());
        if !self.is_dormant() {
            slots.iter().for_each(|slot| self.release(slot));
        }
        TICKING.set(std::ptr::null());
        self.ticks.fetch_add(1, Ordering::AcqRel);
        self.panicked.fetch_or(panicked, Ordering::AcqRel);
    }

    /// A frame without a force for a device that has had none in this tick: it would keep its last one, even one that is
    /// taken for lost.
    fn release(&self, slot: &Slot) {
        let Some(handle) = slot.last_handle().filter(|_| !slot.framed.load(Ordering::Relaxed)) else { return };
        self.hd.begin_frame(handle);
        self.hd.end_frame(handle);
        if self.errors(handle) == Some(error::COMMUNICATION) {
            slot.lose();
        }
    }

    /// Takes the errors off the library's stack, which is the same for all devices: the first one of this device, or of none.
    pub fn errors(&self, handle: Handle) -> Option<Enum> {
        let mut own = None;
        self.hd.drain_errors(|code, device| {
            if device == handle || !self.leave_error(code, device) {
                own = Some(code);
            }
        });
        own
    }

    /// Leaves an error to the device that it is about, which finds it in its next frame.
    fn leave_error(&self, code: Enum, device: Handle) -> bool {
        match self.slots.try_read() {
            Ok(slots) => slots
                .iter()
                .find(|slot| slot.last_handle() == Some(device))
                .inspect(|slot| slot.foreign_error.store(code, Ordering::Relaxed))
                .is_some(),
            Err(_) => false,
        }
    }

    /// Adds a device while no loop runs: its own would have neither measurements nor forces meanwhile.
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

    /// The lock of who stops the scheduler. The keeper has it for long only while it waits for a device.
    fn control_in_time(&self) -> Result<MutexGuard<'_, Control>, OpenError> {
        let began = Instant::now();
        while began.elapsed() < ATTEMPT {
            match self.control.try_lock() {
                Ok(control) => return Ok(control),
                Err(TryLockError::Poisoned(poisoned)) => return Ok(poisoned.into_inner()),
                Err(TryLockError::WouldBlock) => std::thread::sleep(LOOK),
            }
        }
        let what = "another device of OpenHaptics is unplugged and waited for";
        Err(OpenError::new(what, "plug it in or close it, then try again"))
    }

    /// Does something with the scheduler stopped, and starts it again. For as long as it does not start, the devices say that
    /// they are disconnected.
    fn paused(&self, act: impl FnOnce()) {
        self.stop_quietly();
        act();
        while !self.starts() {
            self.hd.stop_scheduler();
            self.hd.first_error();
            self.tick_dormant();
        }
    }

    /// Stops the library's scheduler, behind two ticks without force: devices would keep their last one.
    fn stop_quietly(&self) {
        self.quiet.store(true, Ordering::Release);
        // The first may have begun before.
        let (enough, began) = (self.ticks.load(Ordering::Acquire) + 3, Instant::now());
        while self.ticks.load(Ordering::Acquire) < enough && began.elapsed() < HUSH {
            std::thread::sleep(Duration::from_micros(500));
        }
        self.hd.stop_scheduler();
        self.quiet.store(false, Ordering::Release);
    }

    /// Starts the library's scheduler; whether it ticks then, or is to stop anyway. Its stack of errors is read by its ticks.
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

    /// A device that nobody has any more: closed at once, or by the keeper.
    pub fn remove(&self, slot: &Slot) {
        slot.closing.store(true, Ordering::Release);
        if let Ok(control) = self.control.try_lock()
            && control.running.is_none()
        {
            self.sweep();
        }
    }

    /// Names of the open devices.
    pub fn open(&self) -> Vec<Arc<Slot>> {
        self.slots().iter().filter(|slot| !slot.closing.load(Ordering::Acquire)).cloned().collect()
    }

    /// Does something that no tick may interrupt, unless a loop runs.
    pub fn while_idle<R>(&self, act: impl FnOnce() -> R) -> Option<R> {
        let control = self.control.try_lock().ok()?;
        if control.running.is_some() {
            return None;
        }
        self.sweep();
        Some(act())
    }

    /// Closes the devices that nobody has. The scheduler is stopped.
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

    /// Until the scheduler is to stop.
    fn keep(&self) {
        while !self.stopping.load(Ordering::Acquire) {
            std::thread::sleep(LOOK);
            let lost = self.any(|slot| slot.lost.load(Ordering::Acquire));
            let closing = self.any(|slot| slot.closing.load(Ordering::Acquire));
            if !lost && !closing {
                continue;
            }
            let Ok(_control) = self.control.try_lock() else { continue };
            if lost {
                std::thread::sleep(FAREWELL);
            }
            self.paused(|| self.wait_for_lost());
        }
    }

    /// Closes what nobody has, and waits until every lost device is back. The scheduler is stopped.
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

    /// Ticks without the library until the next attempt. The scheduler is stopped.
    fn tick_dormant(&self) {
        self.dormant.store(true, Ordering::Release);
        let began = Instant::now();
        while began.elapsed() < ATTEMPT && !self.stopping.load(Ordering::Acquire) {
            self.tick();
            std::thread::sleep(Duration::from_secs_f64(1.0 / RATE));
        }
        self.dormant.store(false, Ordering::Release);
    }

    fn bring_back(&self, slot: &Slot) {
        let gone = slot.handle.swap(INVALID_HANDLE, Ordering::AcqRel);
        if gone != INVALID_HANDLE {
            self.hd.disable_device(gone);
            self.hd.first_error();
        }
        if let Ok((handle, _)) = prepared(self.hd, slot.name.as_ref()) {
            slot.foreign_error.store(error::SUCCESS, Ordering::Relaxed);
            slot.handle.store(handle, Ordering::Release);
            slot.lost.store(false, Ordering::Release);
        }
    }
}

/// What a loop has of the scheduler.
struct Handout(&'static HdScheduler);

impl Scheduler for Handout {
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
        let keeper = match hd.first_error() {
            None => std::thread::Builder::new()
                .name("palpate-openhaptics".to_owned())
                .spawn(|| scheduler.keep())
                .map_err(|error| format!("the system gives no thread ({error})")),
            Some(code) => Err(format!("the scheduler of OpenHaptics does not start ({})", hd.error_text(code))),
        };
        match keeper {
            Ok(keeper) => {
                *control = Control { running: Some(scheduled), keeper: Some(keeper) };
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
        // The keeper may wait for a device with the lock; told to stop, it lets go of it.
        let keeper = locked(&scheduler.control).keeper.take();
        if let Some(keeper) = keeper {
            let _ = keeper.join();
        }
        let mut control = locked(&scheduler.control);
        let Some(scheduled) = control.running.take() else { return };
        scheduler.stop_quietly();
        scheduler.hd.unschedule(scheduled);
        scheduler.hd.first_error();
        // What it owns closes its devices, with the scheduler stopped.
        let tick = locked(&scheduler.tick).take();
        drop(control);
        drop(tick);
        scheduler.sweep();
    }
}
