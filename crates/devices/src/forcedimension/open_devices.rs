//! Devices that are open in this process, by rank; the lock that opening and closing take.

use std::sync::{Mutex, MutexGuard, PoisonError};

use super::ffi::Id;

/// A device that a driver's guard holds.
#[derive(Clone, Copy, Debug)]
pub struct OpenDevice {
    /// Its rank when it was opened.
    pub rank: i8,
    /// Its number while it is open; none while it is unplugged.
    pub id: Option<Id>,
    /// How many devices there were when it was opened: ranks count what is plugged in.
    pub count: i8,
}

/// All of them; a thread that opens or closes a device holds the lock.
pub fn open_devices() -> MutexGuard<'static, Vec<OpenDevice>> {
    static OPEN_DEVICES: Mutex<Vec<OpenDevice>> = Mutex::new(Vec::new());
    OPEN_DEVICES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Whether devices have come or gone since some were opened: no rank can be told from theirs.
pub fn ranks_have_moved(open_devices: &[OpenDevice], count: i8) -> bool {
    open_devices.iter().any(|one| one.id.is_none() || one.count != count)
}
