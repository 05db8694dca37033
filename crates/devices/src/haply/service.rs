//! Connection to the service, and reconnection.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use super::address::Address;
use super::fault::ReplyFault;
use super::safety_events::SafetyEvents;
use super::snapshot::Snapshot;
use super::socket::{Socket, SocketError};
use crate::{Connection, OpenError};

/// Longest time until the service greets.
const GREETING_TIMEOUT: Duration = Duration::from_millis(1000);

/// Where it is, looked up once.
pub struct Service {
    /// As it was given.
    pub address: Address,
    addresses: Vec<SocketAddr>,
    events: Option<(Vec<SocketAddr>, Address)>,
}

impl Service {
    /// Of a connection.
    ///
    /// # Errors
    /// An address that cannot be understood or that nobody knows.
    pub fn of(connection: &Connection) -> Result<Self, OpenError> {
        let address = Address::of(connection)?;
        let addresses = address.resolve()?;
        let events = address.events().and_then(|events| Some((events.resolve().ok()?, events)));
        Ok(Self { address, addresses, events })
    }

    /// Connects and takes the greeting.
    ///
    /// # Errors
    /// Nobody there, or nobody who speaks as a service of 3.1 to 3.5 does.
    pub fn connect(&self) -> Result<(Socket, Snapshot), OpenError> {
        let mut socket =
            Socket::connect(&self.addresses, &self.address.uri).map_err(|error| self.connect_error(&error))?;
        let greeting = socket.receive(Instant::now() + GREETING_TIMEOUT).map_err(|error| self.connect_error(&error))?;
        let snapshot = Snapshot::parse(&greeting).map_err(|fault| self.protocol_error(fault))?;
        Ok((socket, snapshot))
    }

    /// The channel of events for an arm.
    pub fn safety_events(&self, id: &str) -> SafetyEvents {
        let channel = self.events.as_ref().map(|(addresses, address)| (addresses.as_slice(), &address.uri));
        SafetyEvents::connect(channel, id)
    }

    /// Why there is nobody.
    pub fn connect_error(&self, error: &SocketError) -> OpenError {
        let (address, who) = (&self.address, "Haply Inverse Service");
        match error {
            SocketError::Refused(why) => OpenError::new(
                format!("no {who} listens at {address} ({why})"),
                "install it with the Haply Hub, start it, or set PALPATE_HAPLY_ADDRESS to where it listens",
            ),
            SocketError::TimedOut => OpenError::new(
                format!("what listens at {address} does not answer in time"),
                format!("restart the {who}, or set PALPATE_HAPLY_ADDRESS to where it listens"),
            ),
            error => OpenError::new(
                format!("what listens at {address} does not speak as the {who} does ({error})"),
                "set PALPATE_HAPLY_ADDRESS to where it listens: port 10001 unless its settings say otherwise",
            ),
        }
    }

    fn protocol_error(&self, fault: ReplyFault) -> OpenError {
        let address = &self.address;
        match fault {
            ReplyFault::Dialect => OpenError::new(
                format!("the Haply Inverse Service at {address} speaks the messages of 3.0"),
                "update it to 3.1 or later with the Haply Hub; a later one listens at port 10001",
            ),
            _ => OpenError::new(
                format!("what listens at {address} does not greet as a Haply Inverse Service of 3.1 to 3.5 does"),
                "set PALPATE_HAPLY_ADDRESS to where it listens, or update it with the Haply Hub",
            ),
        }
    }
}
