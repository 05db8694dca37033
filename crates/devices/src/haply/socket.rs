//! Websocket with a timeout on every call.

use std::fmt;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

use tungstenite::http::Uri;
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Message, Utf8Bytes, WebSocket};

/// Longest time for a connection and again for its handshake.
const CONNECT: Duration = Duration::from_millis(1000);
/// Longest time for which a message may fail to leave: nobody takes it from the other end.
const SEND: Duration = Duration::from_millis(100);
/// Largest message that is taken, bytes. A state of five devices has about 5 kB.
const LARGEST_MESSAGE: usize = 256 << 10;
/// Bytes that are read at once.
const BUFFER: usize = 16 << 10;

/// Why the other end cannot be spoken to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SocketError {
    /// Nobody listens there.
    Refused(String),
    /// No answer in time. The connection stands.
    TimedOut,
    /// The connection is gone.
    Closed,
    /// The other end does not speak the protocol, or a message is too large. The connection is of no more use.
    Protocol(String),
}

impl fmt::Display for SocketError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SocketError::Refused(why) => write!(f, "{why}"),
            SocketError::TimedOut => write!(f, "no answer in time"),
            SocketError::Closed => write!(f, "the connection was closed"),
            SocketError::Protocol(why) => write!(f, "{why}"),
        }
    }
}

impl From<tungstenite::Error> for SocketError {
    fn from(error: tungstenite::Error) -> Self {
        use tungstenite::Error as E;
        match error {
            E::Io(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => Self::TimedOut,
            E::Io(_) | E::ConnectionClosed | E::AlreadyClosed => Self::Closed,
            E::Protocol(tungstenite::error::ProtocolError::ResetWithoutClosingHandshake) => Self::Closed,
            other => Self::Protocol(other.to_string()),
        }
    }
}

/// A stream that reads until a moment, however the bytes drip in.
#[derive(Debug)]
struct TimeoutStream {
    stream: TcpStream,
    /// `None` reads what is there and never waits.
    until: Option<Instant>,
}

impl Read for TimeoutStream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let Some(until) = self.until else { return self.stream.read(buffer) };
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(ErrorKind::TimedOut.into());
        }
        self.stream.set_read_timeout(Some(left))?;
        self.stream.read(buffer)
    }
}

impl Write for TimeoutStream {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        self.stream.write(buffer)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A client's end.
pub struct Socket {
    socket: WebSocket<TimeoutStream>,
}

impl Socket {
    /// Connects to the first of the addresses where somebody listens.
    ///
    /// # Errors
    /// Nobody listens, or whoever does speaks no websocket, or not in time.
    pub fn connect(addresses: &[SocketAddr], uri: &Uri) -> Result<Self, SocketError> {
        let mut refused = SocketError::Refused("it has no network address".into());
        for address in addresses {
            match TcpStream::connect_timeout(address, CONNECT) {
                Ok(stream) => return Self::shake_hands(stream, uri),
                Err(error) => refused = SocketError::Refused(error.to_string()),
            }
        }
        Err(refused)
    }

    fn shake_hands(stream: TcpStream, uri: &Uri) -> Result<Self, SocketError> {
        let prepared = stream.set_nodelay(true).and_then(|()| stream.set_write_timeout(Some(SEND)));
        prepared.map_err(|error| SocketError::Protocol(error.to_string()))?;
        let timed = TimeoutStream { stream, until: Some(Instant::now() + CONNECT) };
        let config = WebSocketConfig::default()
            .read_buffer_size(BUFFER)
            .max_message_size(Some(LARGEST_MESSAGE))
            .max_frame_size(Some(LARGEST_MESSAGE));
        match tungstenite::client::client_with_config(uri, timed, Some(config)) {
            Ok((socket, _)) => Ok(Self { socket }),
            Err(tungstenite::HandshakeError::Failure(error)) => Err(error.into()),
            // Only a read that ran out of time would have to go on.
            Err(tungstenite::HandshakeError::Interrupted(_)) => Err(SocketError::TimedOut),
        }
    }

    /// Sends a text.
    ///
    /// # Errors
    /// A connection that is gone or takes nothing: it is of no more use.
    pub fn send(&mut self, text: &str) -> Result<(), SocketError> {
        self.socket.send(Message::text(text)).map_err(|error| match error.into() {
            SocketError::TimedOut => SocketError::Closed,
            other => other,
        })
    }

    /// The next text, waited for until `until`. Binary messages count as an empty one: the service sends none.
    ///
    /// # Errors
    /// None in time, after which one may be waited for again, or a connection of no more use.
    pub fn receive(&mut self, until: Instant) -> Result<Utf8Bytes, SocketError> {
        self.socket.get_mut().until = Some(until);
        loop {
            match self.socket.read()? {
                Message::Text(text) => return Ok(text),
                Message::Binary(_) => return Ok(Utf8Bytes::from_static("")),
                Message::Close(_) => return Err(SocketError::Closed),
                // A flood of pings keeps the stream from running out of time.
                _ if Instant::now() >= until => return Err(SocketError::TimedOut),
                _ => {}
            }
        }
    }

    /// The next text if it is there already.
    ///
    /// # Errors
    /// A connection of no more use.
    pub fn poll(&mut self) -> Result<Option<Utf8Bytes>, SocketError> {
        self.wait_for_nothing(true)?;
        let read = self.socket.read().map_err(SocketError::from);
        self.wait_for_nothing(false)?;
        match read {
            Ok(Message::Text(text)) => Ok(Some(text)),
            Ok(Message::Close(_)) => Err(SocketError::Closed),
            Ok(_) | Err(SocketError::TimedOut) => Ok(None),
            Err(error) => Err(error),
        }
    }

    fn wait_for_nothing(&mut self, nothing: bool) -> Result<(), SocketError> {
        let timed = self.socket.get_mut();
        timed.until = None;
        timed.stream.set_nonblocking(nothing).map_err(|_| SocketError::Closed)
    }

    /// Says goodbye. What the other end still sends is thrown away until it closes too, or until `until`: a connection that is
    /// dropped with bytes unread is reset, and what was sent last may be lost with it.
    pub fn close(mut self, until: Instant) {
        let _ = self.socket.close(None);
        let timed = self.socket.get_mut();
        timed.until = Some(until);
        while matches!(timed.read(&mut [0; BUFFER]), Ok(1..)) {}
    }
}
