//! One client of the simulation channel: a full state at first, then one state for each message.

use std::collections::VecDeque;
use std::io::ErrorKind;
use std::net::TcpStream;
use std::thread;
use std::time::{Duration, Instant};

use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, Message, WebSocket};

use super::reply_flaw::ReplyFlaw;
use super::shared::{Shared, locked};
use super::state::render;
use crate::priority::request_realtime;

/// Longest time until a client has shaken hands, and for which one may take nothing.
const TIMEOUT: Duration = Duration::from_secs(2);
/// Time between two looks at whether the service ends.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Waits shorter than this are slept, for timeouts of sockets are coarse.
const SHORT: Duration = Duration::from_millis(3);
/// Largest message that is taken, bytes.
const LARGEST_MESSAGE: usize = 1 << 20;

/// Serves a client until it goes, or the service does.
pub fn serve(stream: TcpStream, shared: &Shared) {
    let generation = shared.generation();
    let prepared = stream
        .set_nodelay(true)
        .and_then(|()| stream.set_read_timeout(Some(TIMEOUT)))
        .and_then(|()| stream.set_write_timeout(Some(TIMEOUT)));
    let config = WebSocketConfig::default()
        .read_buffer_size(16 << 10)
        .max_message_size(Some(LARGEST_MESSAGE))
        .max_frame_size(Some(LARGEST_MESSAGE));
    if prepared.is_err() {
        return;
    }
    let Ok(socket) = tungstenite::accept_with_config(stream, Some(config)) else { return };
    request_realtime();
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
            let wait = self.due.front().map_or(POLL_INTERVAL, |(due, _)| due.saturating_duration_since(Instant::now()));
            if !self.due.is_empty() && wait < SHORT {
                thread::sleep(wait);
                continue;
            }
            if self
                .socket
                .get_ref()
                .set_read_timeout(Some(wait.clamp(Duration::from_micros(1), POLL_INTERVAL)))
                .is_err()
            {
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
        let (state, reply_flaw) = (render(&world, self.number, full), world.reply_flaw.clone());
        drop(world);
        shared.send_events();
        if reply_flaw == Some(ReplyFlaw::Cut) {
            return false;
        }
        let later = reply_flaw.as_ref().map_or(Duration::ZERO, ReplyFlaw::delay);
        let due = Instant::now() + shared.latency + later;
        let messages = match &reply_flaw {
            Some(reply_flaw) => reply_flaw.apply(state),
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
