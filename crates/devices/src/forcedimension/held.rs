//! The devices that this process holds. Nobody else in it may open or close them.

use std::sync::{Mutex, MutexGuard, PoisonError};

use super::ffi::Id;

/// A device that a driver's guard holds.
#[derive(Clone, Copy, Debug)]
pub struct Held {
    /// Its rank when it was opened.
    pub rank: i8,
    /// Its number while it is open; none while it is unplugged.
    pub id: Option<Id>,
    /// How many devices there were when it was opened: ranks count what is plugged in.
    pub count: i8,
}

/// All of them; whoever opens or closes a device has the lock.
pub fn held() -> MutexGuard<'static, Vec<Held>> {
    static HELD: Mutex<Vec<Held>> = Mutex::new(Vec::new());
    HELD.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Whether devices have come or gone since some were opened: no rank can be told from theirs.
pub fn ranks_have_moved(held: &[Held], count: i8) -> bool {
    held.iter().any(|one| one.id.is_none() || one.count != count)
}
