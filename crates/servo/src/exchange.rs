//! Two rings between a running loop and another thread: objects made off the tick come in through one, and the
//! ones they replace go out through the other, for memory must not be freed in a tick.
//!
//! Wait-free for both ends. The loop takes an object in only if the outgoing ring has room for the one it replaces.

use rtrb::{Consumer, Producer, RingBuffer};

/// The loop's end.
pub(crate) struct ExchangeEnd<In, Out = In> {
    incoming: Consumer<In>,
    outgoing: Producer<Out>,
}

/// The other threads' end.
pub(crate) struct ExchangeHandle<In, Out = In> {
    incoming: Producer<In>,
    outgoing: Consumer<Out>,
}

/// Both ends, with so many places each way.
pub(crate) fn exchange_ends<In, Out>(places: usize) -> (ExchangeEnd<In, Out>, ExchangeHandle<In, Out>) {
    let (incoming_in, incoming_out) = RingBuffer::new(places);
    let (outgoing_in, outgoing_out) = RingBuffer::new(places);
    let end = ExchangeEnd { incoming: incoming_out, outgoing: outgoing_in };
    (end, ExchangeHandle { incoming: incoming_in, outgoing: outgoing_out })
}

impl<In, Out> ExchangeEnd<In, Out> {
    /// The next that has come in, if there is room to give something back for it; never allocates or frees.
    pub fn take(&mut self) -> Option<In> {
        if self.outgoing.is_full() { None } else { self.incoming.pop().ok() }
    }

    /// Whether what is sent out finds room.
    pub fn has_room(&self) -> bool {
        !self.outgoing.is_full()
    }

    /// Sends something out, once for what was taken.
    pub fn give_back(&mut self, replaced: Out) {
        let _ = self.outgoing.push(replaced);
    }
}

impl<In, Out> ExchangeHandle<In, Out> {
    /// Offers something, after freeing what has come back; whether there was room.
    pub fn offer(&mut self, item: In) -> bool {
        self.free();
        self.incoming.push(item).is_ok()
    }

    /// Frees what has come back; whether there was any.
    pub fn free(&mut self) -> bool {
        std::iter::from_fn(|| self.outgoing.pop().ok()).count() > 0
    }
}
