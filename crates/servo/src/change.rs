//! How something that a tick must not make comes into a running loop, and what it replaces goes out.
//!
//! It comes in through a ring and is taken in one tick; it goes back through another ring, for memory must not be freed in a
//! tick. Whoever offers it waits for that tick, or takes the offer back if none comes.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};

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
pub(crate) struct ChangeEnd<T> {
    incoming: Consumer<Box<Offer<T>>>,
    outgoing: Producer<Box<Offer<T>>>,
}

/// Everybody else's end.
pub(crate) struct ChangeHandle<T> {
    incoming: Producer<Box<Offer<T>>>,
    outgoing: Consumer<Box<Offer<T>>>,
}

/// What has come in, on its way out.
pub(crate) struct Taken<T>(Box<Offer<T>>);

/// Both ends.
pub(crate) fn change_ends<T>() -> (ChangeEnd<T>, ChangeHandle<T>) {
    let (incoming_in, incoming_out) = RingBuffer::new(1);
    let (outgoing_in, outgoing_out) = RingBuffer::new(1);
    let end = ChangeEnd { incoming: incoming_out, outgoing: outgoing_in };
    (end, ChangeHandle { incoming: incoming_in, outgoing: outgoing_out })
}

impl<T> ChangeEnd<T> {
    /// What was offered, if it still is; never allocates or frees.
    pub fn take(&mut self) -> Option<Taken<T>> {
        // What comes out must find room, or it would be freed here.
        if self.outgoing.is_full() {
            return None;
        }
        let offer = self.incoming.pop().ok()?;
        match offer.decided.compare_exchange(OPEN, TAKEN, Ordering::AcqRel, Ordering::Acquire) {
            Ok(_) => Some(Taken(offer)),
            Err(_) => {
                let _ = self.outgoing.push(offer);
                None
            }
        }
    }

    /// Sends out what was taken.
    pub fn give_back(&mut self, taken: Taken<T>) {
        let _ = self.outgoing.push(taken.0);
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
        while self.outgoing.pop().is_ok() {}
        let decided = Arc::new(AtomicU8::new(OPEN));
        if self.incoming.push(Box::new(Offer { item, decided: decided.clone() })).is_err() {
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
            if self.outgoing.pop().is_ok() {
                return true;
            }
            std::thread::sleep(WAIT);
        }
        false
    }
}
