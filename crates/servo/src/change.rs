//! How something that a tick must not make comes into a running loop, and what it replaces goes out.
//!
//! It is exchanged in one tick. The thread that offers it waits for that tick, or takes the offer back if none comes.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::Duration;

use crate::exchange::{ExchangeEnd, ExchangeHandle, exchange_ends};

/// How long, and how often at most, a tick is waited for.
const WAIT: Duration = Duration::from_micros(500);
const MOST_WAITS: u32 = 4000;

/// Nobody has decided yet; the loop has taken it; whoever offered it has given up.
const OPEN: u8 = 0;
const TAKEN: u8 = 1;
const GIVEN_UP: u8 = 2;

struct Offer<T> {
    item: T,
    decided: Arc<AtomicU8>,
}

/// The loop's end.
pub(crate) struct ChangeEnd<T>(ExchangeEnd<Box<Offer<T>>>);

/// Everybody else's end.
pub(crate) struct ChangeHandle<T>(ExchangeHandle<Box<Offer<T>>>);

/// What has come in, on its way out.
pub(crate) struct Taken<T>(Box<Offer<T>>);

/// Both ends.
pub(crate) fn change_ends<T>() -> (ChangeEnd<T>, ChangeHandle<T>) {
    let (end, handle) = exchange_ends(1);
    (ChangeEnd(end), ChangeHandle(handle))
}

impl<T> ChangeEnd<T> {
    /// What was offered, if it still is; never allocates or frees.
    pub fn take(&mut self) -> Option<Taken<T>> {
        let offer = self.0.take()?;
        match offer.decided.compare_exchange(OPEN, TAKEN, Ordering::AcqRel, Ordering::Acquire) {
            Ok(_) => Some(Taken(offer)),
            Err(_) => {
                self.0.give_back(offer);
                None
            }
        }
    }

    /// Sends out what was taken.
    pub fn give_back(&mut self, taken: Taken<T>) {
        self.0.give_back(taken.0);
    }
}

impl<T> Taken<T> {
    /// To be exchanged.
    pub fn item(&mut self) -> &mut T {
        &mut self.0.item
    }
}

impl<T> ChangeHandle<T> {
    /// Offers something and waits until a tick has taken it, which it gives back: whether one did.
    pub fn offer(&mut self, item: T) -> bool {
        let decided = Arc::new(AtomicU8::new(OPEN));
        if !self.0.offer(Box::new(Offer { item, decided: decided.clone() })) {
            return false;
        }
        if self.comes_back() {
            return true;
        }
        if decided.compare_exchange(OPEN, GIVEN_UP, Ordering::AcqRel, Ordering::Acquire).is_ok() {
            return false;
        }
        // Taken at the last moment: its tick is under way.
        self.comes_back();
        true
    }

    /// Waits for what a tick gives back.
    fn comes_back(&mut self) -> bool {
        for _ in 0..MOST_WAITS {
            if self.0.free() {
                return true;
            }
            std::thread::sleep(WAIT);
        }
        false
    }
}
