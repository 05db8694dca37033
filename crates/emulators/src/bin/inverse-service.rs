//! Haply's Inverse Service for people without hardware: a simulated hand holds each arm, presses down and slides, again and
//! again.

use std::process::ExitCode;
use std::thread;
use std::time::Duration;

use palpate_devices::emulated::{Mechanics, known};
use palpate_emulators::SteeredTip;
use palpate_emulators::inverse_service::{InverseService, Options, Release};

const HELP: &str = "\
Emulates Haply's Inverse Service with Inverse3 arms that a simulated hand moves.

Usage: inverse-service [OPTION VALUE]...

  --port N          port of the websocket (10001)
  --events-port N   port of the channel of events (10020)
  --persona V       release: 3.0, 3.1, 3.4 or 3.5 (3.5)
  --devices N       number of arms, 1 to 4 (1)
  --latency MS      time from a message to its reply, ms (0.2)
  --help            this text

The environment variable PALPATE_EMULATED_HAND leads the hands: \"time x y z; ...\" in s and mm.

Then, in another terminal: PALPATE_HAPLY_ADDRESS=ws://localhost:10001 palpate devices
";

struct Arguments {
    options: Options,
    devices: usize,
}

fn parse(mut arguments: impl Iterator<Item = String>) -> Result<Option<Arguments>, String> {
    let options =
        Options { port: 10001, events_port: 10020, latency: Duration::from_micros(200), ..Options::default() };
    let mut parsed = Arguments { options, devices: 1 };
    while let Some(name) = arguments.next() {
        if name == "--help" {
            return Ok(None);
        }
        let value = arguments.next().ok_or_else(|| format!("{name} needs a value"))?;
        let number = |least: f64, most: f64| match value.parse::<f64>() {
            Ok(number) if (least..=most).contains(&number) => Ok(number),
            _ => Err(format!("{name} takes a number from {least} to {most}, not {value:?}")),
        };
        match name.as_str() {
            "--port" => parsed.options.port = number(0.0, 65535.0)? as u16,
            "--events-port" => parsed.options.events_port = number(0.0, 65535.0)? as u16,
            "--persona" => parsed.options.release = value.parse::<Release>()?,
            "--devices" => parsed.devices = number(1.0, 4.0)? as usize,
            "--latency" => parsed.options.latency = Duration::from_secs_f64(1e-3 * number(0.0, 1e4)?),
            _ => return Err(format!("there is no option {name}")),
        }
    }
    Ok(Some(parsed))
}

/// An arm's tip in its hand. The connection itself is the delay.
fn tip() -> Result<SteeredTip, String> {
    let mechanics = known::mechanics("Inverse3").ok_or("the mechanics of an Inverse3 are not known")?;
    Ok(SteeredTip::in_hand(Mechanics { delay: 0.0, ..mechanics }))
}

fn serve(arguments: &Arguments) -> Result<(), String> {
    let Arguments { options, devices } = arguments;
    let service = InverseService::start(options)
        .map_err(|error| format!("the ports {} and {}: {error}", options.port, options.events_port))?;
    let ids: Vec<String> = (1..=*devices).map(|rank| format!("{:04X}", 0x0A00 + rank)).collect();
    for (rank, id) in ids.iter().enumerate() {
        service.add_arm(id, "inverse3", tip()?);
        service.add_grip(&format!("{}", 61_570 + rank), id);
    }
    println!("Inverse Service {} at {}", options.release.name(), service.address());
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
