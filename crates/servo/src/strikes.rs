//! Strikes on their way to the loop, each of them given once.
//!
//! Settings are a state: of several within a tick the latest one counts, and a triple buffer hands it over. Strikes are
//! events: they wait in a bounded ring, in order, and the tick takes one at a time, when its body has room for it. Wait-free
//! for both sides; whoever finds the ring full gets an error, for a strike may not be lost in silence.

use palpate_core::simulation::{Kept, MAX_BODIES, Model, State, Strike};
use palpate_core::{Error, Result};
use rtrb::{Consumer, Producer, RingBuffer};

use crate::settings::check_body;

/// Strikes that may wait for the loop.
const MOST_WAITING: usize = 64;

#[derive(Clone, Copy)]
struct Waiting {
    strike: Strike,
    /// Resets asked for before it: a later one takes it back.
    resets: u32,
}

/// The loop's end.
pub(crate) struct StrikeEnd(Consumer<Waiting>);

/// Everybody else's end.
pub(crate) struct StrikeHandle {
    waiting: Producer<Waiting>,
    resets: u32,
}

/// Both ends, after so many resets.
pub(crate) fn strike_ends(resets: u32) -> (StrikeEnd, StrikeHandle) {
    let (waiting, end) = RingBuffer::new(MOST_WAITING);
    (StrikeEnd(end), StrikeHandle { waiting, resets })
}

impl StrikeHandle {
    /// Strikes from now on come after so many resets.
    pub fn count_resets(&mut self, resets: u32) {
        self.resets = resets;
    }

    pub fn resets(&self) -> u32 {
        self.resets
    }

    /// One more strike.
    pub fn push(&mut self, model: &Model, strike: Strike) -> Result<()> {
        check_body(model, strike.body, "strike")?;
        let full =
            || format!("{MOST_WAITING} strikes wait already: the loop gives one a tick, and four at once to a body");
        let waiting = Waiting { strike, resets: self.resets };
        self.waiting.push(waiting).map_err(|_| Error::Invalid(full()))
    }
}

impl StrikeEnd {
    /// How many wait. To be asked before the settings are read: then those that were set before a strike are in force when
    /// it is given.
    pub fn count(&self) -> usize {
        self.0.slots()
    }

    /// The next of the first `count` strikes, if its body has room for it. Those that a reset has overtaken are left out.
    pub fn next(&mut self, count: usize, resets: u32, state: &State) -> Option<Strike> {
        for _ in 0..count {
            let &Waiting { strike, resets: before } = self.0.peek().ok()?;
            if before == resets && !state.has_room_for_strike(strike.body) {
                return None;
            }
            let _ = self.0.pop();
            if before == resets && strike.body < MAX_BODIES {
                return Some(strike);
            }
        }
        None
    }

    /// Bodies have other ranks from now on; strikes of those that leave are left out.
    pub fn follow(&mut self, kept: &Kept) {
        let Ok(mut waiting) = self.0.read_chunk(self.0.slots()) else { return };
        let (first, second) = waiting.as_mut_slices();
        for waiting in first.iter_mut().chain(second) {
            let body = waiting.strike.body;
            waiting.strike.body = kept.bodies.iter().position(|&old| old == Some(body)).unwrap_or(usize::MAX);
        }
    }
}
