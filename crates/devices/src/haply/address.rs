//! Address of the service, with rate, hold time and port of events.

use std::net::{SocketAddr, ToSocketAddrs};
use std::time::Duration;

use tungstenite::http::Uri;

use crate::{Connection, OpenError};

/// Environment variable with the address of connections that name none.
pub const ADDRESS_VARIABLE: &str = "PALPATE_HAPLY_ADDRESS";
/// Where an Inverse Service of 3.1 to 3.5 listens unless its settings say otherwise.
pub const DEFAULT_ADDRESS: &str = "ws://localhost:10001";

const DEFAULT_PORT: u16 = 10001;
/// Channel of events beside the default port (3.4 and later).
const DEFAULT_EVENTS_PORT: u16 = 10020;

/// Exchanges with the service a second unless the address says `?rate=`. Each waits for half a period on average before and
/// after the tick: the delay falls with the rate, the processor time of driver and service rises.
pub const DEFAULT_RATE: f64 = 2000.0;
/// Rates that make sense: below, a tick of 1 kHz would meet the same reading ten times over; above, no service answers.
const RATES: std::ops::RangeInclusive<f64> = 100.0..=10_000.0;

/// Time for which a force stays on the motors when the loop says nothing new, and for which a reply may be late before the force
/// is taken off, ms, unless the address says `?hold=`. Machines and services that pause for longer need more.
pub const DEFAULT_HOLD_MS: u32 = 5;
/// Beyond the longer ones the device is stale anyway.
const HOLDS_MS: std::ops::RangeInclusive<u32> = 1..=50;

/// A parsed address: `ws://host:port?rate=HZ&hold=MS&events=PORT`.
#[derive(Clone, Debug, PartialEq)]
pub struct Address {
    /// For messages and the handshake.
    pub uri: Uri,
    host: String,
    port: u16,
    /// Exchanges a second.
    pub rate: f64,
    /// See [`DEFAULT_HOLD_MS`].
    pub hold: Duration,
    /// Port of the channel of events on the same host; none is known for a service on another port than the default one.
    pub events_port: Option<u16>,
}

impl Address {
    /// Of a connection, the environment, or the default, in this order.
    ///
    /// # Errors
    /// What cannot be understood of it.
    pub fn of(connection: &Connection) -> Result<Self, OpenError> {
        let given = connection.address.clone();
        let text = given.or_else(|| std::env::var(ADDRESS_VARIABLE).ok().filter(|text| !text.is_empty()));
        Self::parse(text.as_deref().unwrap_or(DEFAULT_ADDRESS))
    }

    /// Of a text.
    ///
    /// # Errors
    /// What cannot be understood of it.
    pub fn parse(text: &str) -> Result<Self, OpenError> {
        let refused = |why: &str| {
            OpenError::new(
                format!("the address of the Haply Inverse Service, {text:?}, {why}"),
                format!("write it like {DEFAULT_ADDRESS} or {DEFAULT_ADDRESS}?rate=1000"),
            )
        };
        let full = if text.contains("://") { text.to_string() } else { format!("ws://{text}") };
        let uri: Uri = full.parse().map_err(|_| refused("is no address of a websocket"))?;
        if uri.scheme_str() != Some("ws") {
            return Err(refused("does not begin with ws://"));
        }
        let host = uri.host().filter(|host| !host.is_empty()).ok_or_else(|| refused("names no host"))?;
        let port = match uri.port_u16() {
            Some(port) => port,
            None if uri.authority().is_some_and(|named| named.as_str().ends_with(host)) => DEFAULT_PORT,
            None => return Err(refused("has a port that is none")),
        };
        let host = host.trim_start_matches('[').trim_end_matches(']').to_string();
        let hold = Duration::from_millis(u64::from(DEFAULT_HOLD_MS));
        let mut address = Self { host, port, rate: DEFAULT_RATE, hold, events_port: None, uri: Uri::default() };
        address.events_port = (port == DEFAULT_PORT).then_some(DEFAULT_EVENTS_PORT);
        for pair in uri.query().unwrap_or("").split('&').filter(|pair| !pair.is_empty()) {
            match pair.split_once('=') {
                Some(("rate", value)) => {
                    let rate = value.parse().ok().filter(|rate| RATES.contains(rate));
                    address.rate = rate.ok_or_else(|| refused("asks for a rate outside of 100 to 10000 Hz"))?;
                }
                Some(("hold", value)) => {
                    let hold = value.parse().ok().filter(|hold| HOLDS_MS.contains(hold));
                    let hold: u32 = hold.ok_or_else(|| refused("asks for a hold outside of 1 to 50 ms"))?;
                    address.hold = Duration::from_millis(u64::from(hold));
                }
                Some(("events", value)) => {
                    address.events_port =
                        Some(value.parse().map_err(|_| refused("has a port of events that is none"))?);
                }
                _ => return Err(refused("has a setting other than rate, hold and events")),
            }
        }
        // The service is asked for its root: the settings are the driver's.
        address.uri = address.uri_of_port(port).ok_or_else(|| refused("is no address of a websocket"))?;
        Ok(address)
    }

    /// The channel of events, if a port is known.
    pub fn events(&self) -> Option<Self> {
        let port = self.events_port?;
        Some(Self { uri: self.uri_of_port(port)?, port, events_port: None, ..self.clone() })
    }

    /// Its network addresses. Names are looked up once, for that may take long.
    ///
    /// # Errors
    /// A host that nobody knows.
    pub fn resolve(&self) -> Result<Vec<SocketAddr>, OpenError> {
        let found = (self.host.as_str(), self.port).to_socket_addrs();
        found.map(Iterator::collect).map_err(|error| {
            OpenError::new(
                format!("the host {:?} of the Haply Inverse Service is not known ({error})", self.host),
                format!("correct the address, which is {DEFAULT_ADDRESS} for a service on this machine"),
            )
        })
    }

    fn uri_of_port(&self, port: u16) -> Option<Uri> {
        let host = if self.host.contains(':') { format!("[{}]", self.host) } else { self.host.clone() };
        format!("ws://{host}:{port}/").parse().ok()
    }
}

impl std::fmt::Display for Address {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "ws://{}:{}", self.host, self.port)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Address {
        Address::parse(text).unwrap()
    }

    #[test]
    fn addresses_as_people_write_them() {
        assert_eq!(parsed("localhost:10001"), parsed(DEFAULT_ADDRESS));
        assert_eq!(parsed("ws://localhost"), parsed(DEFAULT_ADDRESS));
        assert_eq!(parsed(DEFAULT_ADDRESS).rate, DEFAULT_RATE);
        assert_eq!(parsed("ws://127.0.0.1:9?rate=1000&events=77").rate, 1000.0);
        assert_eq!(parsed("ws://127.0.0.1:9?rate=1000&events=77").to_string(), "ws://127.0.0.1:9");
        assert_eq!(parsed("ws://[::1]:10001").resolve().unwrap()[0].to_string(), "[::1]:10001");
    }

    #[test]
    fn events_are_looked_for_beside_the_default_port_only() {
        assert_eq!(parsed(DEFAULT_ADDRESS).events().map(|events| events.port), Some(DEFAULT_EVENTS_PORT));
        assert_eq!(parsed("ws://localhost:4000").events(), None);
        assert_eq!(parsed("ws://localhost:4000?events=5").events().map(|events| events.port), Some(5));
    }

    #[test]
    fn mistakes_are_told() {
        for text in [
            "",
            "wss://localhost:10001",
            "http://localhost",
            "ws://",
            "ws://a b",
            "ws://h:99999",
            "ws://h?rate=0",
            "ws://h?rate=NaN",
            "ws://h?speed=3",
            "ws://h?events=x",
            "ws://h?rate",
            "ws://h?hold=0",
            "ws://h?hold=2.5",
        ] {
            let message = Address::parse(text).expect_err(text).to_string();
            assert!(message.contains("ws://localhost:10001"), "{message}");
            assert!(!message.contains('\n'));
        }
    }
}
