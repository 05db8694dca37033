//! Figures, by hand: `cargo test --release -p palpate-emulators --test haply figures -- --ignored --nocapture`.

use std::f64::consts::TAU;
use std::time::{Duration, Instant};

use glam::DVec3;
use palpate_devices::haply::open;
use palpate_devices::{Connection, Wrench};
use palpate_emulators::Tip;
use palpate_emulators::inverse_service::Release;

use super::{ARM, alone, service};

const SECONDS: f64 = 10.0;
/// Of the tip whose place tells the time, m/s.
const SPEED: f64 = 0.01;
/// Between the forces of two ticks, rad: the last one has not come round.
const ANGLE: f64 = 5e-4;

/// What exchanges cost and how late they make a loop of 1 kHz, by their rate.
#[test]
#[ignore = "takes a minute"]
fn delay_and_cost_by_rate() {
    let _alone = alone();
    for rate in [500, 1000, 2000, 3000, 4000, 8000] {
        let service = service(Release::V35);
        let address = format!("{}&rate={rate}", service.address());
        let mut device = open(&Connection { address: Some(address), ..Connection::default() }).expect("opens").device;
        let began = Instant::now();
        service.set_tip(ARM, Tip { velocity: SPEED * DVec3::Z, ..Tip::at(DVec3::ZERO) });
        let (mut ages, mut written) = (Vec::new(), Vec::new());
        let (mut due, mut faults) = (Instant::now(), 0);
        let (messages, spent) = (service.messages(), driver_time());
        service.take_changes(ARM);
        while began.elapsed().as_secs_f64() < SECONDS {
            match device.read(0, 1e-3) {
                Ok(reading) => ages.push(began.elapsed().as_secs_f64() - reading.pose.position.z / SPEED),
                Err(_) => faults += 1,
            }
            // The direction tells the tick, also of a force that comes back gently.
            let angle = ANGLE * written.len() as f64;
            let force = DVec3::new(angle.cos(), angle.sin(), 0.0);
            written.push(Instant::now());
            let _ = device.write(Wrench { force, ..Wrench::default() });
            due = (due + Duration::from_millis(1)).max(Instant::now());
            std::thread::sleep(due - Instant::now().min(due));
        }
        let seconds = began.elapsed().as_secs_f64();
        let (messages, spent) = (service.messages() - messages, driver_time() - spent);
        let forces = service.take_changes(ARM).into_iter().filter(|change| change.force != DVec3::ZERO);
        let late = forces.map(|change| {
            let angle = change.force.y.atan2(change.force.x).rem_euclid(TAU);
            (change.at - written[(angle / ANGLE).round() as usize]).as_secs_f64()
        });
        println!(
            "{rate} Hz: {:.0} exchanges/s, {:.1} % of a core, stated delay {:.3} ms; measured: readings {}, forces {} ms late; \
             {faults} faults",
            messages as f64 / seconds,
            100.0 * spent / seconds,
            1e3 * device.limits().delay,
            median_and_tail(ages),
            median_and_tail(late.collect()),
        );
    }
}

fn median_and_tail(mut times: Vec<f64>) -> String {
    times.sort_by(f64::total_cmp);
    let quantile = |share: f64| 1e3 * times.get((share * times.len() as f64) as usize).copied().unwrap_or(f64::NAN);
    format!("{:.3} (99.9 %: {:.3})", quantile(0.5), quantile(0.999))
}

/// Processor time of the driver's threads, s.
fn driver_time() -> f64 {
    let threads = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let of_driver = threads.filter(|thread| {
        std::fs::read_to_string(thread.path().join("comm")).is_ok_and(|name| name.trim_end() == "haply")
    });
    let time_ns = of_driver.filter_map(|thread| {
        let text = std::fs::read_to_string(thread.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse::<f64>().ok()
    });
    1e-9 * time_ns.sum::<f64>()
}
