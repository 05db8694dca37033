//! Finding arms and opening one.

use std::thread;
use std::time::{Duration, Instant};

use triple_buffer::triple_buffer;

use super::client::Client;
use super::device::Haply;
use super::handoff::{Clock, ForceRequest, PublishedReading};
use super::output::MAX_FORCE;
use super::service::Service;
use super::snapshot::{Arm, Snapshot};
use super::socket::Socket;
use crate::{Connection, DeviceLimits, FoundDevice, Listing, OpenError, Reading, ReadyDevice, known};

/// Exchanges by which the delay is measured before the first tick.
const TRIALS: usize = 64;
/// Longest time until the service knows that another session has ended.
const RELEASE: Duration = Duration::from_millis(500);
/// Longest time for the trials.
const LONGEST_TRIAL: Duration = Duration::from_millis(1500);

/// The arms that the service has.
pub fn list(connection: &Connection) -> Listing {
    let connected = Service::of(connection).and_then(|service| {
        let (socket, snapshot) = service.connect()?;
        socket.close(Instant::now());
        Ok((service, snapshot))
    });
    let (service, snapshot) = match connected {
        Ok(connected) => connected,
        Err(missing) => return Listing { found: Vec::new(), missing: Some(missing), facts: Vec::new() },
    };
    let grips = if snapshot.grips.is_empty() { "none".to_string() } else { snapshot.grips.join(", ") };
    let dialect = if snapshot.has_session { "3.5 or later" } else { "3.1 to 3.4" };
    let facts =
        vec![("service", service.address.to_string()), ("messages of version", dialect.to_string()), ("grips", grips)];
    let limits = limits(service.address.rate, 0.0);
    let missing = snapshot.arms.is_empty().then(|| no_arm(&service));
    let found = snapshot.arms.into_iter().map(|arm| found(arm, limits)).collect();
    Listing { found, missing, facts }
}

fn found(arm: Arm, limits: DeviceLimits) -> FoundDevice {
    FoundDevice { id: arm.id, name: arm.model, limits, obstacle: arm.obstacle, facts: arm.facts }
}

/// Opens the arm of the connection, or the first one that is free, and measures its delay.
///
/// # Errors
/// No service, no such arm, or one that cannot be used now.
pub fn open(connection: &Connection) -> Result<ReadyDevice, OpenError> {
    let service = Service::of(connection)?;
    let (socket, snapshot, arm) = find(&service, connection.id.as_deref())?;
    let hold = service.address.hold;
    let (name, rate) = (format!("{} {}", arm.model, arm.id), service.address.rate);
    let clock = Clock::start();
    let (to_loop, from_thread) = triple_buffer(&PublishedReading::new(Reading::default()));
    let (to_thread, from_loop) = triple_buffer(&ForceRequest::default());
    let mut client = Client::new(service, socket, (arm, &snapshot), clock, (to_loop, from_loop));
    let delay = measure_delay(&mut client, &name)? + 1.0 / rate;
    let stop = client.stop.clone();
    let thread = thread::Builder::new().name("haply".into()).spawn(move || client.run()).map_err(|error| {
        OpenError::new(format!("the system gives no thread for the {name} ({error})"), "close other programs")
    })?;
    let device = Haply::new((name, limits(rate, delay)), (clock, hold), (from_thread, to_thread), (stop, thread));
    Ok(ReadyDevice { device: Box::new(device), scheduler: None })
}

/// What an arm at the end of a service can render. A measurement waits for half a period of the exchanges on average until the
/// loop meets it, and the force for another half until it is sent.
fn limits(rate: f64, delay: f64) -> DeviceLimits {
    DeviceLimits { max_force: MAX_FORCE, delay, rate: Some(rate), ..known::INVERSE3 }
}

fn no_arm(service: &Service) -> OpenError {
    OpenError::new(
        format!("the Haply Inverse Service at {} runs, but has no Inverse3 or Minverse", service.address),
        "connect one by USB and switch it on; on Linux its serial port must be readable (group dialout)",
    )
}

/// Connects and chooses; waits for an arm that somebody has just let go of, for the service may not know it yet.
fn find(service: &Service, id: Option<&str>) -> Result<(Socket, Snapshot, Arm), OpenError> {
    let began = Instant::now();
    loop {
        let (socket, snapshot) = service.connect()?;
        let arm = choose(service, &snapshot, id)?;
        match arm.obstacle.clone() {
            None => return Ok((socket, snapshot, arm)),
            Some(_) if arm.is_in_use && began.elapsed() < RELEASE => thread::sleep(RELEASE / 10),
            Some(obstacle) => return Err(obstacle),
        }
    }
}

fn choose(service: &Service, snapshot: &Snapshot, id: Option<&str>) -> Result<Arm, OpenError> {
    let arms = &snapshot.arms;
    let free = || arms.iter().find(|arm| arm.obstacle.is_none()).or(arms.first());
    let chosen = match id {
        Some(id) => arms.iter().find(|arm| arm.id.eq_ignore_ascii_case(id)),
        None => free(),
    };
    let arm = chosen.ok_or_else(|| match id {
        Some(id) if !arms.is_empty() => {
            let known: Vec<&str> = arms.iter().map(|arm| arm.id.as_str()).collect();
            let what = format!("the Haply Inverse Service at {} has no device {id:?}", service.address);
            OpenError::new(what, format!("it has {}", known.join(", ")))
        }
        _ => no_arm(service),
    })?;
    Ok(arm.clone())
}

/// Exchanges without force: the median time from a message to its reply, s.
fn measure_delay(client: &mut Client, name: &str) -> Result<f64, OpenError> {
    let began = Instant::now();
    let mut times = Vec::with_capacity(TRIALS);
    while times.len() < TRIALS && began.elapsed() < LONGEST_TRIAL {
        let exchanged = client.exchange();
        let refused = match (&exchanged, client.published.fault) {
            (Err(error), _) => Some(error.to_string()),
            (_, fault) => fault.map(|fault| fault.to_string()),
        };
        if let Some(why) = refused {
            let advice = "look at the device and its service in the Haply Hub, then open it again";
            return Err(OpenError::new(format!("the {name} gives no measurements ({why})"), advice));
        }
        times.push(client.round_trip);
        client.wait_until_due();
    }
    times.sort_unstable();
    Ok(times[times.len() / 2].as_secs_f64())
}
