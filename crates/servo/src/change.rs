//! Hand-over of a prepared object to a running loop, in exchange for the one that it replaces.
//!
//! It is exchanged in one tick. The thread that offers it waits for that tick, or takes the offer back if none comes.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::Duration;

use crate::exchange::{ExchangeEnd, ExchangeHandle, exchange_ends};

/// Interval between two polls, and most polls: two seconds for a tick to accept an offer.
const POLL_INTERVAL: Duration = Duration::from_micros(500);
const MAX_POLLS: u32 = 4000;

/// States of an offer: pending; accepted by the loop; withdrawn by the sender.
const PENDING: u8 = 0;
const ACCEPTED: u8 = 1;
const WITHDRAWN: u8 = 2;

struct Offer<T> {
    item: T,
    decision: Arc<AtomicU8>,
}

/// The loop's end.
pub(crate) struct ChangeEnd<T>(ExchangeEnd<Box<Offer<T>>>);

/// The other threads' end.
pub(crate) struct ChangeHandle<T>(ExchangeHandle<Box<Offer<T>>>);

/// An accepted offer: its item is exchanged, then it is sent back to be freed.
pub(crate) struct AcceptedOffer<T>(Box<Offer<T>>);

/// Both ends.
pub(crate) fn change_ends<T>() -> (ChangeEnd<T>, ChangeHandle<T>) {
    let (end, handle) = exchange_ends(1);
    (ChangeEnd(end), ChangeHandle(handle))
}

impl<T> ChangeEnd<T> {
    /// Accepts an offer that has not been withdrawn; never allocates or frees.
    pub fn take(&mut self) -> Option<AcceptedOffer<T>> {
        let offer = self.0.take()?;
        match offer.decision.compare_exchange(PENDING, ACCEPTED, Ordering::AcqRel, Ordering::Acquire) {
            Ok(_) => Some(AcceptedOffer(offer)),
            Err(_) => {
                self.0.give_back(offer);
                None
            }
        }
    }

    /// Sends an accepted offer back.
    pub fn give_back(&mut self, accepted: AcceptedOffer<T>) {
        self.0.give_back(accepted.0);
    }
}

impl<T> AcceptedOffer<T> {
    /// The item, to be exchanged for the loop's own.
    pub fn item(&mut self) -> &mut T {
        &mut self.0.item
    }
}

impl<T> ChangeHandle<T> {
    /// Offers an item and waits until a tick has accepted it. Returns whether one did.
    pub fn offer(&mut self, item: T) -> bool {
        let decision = Arc::new(AtomicU8::new(PENDING));
        if !self.0.offer(Box::new(Offer { item, decision: decision.clone() })) {
            return false;
        }
        if self.wait_for_return() {
            return true;
        }
        if decision.compare_exchange(PENDING, WITHDRAWN, Ordering::AcqRel, Ordering::Acquire).is_ok() {
            return false;
        }
        // Taken at the last moment: its tick is under way.
        self.wait_for_return();
        true
    }

    /// Waits until the offer comes back.
    fn wait_for_return(&mut self) -> bool {
        for _ in 0..MAX_POLLS {
            if self.0.free() {
                return true;
            }
            std::thread::sleep(POLL_INTERVAL);
        }
        false
    }
}
