//! What the threads of the service share.

use std::net::TcpStream;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tungstenite::{Message, WebSocket};

use super::world::World;

/// Shared by the threads of a service.
pub struct Shared {
    /// What is behind the sockets.
    pub world: Mutex<World>,
    /// Listeners of the channel of events.
    pub listeners: Mutex<Vec<WebSocket<TcpStream>>>,
    /// Sessions of an earlier one end.
    generation: AtomicU64,
    /// Shortest time from a message to its reply, and by how much it may be longer, ns.
    latency_ns: AtomicU64,
    jitter_ns: AtomicU64,
    /// State of the sequence that spreads latencies.
    sequence: AtomicU64,
}

/// The lock of what no thread leaves half done.
pub fn locked<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    /// Around a world.
    pub fn new(world: World, latency: Duration, jitter: Duration) -> Self {
        Self {
            world: Mutex::new(world),
            listeners: Mutex::default(),
            generation: AtomicU64::new(0),
            latency_ns: AtomicU64::new(latency.as_nanos() as u64),
            jitter_ns: AtomicU64::new(jitter.as_nanos() as u64),
            sequence: AtomicU64::new(0),
        }
    }

    /// Number that changes when all connections are to end.
    pub fn generation(&self) -> u64 {
        self.generation.load(Ordering::Relaxed)
    }

    /// Ends all connections.
    pub fn next_generation(&self) {
        self.generation.fetch_add(1, Ordering::Relaxed);
    }

    /// Time to the next reply: evenly spread by the multiples of the golden ratio, the same in every run.
    pub fn latency(&self) -> Duration {
        let step = self.sequence.fetch_add(0x9e37_79b9_7f4a_7c15, Ordering::Relaxed);
        let share = (step >> 11) as f64 / (1_u64 << 53) as f64;
        let jitter = self.jitter_ns.load(Ordering::Relaxed) as f64 * share;
        Duration::from_nanos(self.latency_ns.load(Ordering::Relaxed) + jitter as u64)
    }

    /// Sends the events of the world to whoever listens.
    pub fn send_events(&self) {
        let events = std::mem::take(&mut locked(&self.world).events);
        for event in events {
            let text = event.to_string();
            locked(&self.listeners).retain_mut(|listener| listener.send(Message::text(text.clone())).is_ok());
        }
    }
}
