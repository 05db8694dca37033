//! Higher orders of the displacement of bodies that become known while the loop runs.
//!
//! They are computed beside the loop and come in as a whole for one body and radius. The tick takes them up where they change no
//! force ([`State::may_take_series`]); others wait in the loop until a later tick can.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use palpate_core::memory::Ranges;
use palpate_core::simulation::{KnownSeries, MAX_BODIES, MAX_TOOLS, Model, State};

use crate::exchange::{ExchangeEnd, ExchangeHandle, exchange_ends};

/// Series that may be under way.
const IN_FLIGHT: usize = 16;
/// One for each body and radius.
const MAX_SERIES: usize = MAX_BODIES * MAX_TOOLS;

type Arrival = (usize, Arc<KnownSeries>);

/// The loop's end.
pub(crate) struct SeriesEnd {
    exchange: ExchangeEnd<Arrival, Arc<KnownSeries>>,
    waiting: [Option<Arrival>; MAX_SERIES],
    held: Arc<AtomicBool>,
}

/// The other threads' end.
pub(crate) struct SeriesHandle {
    exchange: ExchangeHandle<Arrival, Arc<KnownSeries>>,
    held: Arc<AtomicBool>,
}

/// Both ends.
pub(crate) fn series_ends() -> (SeriesEnd, SeriesHandle) {
    let (end, exchange) = exchange_ends(IN_FLIGHT);
    let held = Arc::new(AtomicBool::new(false));
    (SeriesEnd { exchange: end, waiting: Default::default(), held: held.clone() }, SeriesHandle { exchange, held })
}

impl SeriesHandle {
    /// Offers the series of a body; whether there was room.
    pub fn offer(&mut self, body: usize, series: Arc<KnownSeries>) -> bool {
        self.exchange.offer((body, series))
    }

    /// Has what is offered wait, or not any more.
    pub fn hold(&mut self, held: bool) {
        self.held.store(held, Ordering::Relaxed);
    }
}

impl SeriesEnd {
    /// Takes up what has arrived, and what has waited, as far as no force changes. Never allocates or frees.
    pub fn receive(&mut self, model: &Model, state: &mut State) {
        while let Some(arrival) = self.exchange.take() {
            let is_same = |old: &Arrival| old.0 == arrival.0 && old.1.radius == arrival.1.radius;
            let place = self.waiting.iter().position(|old| old.as_ref().is_some_and(is_same));
            match place.or_else(|| self.waiting.iter().position(Option::is_none)) {
                Some(place) => {
                    let replaced = self.waiting[place].replace(arrival);
                    replaced.into_iter().for_each(|(_, replaced)| self.exchange.give_back(replaced));
                }
                // More bodies and radii than a model has.
                None => self.exchange.give_back(arrival.1),
            }
        }
        if self.held.load(Ordering::Relaxed) {
            return;
        }
        for place in &mut self.waiting {
            let Some((body, series)) = place else { continue };
            let body = *body;
            if self.exchange.has_room()
                && state.may_take_series(model, body, series)
                && let Some((_, series)) = place.take()
            {
                self.exchange.give_back(state.take_series(body, series));
            }
        }
    }
}

/// The memory of a series that ticks read.
pub(crate) fn memory_of(series: &KnownSeries) -> Ranges {
    let mut ranges = Ranges::default();
    ranges.add(&series.fields);
    ranges
}
