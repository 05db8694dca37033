//! Settings, resets and strikes on their way to the tick, in the order in which they are sent.
//!
//! One bounded ring holds them, wait-free at both ends. A sender that finds it full gets an error: nothing is lost in silence.
//! A tick takes the commands in order up to the first strike, so that a strike is given under the settings that were sent before
//! it. Where the body of a strike has no room for another one, the strike waits, but later settings do not wait for it. A reset
//! takes effect in the next tick and takes back the strikes that were sent before it.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use palpate_core::simulation::{Model, PreviousRanks, State, Strike};
use palpate_core::{Error, Result};
use rtrb::{Consumer, Producer, RingBuffer};

use crate::settings::{Settings, check_body, refuse_unless};

/// Commands that may wait for a tick.
const MAX_PENDING: usize = 1024;
/// Strikes among them, and those that wait for room on their body.
const MAX_PENDING_STRIKES: usize = 64;

#[derive(Clone, Copy)]
enum Command {
    Set(Settings),
    Reset,
    Strike(Strike),
}

/// The loop's end.
pub(crate) struct CommandEnd {
    pending: Consumer<Command>,
    /// Strikes that are next; never more than it has room for.
    strikes: VecDeque<Strike>,
    /// Strikes in the ring and in `strikes`.
    strike_count: Arc<AtomicUsize>,
    /// A reset that came with another scene, for the next tick.
    reset: bool,
}

/// The senders' end.
pub(crate) struct CommandHandle {
    pending: Producer<Command>,
    strike_count: Arc<AtomicUsize>,
}

/// Both ends.
pub(crate) fn command_ends() -> (CommandEnd, CommandHandle) {
    let (sender, pending) = RingBuffer::new(MAX_PENDING);
    let strike_count = Arc::new(AtomicUsize::new(0));
    let strikes = VecDeque::with_capacity(MAX_PENDING_STRIKES);
    let end = CommandEnd { pending, strikes, strike_count: strike_count.clone(), reset: false };
    (end, CommandHandle { pending: sender, strike_count })
}

impl CommandHandle {
    /// Sends settings that have been checked.
    pub fn set(&mut self, settings: Settings) -> Result<()> {
        self.push(Command::Set(settings))
    }

    /// Sends a reset.
    pub fn reset(&mut self) -> Result<()> {
        self.push(Command::Reset)
    }

    /// Sends a strike.
    pub fn strike(&mut self, model: &Model, strike: Strike) -> Result<()> {
        check_body(model, strike.body, "strike")?;
        refuse_unless(self.strike_count.load(Ordering::Relaxed) < MAX_PENDING_STRIKES, || {
            format!("{MAX_PENDING_STRIKES} strikes wait already: the loop gives one a tick, and four at once to a body")
        })?;
        // Counted first: the loop may take it at once.
        self.strike_count.fetch_add(1, Ordering::Relaxed);
        let sent = self.push(Command::Strike(strike));
        if sent.is_err() {
            self.strike_count.fetch_sub(1, Ordering::Relaxed);
        }
        sent
    }

    /// Whether nothing more can be sent until a tick.
    pub fn is_full(&self) -> bool {
        self.pending.is_full()
    }

    fn push(&mut self, command: Command) -> Result<()> {
        let full = |_| Error::Invalid(format!("{MAX_PENDING} changes wait already: the loop does not tick"));
        self.pending.push(command).map_err(full)
    }
}

impl CommandEnd {
    /// Takes the commands of one tick and puts settings in force: whether everything is reset. Never allocates.
    pub fn receive(&mut self, settings: &mut Settings) -> bool {
        let before = std::mem::take(&mut self.reset);
        let Ok(chunk) = self.pending.read_chunk(self.pending.slots()) else { return before };
        let (first, second) = chunk.as_slices();
        let commands = || first.iter().chain(second);
        let resets = commands().enumerate().filter(|(_, command)| matches!(command, Command::Reset));
        // What was sent before the last reset is over.
        let superseded = resets.last().map_or(0, |(rank, _)| rank + 1);
        if superseded > 0 {
            self.strike_count.fetch_sub(self.strikes.len(), Ordering::Relaxed);
            self.strikes.clear();
        }
        let mut taken = 0;
        for command in commands() {
            taken += 1;
            match command {
                Command::Set(sent) => *settings = *sent,
                Command::Reset => {}
                Command::Strike(_) if taken <= superseded => {
                    self.strike_count.fetch_sub(1, Ordering::Relaxed);
                }
                Command::Strike(strike) => {
                    self.strikes.push_back(*strike);
                    break;
                }
            }
        }
        chunk.commit(taken);
        before || superseded > 0
    }

    /// The next strike, if its body has room for it.
    pub fn next_strike(&mut self, state: &State) -> Option<Strike> {
        let strike = *self.strikes.front().filter(|strike| state.has_room_for_strike(strike.body))?;
        self.strikes.pop_front();
        self.strike_count.fetch_sub(1, Ordering::Relaxed);
        Some(strike)
    }

    /// Goes on with another scene, whose settings came with it: strikes follow their bodies, or end with them.
    pub fn remap(&mut self, previous_ranks: &PreviousRanks) {
        while let Ok(command) = self.pending.pop() {
            match command {
                Command::Set(_) => {}
                Command::Reset => {
                    self.reset = true;
                    self.strike_count.fetch_sub(self.strikes.len(), Ordering::Relaxed);
                    self.strikes.clear();
                }
                Command::Strike(strike) => self.strikes.push_back(strike),
            }
        }
        let before = self.strikes.len();
        self.strikes.retain_mut(|strike| {
            let rank = previous_ranks.bodies.iter().position(|&old| old == Some(strike.body));
            rank.map(|rank| strike.body = rank).is_some()
        });
        self.strike_count.fetch_sub(before - self.strikes.len(), Ordering::Relaxed);
    }
}
