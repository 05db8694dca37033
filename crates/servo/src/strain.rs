//! Requests for strain responses, which the strain limit in the tick needs for every set of contacts.
//!
//! The tick notices that the contacts of a body have changed and puts a request into a ring. The preparing
//! thread computes a response within milliseconds and exchanges it for the previous one. Until then the tick bounds new
//! contacts by a provisional limit.

use std::sync::{Arc, OnceLock};
use std::thread::Thread;

use palpate_core::contact::Patch;
use palpate_core::simulation::{MAX_BODIES, State, StrainWatch};
use palpate_core::strain::MAX_CONTACTS_WATCHED;
use rtrb::{Consumer, Producer, RingBuffer};

use crate::exchange::{ExchangeEnd, ExchangeHandle, exchange_ends};
use crate::record::{IN_FLIGHT, StrainArrivals, StrainRequestId};

/// The contacts of one body, for which strain is to be prepared.
#[derive(Clone)]
#[cfg_attr(not(feature = "strain"), allow(dead_code))] // nobody answers it there
pub(crate) struct StrainRequest {
    pub id: StrainRequestId,
    pub limit: f64,
    pub serials: [u64; MAX_CONTACTS_WATCHED],
    pub patches: [Patch; MAX_CONTACTS_WATCHED],
    pub count: usize,
}

/// What answers a request.
pub(crate) type StrainAnswer = (StrainRequestId, Box<StrainWatch>);

/// The loop's end.
pub(crate) struct StrainEnd {
    requests: Producer<StrainRequest>,
    responses: ExchangeEnd<StrainAnswer, Box<StrainWatch>>,
    /// Key of the latest request of each body.
    latest: [RequestKey; MAX_BODIES],
    /// Requests from before this tick are of no use any more: their contacts are gone.
    since: u64,
    worker: Arc<OnceLock<Thread>>,
}

/// Serials of the contacts of a body, and the limit of its strain.
type RequestKey = ([u64; MAX_CONTACTS_WATCHED], f64);

/// The preparing thread's end.
pub(crate) struct PreparerEnd {
    pub requests: Consumer<StrainRequest>,
    pub responses: ExchangeHandle<StrainAnswer, Box<StrainWatch>>,
    pub worker: Arc<OnceLock<Thread>>,
}

/// Both ends.
pub(crate) fn strain_ends() -> (StrainEnd, PreparerEnd) {
    let (requests_in, requests_out) = RingBuffer::new(IN_FLIGHT);
    let (responses_out, responses_in) = exchange_ends(IN_FLIGHT);
    let worker = Arc::new(OnceLock::new());
    let end = StrainEnd {
        requests: requests_in,
        responses: responses_out,
        latest: Default::default(),
        since: 0,
        worker: worker.clone(),
    };
    (end, PreparerEnd { requests: requests_out, responses: responses_in, worker })
}

impl StrainEnd {
    /// Takes the responses that have arrived, and records their ids; never allocates or frees.
    pub fn receive(&mut self, state: &mut State, arrivals: &mut StrainArrivals) {
        while let Some((id, watch)) = self.responses.take() {
            let replaced = if id.tick < self.since {
                Some(watch)
            } else {
                arrivals.push(id);
                state.watch_strain(id.body, watch)
            };
            replaced.into_iter().for_each(|replaced| self.responses.give_back(replaced));
        }
    }

    /// Begins anew with a state without contacts at a tick.
    pub fn begin(&mut self, tick: u64) {
        (self.since, self.latest) = (tick, Default::default());
    }

    /// Asks in a tick for responses where contacts or the limit have changed, but for the bodies of `skipped`; a bit for each
    /// body whose request finds no room. Never allocates or blocks.
    pub fn ask(&mut self, state: &State, limits: &[f64; MAX_BODIES], tick: u64, skipped: u32) -> u32 {
        let mut unsent = 0;
        let limited = self.latest.iter_mut().zip(limits).enumerate().filter(|(_, (_, limit))| **limit > 0.0);
        for (body, (latest, &limit)) in limited {
            let mut now = ([0; MAX_CONTACTS_WATCHED], limit);
            for (serial, (contact, _)) in now.0.iter_mut().zip(state.contacts.iter().filter(|(c, _)| c.body == body)) {
                *serial = contact.serial;
            }
            if now == *latest || now.0[0] == 0 {
                continue;
            }
            if self.requests.is_full() || skipped & 1 << body != 0 {
                unsent |= 1 << body;
                continue;
            }
            let mut request = StrainRequest {
                id: StrainRequestId { body, tick },
                limit,
                serials: now.0,
                patches: std::array::from_fn(|_| Patch::default()),
                count: 0,
            };
            for (_, patch) in state.contacts.iter().filter(|(c, _)| c.body == body).take(MAX_CONTACTS_WATCHED) {
                request.patches[request.count].copy_from(patch.patch());
                request.count += 1;
            }
            let _ = self.requests.push(request);
            *latest = now;
            if let Some(worker) = self.worker.get() {
                worker.unpark();
            }
        }
        unsent
    }
}
