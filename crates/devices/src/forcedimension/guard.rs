//! Guard thread of an open device: status, motors, stale forces, and reopening after it was unplugged.

use std::ffi::c_char;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::ffi::{Id, force_off, status};
use super::library::Dhd;
use super::open_devices::{OpenDevice, open_devices};
use super::{Traits, open_unclaimed, prepare_for_forces};
use crate::OpenError;

/// Time between two looks.
const POLL_INTERVAL: Duration = Duration::from_millis(4);

/// Longest time for which the motors keep a force that is not written again, ns: sixteen ticks, half of what the hardware's
/// own watchdog waits, which is there for a process that does not run at all.
const HOLD_NS: u64 = 16_000_000;

/// Looks from one question for the device's status to the next.
const POLLS_PER_STATUS: u32 = 5;

/// Looks from one attempt to bring back a device, or motors that are off, to the next: 0.2 s.
const POLLS_PER_ATTEMPT: u32 = 50;

/// What the tick finds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Open, by its number.
    Ready(Id),
    /// Open, with its motors switched off.
    MotorsOff,
    /// Unplugged.
    Lost,
}

const LOST: i32 = -1;
const MOTORS_OFF: i32 = -2;

struct Shared {
    dhd: Dhd,
    /// Where it was when it was opened.
    place: OpenDevice,
    traits: Traits,
    /// The device's number when it is ready; [`LOST`], [`MOTORS_OFF`].
    state: AtomicI32,
    began: Instant,
    written_ns: AtomicU64,
    closing: AtomicBool,
}

/// The guard of one open device. When it is dropped the motors are off and the device is closed.
pub struct Guard {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<Option<Id>>>,
}

impl Guard {
    pub fn start(dhd: Dhd, place: OpenDevice, id: Id, traits: Traits) -> Result<Self, OpenError> {
        let (began, written_ns, closing) = (Instant::now(), AtomicU64::new(0), AtomicBool::new(false));
        let state = AtomicI32::new(id.into());
        let shared = Arc::new(Shared { dhd, place, traits, state, began, written_ns, closing });
        let watched = Arc::clone(&shared);
        let thread = std::thread::Builder::new()
            .name("palpate-forcedimension".to_owned())
            .spawn(move || watch(&watched, id))
            .map_err(|error| {
                dhd.close(id);
                OpenError::new(format!("the system gives no thread ({error})"), "close other programs")
            })?;
        Ok(Self { shared, thread: Some(thread) })
    }

    pub fn state(&self) -> State {
        self.shared.state()
    }

    /// The tick has found it unplugged.
    pub fn mark_lost(&self) {
        self.shared.state.store(LOST, Ordering::Release);
        if let Some(thread) = &self.thread {
            thread.thread().unpark();
        }
    }

    /// The tick has written a force.
    pub fn note_write(&self) {
        self.shared.written_ns.store(self.shared.now_ns(), Ordering::Relaxed);
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        self.shared.closing.store(true, Ordering::Release);
        let open = self.thread.take().and_then(|thread| {
            thread.thread().unpark();
            thread.join().ok().flatten()
        });
        if let Some(id) = open {
            let _ = self.shared.release(id);
            let _ = self.shared.dhd.enable_force(false, id);
        }
        let mut open_devices = open_devices();
        if let Some(id) = open {
            self.shared.dhd.close(id);
        }
        open_devices.retain(|one| one.rank != self.shared.place.rank);
    }
}

impl Shared {
    fn now_ns(&self) -> u64 {
        self.began.elapsed().as_nanos() as u64
    }

    fn state(&self) -> State {
        match self.state.load(Ordering::Acquire) {
            LOST => State::Lost,
            MOTORS_OFF => State::MotorsOff,
            id => State::Ready(id as c_char),
        }
    }

    /// No force, and none of rotation.
    fn release(&self, id: Id) -> Result<(), i32> {
        self.dhd.release(self.traits.has_active_wrist, id).map(|_| ())
    }

    fn close(&self, id: Id) {
        let mut open_devices = open_devices();
        self.dhd.close(id);
        self.set_id(&mut open_devices, None);
    }

    /// Writes down by which number it is open.
    fn set_id(&self, open_devices: &mut [OpenDevice], id: Option<Id>) {
        open_devices.iter_mut().filter(|one| one.rank == self.place.rank).for_each(|one| one.id = id);
    }

    /// Changes the state, unless the tick has changed it meanwhile.
    fn change(&self, from: State, to: i32) {
        if let State::Ready(id) = from {
            let _ = self.state.compare_exchange(id.into(), to, Ordering::AcqRel, Ordering::Relaxed);
        }
    }
}

/// Until the device is closed; the number by which it is open then.
fn watch(shared: &Shared, id: Id) -> Option<Id> {
    let mut open = Some(id);
    let mut poll = 0_u32;
    while !shared.closing.load(Ordering::Acquire) {
        poll = poll.wrapping_add(1);
        match (shared.state(), open) {
            (State::Lost, _) => {
                if let Some(lost) = open.take() {
                    shared.close(lost);
                }
                if poll.is_multiple_of(POLLS_PER_ATTEMPT) {
                    open = reopen(shared);
                }
            }
            (_, Some(id)) => watch_open(shared, id, poll),
            (_, None) => shared.state.store(LOST, Ordering::Release),
        }
        std::thread::park_timeout(POLL_INTERVAL);
    }
    open
}

fn watch_open(shared: &Shared, id: Id, poll: u32) {
    let state = shared.state();
    let age_ns = shared.now_ns().saturating_sub(shared.written_ns.load(Ordering::Relaxed));
    if age_ns > HOLD_NS || state == State::MotorsOff {
        // The tick notices what is wrong, if it still ticks. Motors that are off must not come back with a force of before.
        let _ = shared.release(id);
    }
    if !poll.is_multiple_of(POLLS_PER_STATUS) {
        return;
    }
    match shared.dhd.status(id) {
        Ok(status) if status[status::CONNECTED] == 0 => shared.state.store(LOST, Ordering::Release),
        Ok(status) if status[status::FORCE_OFF_CAUSE] != force_off::NONE => {
            shared.change(state, MOTORS_OFF);
            let cause = status[status::FORCE_OFF_CAUSE];
            // Those that a person holds down end by themselves.
            let by_hand = matches!(cause, force_off::BUTTON | force_off::DEAD_MAN);
            if !by_hand && poll.is_multiple_of(POLLS_PER_ATTEMPT) && shared.dhd.enable_force(true, id).is_ok() {
                let _ = shared.release(id);
            }
        }
        // Well, or the tick will notice.
        Ok(_) if state == State::MotorsOff => shared.state.store(id.into(), Ordering::Release),
        _ => (),
    }
}

/// The same device, if it is back: at any rank if its serial number is known, else where it was among as many.
fn reopen(shared: &Shared) -> Option<Id> {
    let mut open_devices = open_devices();
    let (own, count) = (shared.place.rank, shared.dhd.count() as i8);
    let as_many = count == shared.place.count;
    let may_be = |rank: &i8| match shared.traits.serial {
        Some(_) => *rank == own || !as_many || open_devices.iter().all(|one| one.rank != *rank),
        None => *rank == own && as_many,
    };
    let own_first = std::iter::once(own).filter(|own| *own < count).chain((0..count).filter(|rank| *rank != own));
    let id = own_first.filter(may_be).find_map(|rank| reopen_at(shared, rank, &open_devices))?;
    shared.set_id(&mut open_devices, Some(id));
    shared.written_ns.store(shared.now_ns(), Ordering::Relaxed);
    shared.state.store(id.into(), Ordering::Release);
    Some(id)
}

/// The same device, if it is of this rank now.
fn reopen_at(shared: &Shared, rank: i8, open_devices: &[OpenDevice]) -> Option<Id> {
    let (id, traits) = open_unclaimed(shared.dhd, rank, open_devices).ok()?;
    let is_same = (traits.serial, traits.system_type) == (shared.traits.serial, shared.traits.system_type);
    if !is_same {
        shared.dhd.close(id);
        return None;
    }
    prepare_for_forces(shared.dhd, rank, id, &traits).is_ok().then_some(id)
}
