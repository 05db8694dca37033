//! One client of the simulation channel: a full state at first, then one state for each message.

use std::collections::VecDeque;
use std::io::ErrorKind;
use std::net::TcpStream;
use std::thread;
use std::time::{Duration, Instant};

use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, Message, WebSocket};

use super::shared::{Shared, locked};
use super::state::render;
use super::trouble::Trouble;
use crate::priority::be_on_time;

/// Longest time until a client has shaken hands, and for which one may take nothing.
const PATIENCE: Duration = Duration::from_secs(2);
/// Time between two looks at whether the service ends.
const LOOK: Duration = Duration::from_millis(20);
/// Waits shorter than this are slept, for timeouts of sockets are coarse.
const SHORT: Duration = Duration::from_millis(3);
/// Largest message that is taken, bytes.
const LARGEST_MESSAGE: usize = 1 << 20;

/// Serves a client until it goes, or the service does.
pub fn serve(stream: TcpStream, shared: &Shared) {
    let generation = shared.generation();
    let prepared = stream
        .set_nodelay(true)
        .and_then(|()| stream.set_read_timeout(Some(PATIENCE)))
        .and_then(|()| stream.set_write_timeout(Some(PATIENCE)));
    let config = WebSocketConfig::default()
        .read_buffer_size(16 << 10)
        .max_message_size(Some(LARGEST_MESSAGE))
        .max_frame_size(Some(LARGEST_MESSAGE));
    if prepared.is_err() {
        return;
    }
    let Ok(socket) = tungstenite::accept_with_config(stream, Some(config)) else { return };
    be_on_time();
    let number = locked(&shared.world).begin_session();
    Client { socket, number, due: VecDeque::new() }.converse(shared, generation);
    locked(&shared.world).end_session(number);
}

struct Client {
    socket: WebSocket<TcpStream>,
    number: u64,
    /// Messages that are on their way, in order.
    due: VecDeque<(Instant, Message)>,
}

impl Client {
    fn converse(&mut self, shared: &Shared, generation: u64) {
        if !self.reply(shared, None) {
            return;
        }
        while shared.generation() == generation {
            if !self.send_due() {
                return;
            }
            let wait = self.due.front().map_or(LOOK, |(due, _)| due.saturating_duration_since(Instant::now()));
            if !self.due.is_empty() && wait < SHORT {
                thread::sleep(wait);
                continue;
            }
            if self.socket.get_ref().set_read_timeout(Some(wait.clamp(Duration::from_micros(1), LOOK))).is_err() {
                return;
            }
            match self.socket.read() {
                Ok(Message::Text(text)) if !self.reply(shared, Some(&text)) => return,
                Ok(Message::Close(_)) => {
                    let _ = self.socket.flush();
                    return;
                }
                Ok(_) => {}
                Err(Error::Io(error)) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(_) => return locked(&shared.world).note_broken(self.number),
            }
        }
    }

    /// Puts the reply to a message on its way, or the greeting; whether the connection stays.
    fn reply(&mut self, shared: &Shared, text: Option<&str>) -> bool {
        let mut world = locked(&shared.world);
        let full = match text {
            Some(text) => world.take(self.number, text),
            None => true,
        };
        world.advance();
        let (state, trouble) = (render(&world, self.number, full), world.trouble.clone());
        drop(world);
        shared.send_events();
        if trouble == Some(Trouble::Cut) {
            return false;
        }
        let later = trouble.as_ref().map_or(Duration::ZERO, Trouble::delay);
        let due = Instant::now() + shared.latency + later;
        let messages = match &trouble {
            Some(trouble) => trouble.spoil(state),
            None => vec![Message::text(state.to_string())],
        };
        self.due.extend(messages.into_iter().map(|message| (due, message)));
        self.send_due()
    }

    fn send_due(&mut self) -> bool {
        while self.due.front().is_some_and(|(due, _)| *due <= Instant::now()) {
            let Some((_, message)) = self.due.pop_front() else { break };
            if self.socket.send(message).is_err() {
                return false;
            }
        }
        true
    }
}
