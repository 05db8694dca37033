//! Haply's Inverse Service for people without hardware: a simulated hand holds each arm, presses down and slides, again and
//! again.

use std::process::ExitCode;
use std::thread;
use std::time::Duration;

use glam::DVec3;
use palpate_devices::emulated::{Hand, Mechanics, Tip, Wanted, Waypoint, known};
use palpate_emulators::inverse_service::{GripKind, InverseService, Options, Persona};

const HELP: &str = "\
Emulates Haply's Inverse Service with Inverse3 arms that a simulated hand moves.

Usage: inverse-service [OPTION VALUE]...

  --port N          port of the websocket (10001)
  --events-port N   port of the channel of events (10020)
  --persona V       release: 3.0, 3.1, 3.4 or 3.5 (3.5)
  --devices N       number of arms, 1 to 4 (1)
  --hand NAME       press: presses and slides for ever; rest: stays; none: nobody holds the arm (press)
  --depth M         how deep it presses below the middle of the workspace, m (0.02)
  --latency MS      shortest time from a message to its reply, ms (0.2)
  --jitter MS       by how much longer it may take, ms (0)
  --idle MS         time after which a force that is not repeated ends, ms (100)
  --help            this text

Then, in another terminal: PALPATE_HAPLY_ADDRESS=ws://localhost:10001 palpate devices
";

/// Rounds of pressing and sliding that a hand knows in advance; a round lasts 4 s.
const ROUNDS: usize = 10_000;
/// Time of a movement from one place to the next, s.
const MOVEMENT: f64 = 0.8;
/// How far the hand slides, m.
const SLIDE: f64 = 0.03;

struct Arguments {
    options: Options,
    devices: usize,
    hand: String,
    depth: f64,
}

fn parse(mut arguments: impl Iterator<Item = String>) -> Result<Option<Arguments>, String> {
    let options =
        Options { port: 10001, events_port: 10020, latency: Duration::from_micros(200), ..Options::default() };
    let mut parsed = Arguments { options, devices: 1, hand: "press".into(), depth: 0.02 };
    while let Some(name) = arguments.next() {
        if name == "--help" {
            return Ok(None);
        }
        let value = arguments.next().ok_or_else(|| format!("{name} needs a value"))?;
        let number = |least: f64, most: f64| match value.parse::<f64>() {
            Ok(number) if (least..=most).contains(&number) => Ok(number),
            _ => Err(format!("{name} takes a number from {least} to {most}, not {value:?}")),
        };
        let milliseconds = || number(0.0, 1e4).map(|ms| Duration::from_secs_f64(1e-3 * ms));
        match name.as_str() {
            "--port" => parsed.options.port = number(0.0, 65535.0)? as u16,
            "--events-port" => parsed.options.events_port = number(0.0, 65535.0)? as u16,
            "--persona" => parsed.options.persona = value.parse::<Persona>()?,
            "--devices" => parsed.devices = number(1.0, 4.0)? as usize,
            "--hand" if ["press", "rest", "none"].contains(&value.as_str()) => parsed.hand = value,
            "--hand" => return Err(format!("--hand is press, rest or none, not {value:?}")),
            "--depth" => parsed.depth = number(0.0, 0.1)?,
            "--latency" => parsed.options.latency = milliseconds()?,
            "--jitter" => parsed.options.jitter = milliseconds()?,
            "--idle" => parsed.options.idle_timeout = milliseconds()?,
            _ => return Err(format!("there is no option {name}")),
        }
    }
    Ok(Some(parsed))
}

/// Above the body, down, along it, up, and back.
fn presses_and_slides(depth: f64) -> Wanted {
    let (above, below) = (0.5 * depth * DVec3::Z, -depth * DVec3::Z);
    let aside = SLIDE * DVec3::X;
    let places = [above, below, below + aside, above + aside, above];
    let waypoint = |rank: usize| Waypoint { time: MOVEMENT * rank as f64, position: places[rank % places.len()] };
    Wanted::Along((0..ROUNDS * places.len()).map(waypoint).collect())
}

fn tip(hand: &str, depth: f64) -> Result<Tip, String> {
    // The connection itself is the delay.
    let mechanics = known::mechanics("Inverse3").ok_or("the mechanics of an Inverse3 are not known")?;
    let mechanics = Mechanics { delay: 0.0, ..mechanics };
    let hand = match hand {
        "press" => Some(Hand::loose(presses_and_slides(depth))),
        "rest" => Some(Hand::loose(Wanted::At(DVec3::ZERO))),
        _ => None,
    };
    Ok(Tip::new(mechanics, DVec3::ZERO, hand))
}

fn serve(arguments: &Arguments) -> Result<(), String> {
    let Arguments { options, devices, hand, depth } = arguments;
    let service = InverseService::start(options)
        .map_err(|error| format!("the ports {} and {}: {error}", options.port, options.events_port))?;
    let ids: Vec<String> = (1..=*devices).map(|rank| format!("{:04X}", 0x0A00 + rank)).collect();
    for (rank, id) in ids.iter().enumerate() {
        service.add_arm(id, "inverse3", tip(hand, *depth)?);
        service.add_grip(&format!("{}", 61_570 + rank), GripKind::Wireless, id);
    }
    println!("Inverse Service {} at {}", options.persona.name(), service.address());
    let mut before = 0;
    loop {
        thread::sleep(Duration::from_secs(2));
        let messages = service.messages();
        if messages != before {
            let forces: Vec<String> = ids.iter().map(|id| format!("{id} {:.2} N", service.motors(id).force)).collect();
            println!("{:.0} messages/s, forces {}", 0.5 * (messages - before) as f64, forces.join(", "));
        }
        before = messages;
        for complaint in service.take_complaints() {
            println!("not taken: {complaint}");
        }
    }
}

fn main() -> ExitCode {
    match parse(std::env::args().skip(1)) {
        Ok(None) => {
            print!("{HELP}");
            ExitCode::SUCCESS
        }
        Ok(Some(arguments)) => match serve(&arguments) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("inverse-service: {error}");
                ExitCode::from(2)
            }
        },
        Err(error) => {
            eprintln!("inverse-service: {error}; --help shows the options");
            ExitCode::from(2)
        }
    }
}
