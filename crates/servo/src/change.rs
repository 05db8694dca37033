//! Bodies, tools and devices that come into a running loop, or go out of it.
//!
//! Everything that depends on the scene is made anew beside the loop: a whole loop with its hand-offs, at rest. It comes in
//! through a ring, takes over what goes on, and is exchanged for the running one within one tick; what it replaces goes back
//! through another ring, for memory must not be freed in a tick. Contacts between bodies and tools that stay go on without a step
//! in their force; a new tool's forces ramp in; a device that leaves is left without a wrench.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::Duration;

use palpate_core::simulation::{Kept, MAX_TOOLS, Model};
use palpate_core::{Error, Result};
use palpate_devices::{Device, DeviceFault, DeviceLimits, Reading, Wrench};
use rtrb::{Consumer, Producer, RingBuffer};

use crate::force_loop::ForceLoop;
use crate::handoff::LoopHandle;
use crate::log::Status;
use crate::preparer::StrainPreparer;
use crate::settings::Settings;

/// How long, and how often at most, a tick is waited for.
const WAIT: Duration = Duration::from_micros(500);
const MOST_WAITS: u32 = 4000;

/// Another scene for a running loop.
pub struct SceneChange {
    /// Its bodies and tools.
    pub model: Arc<Model>,
    /// Which of them were there before.
    pub kept: Kept,
    /// One a tool: a new device, or none for a tool that keeps the one it has.
    pub devices: Vec<Option<Box<dyn Device>>>,
    /// From now on.
    pub settings: Settings,
    /// What measures the strain of the bodies.
    pub strain: StrainPreparer,
}

/// A loop that is to take the place of the running one.
pub(crate) struct Successor {
    pub force_loop: ForceLoop,
    pub kept: Kept,
    /// Which tools of those that stay keep their device.
    pub keeps_device: Vec<bool>,
    decided: Arc<AtomicU8>,
}

/// Nobody has decided yet; the loop has taken it; whoever waited has given up.
const OPEN: u8 = 0;
const TAKEN: u8 = 1;
const GIVEN_UP: u8 = 2;

/// The loop's end.
pub(crate) struct ChangeEnd {
    incoming: Consumer<Box<Successor>>,
    outgoing: Producer<Box<Successor>>,
}

/// Everybody else's end.
pub(crate) struct ChangeHandle {
    incoming: Producer<Box<Successor>>,
    outgoing: Consumer<Box<Successor>>,
}

/// Both ends.
pub(crate) fn change_ends() -> (ChangeEnd, ChangeHandle) {
    let (incoming_in, incoming_out) = RingBuffer::new(1);
    let (outgoing_in, outgoing_out) = RingBuffer::new(1);
    let end = ChangeEnd { incoming: incoming_out, outgoing: outgoing_in };
    (end, ChangeHandle { incoming: incoming_in, outgoing: outgoing_out })
}

impl ForceLoop {
    /// Goes on as the loop that has come in, if one has. Never allocates or frees.
    pub(crate) fn take_change(&mut self) {
        // What comes out must find room, or it would be freed here.
        if self.changes.outgoing.is_full() {
            return;
        }
        let Ok(mut successor) = self.changes.incoming.pop() else { return };
        if successor.decided.compare_exchange(OPEN, TAKEN, Ordering::AcqRel, Ordering::Acquire).is_ok() {
            let Successor { force_loop, kept, keeps_device, .. } = &mut *successor;
            force_loop.go_on_from(self, kept, keeps_device);
            std::mem::swap(self, force_loop);
            // Whoever waits does so at the ends of the loop that was there first.
            std::mem::swap(&mut self.changes, &mut force_loop.changes);
        }
        let _ = self.changes.outgoing.push(successor);
    }

    /// Takes over what goes on from the loop before.
    fn go_on_from(&mut self, before: &mut ForceLoop, kept: &Kept, keeps_device: &[bool]) {
        self.state.take_over(&mut before.state, kept);
        for (tool, (old, _)) in kept.tools.iter().zip(keeps_device).enumerate().filter(|(_, (_, keeps))| **keeps) {
            let Some(old) = old.filter(|&old| old < before.devices.len()) else { continue };
            std::mem::swap(&mut self.devices[tool], &mut before.devices[old]);
            std::mem::swap(&mut self.stages[tool], &mut before.stages[old]);
        }
        self.status = Status {
            readings: by_new_rank(&before.status.readings, kept),
            wrenches: by_new_rank(&before.status.wrenches, kept),
            ports: by_new_rank(&before.status.ports, kept),
            ..before.status
        };
        std::mem::swap(&mut self.timing, &mut before.timing);
        std::mem::swap(&mut self.ends.rows, &mut before.ends.rows);
        (self.fault, self.start_ns, self.row) = (before.fault, before.start_ns, before.row.take());
    }
}

/// Each new rank's value: of a tool that stays the one it had.
fn by_new_rank<T: Copy + Default>(values: &[T; MAX_TOOLS], kept: &Kept) -> [T; MAX_TOOLS] {
    kept.tools.map(|old| old.and_then(|old| values.get(old)).copied().unwrap_or_default())
}

impl LoopHandle {
    /// Exchanges the scene of the running loop, and waits for the tick that does it.
    ///
    /// # Errors
    /// See [`ForceLoop::new`]; a loop that is being recorded, or does not tick. The loop then goes on as it was.
    pub(crate) fn change(
        &mut self,
        next: ForceLoop,
        next_handle: LoopHandle,
        kept: Kept,
        keeps_device: Vec<bool>,
    ) -> Result<()> {
        if self.is_recorded() {
            return Err(Error::Invalid(
                "the scene cannot be changed while it is recorded: stop the recording first".into(),
            ));
        }
        let decided = Arc::new(AtomicU8::new(OPEN));
        let successor = Box::new(Successor { force_loop: next, kept, keeps_device, decided: decided.clone() });
        while self.changes.outgoing.pop().is_ok() {}
        let silent = || Error::Invalid("the loop does not tick: the scene stays as it was".into());
        self.changes.incoming.push(successor).map_err(|_| silent())?;
        for _ in 0..MOST_WAITS {
            if self.changes.outgoing.pop().is_ok() {
                self.go_on_as(next_handle);
                return Ok(());
            }
            std::thread::sleep(WAIT);
        }
        match decided.compare_exchange(OPEN, GIVEN_UP, Ordering::AcqRel, Ordering::Acquire) {
            Ok(_) => Err(silent()),
            Err(_) => {
                self.go_on_as(next_handle);
                Ok(())
            }
        }
    }
}

/// Holds the place of a device that is to come from the loop before.
pub(crate) struct Awaited(pub DeviceLimits);

impl Device for Awaited {
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
