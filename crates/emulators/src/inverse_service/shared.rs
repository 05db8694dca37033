//! State shared by the threads of the service.

use std::net::TcpStream;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tungstenite::{Message, WebSocket};

use super::world::World;

/// What the threads of a service share.
pub struct Shared {
    /// What is behind the sockets.
    pub world: Mutex<World>,
    /// Listeners of the channel of events.
    pub listeners: Mutex<Vec<WebSocket<TcpStream>>>,
    /// Sessions of an earlier one end.
    generation: AtomicU64,
    /// Time from a message to its reply.
    pub latency: Duration,
}

/// The lock of what no thread leaves half done.
pub fn locked<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    /// Around a world.
    pub fn new(world: World, latency: Duration) -> Self {
        Self { world: Mutex::new(world), listeners: Mutex::default(), generation: AtomicU64::new(0), latency }
    }

    /// Number that changes when all connections are to end.
    pub fn generation(&self) -> u64 {
        self.generation.load(Ordering::Relaxed)
    }

    /// Ends all connections.
    pub fn drop_connections(&self) {
        self.generation.fetch_add(1, Ordering::Relaxed);
        locked(&self.listeners).clear();
    }

    /// Sends the events of the world to all listeners.
    pub fn send_events(&self) {
        let events = std::mem::take(&mut locked(&self.world).events);
        for event in events {
            let text = event.to_string();
            locked(&self.listeners).retain_mut(|listener| listener.send(Message::text(text.clone())).is_ok());
        }
    }
}
