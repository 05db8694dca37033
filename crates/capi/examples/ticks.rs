//! Computing time of ticks in a Rust program: `ticks SCENE POSITIONS PASSES`, for `python -m benches tick c`.
//!
//! Positions are ticks x 3 doubles of the first tool. Prints the shortest of the passes, ns a tick.

use std::path::Path;
use std::process::exit;
use std::time::Instant;

use palpate_devices::{Device, DeviceFault, DeviceLimits, Reading, Wrench};
use palpate_scene::Scene;
use palpate_servo::ForceLoop;

const PERIOD: f64 = 1e-3;

/// A tool that goes through positions again and again.
struct Path3 {
    positions: Vec<[f64; 3]>,
    next: usize,
    latest: Reading,
}

impl Device for Path3 {
    fn name(&self) -> &str {
        "path"
    }

    fn read(&mut self, now_ns: u64, _period: f64) -> Result<Reading, DeviceFault> {
        let position = self.positions[self.next % self.positions.len()].into();
        let before = self.latest.pose.position;
        self.latest.twist.linear = if self.next == 0 { glam::DVec3::ZERO } else { (position - before) / PERIOD };
        self.latest.pose = palpate_devices::Pose::at(position);
        (self.latest.active, self.latest.timestamp_ns) = (true, now_ns);
        self.next += 1;
        Ok(self.latest)
    }

    fn write(&mut self, _wrench: Wrench) -> Result<(), DeviceFault> {
        Ok(())
    }

    fn limits(&self) -> DeviceLimits {
        DeviceLimits::UNLIMITED
    }
}

fn measure(scene: &str, positions: &str, passes: usize) -> Result<f64, Box<dyn std::error::Error>> {
    let bytes = std::fs::read(positions)?;
    let numbers: Vec<f64> = bytes.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
    let positions = numbers.as_chunks::<3>().0.to_vec();
    let (ticks, prepared) = (positions.len(), Scene::load(Path::new(scene))?.prepare()?);
    let device = Path3 { positions, next: 0, latest: Reading::default() };
    let (model, limits, settings) = (prepared.model, prepared.limits, prepared.settings);
    let (mut force_loop, mut handle) = ForceLoop::new(model, vec![Box::new(device)], limits, settings)?;
    let _worker = force_loop.limit_strain(&mut handle, prepared.strain)?;
    let mut shortest = f64::INFINITY;
    let mut now_ns = 0;
    for _ in 0..passes {
        let begun = Instant::now();
        for _ in 0..ticks {
            now_ns += 1_000_000;
            force_loop.tick(now_ns, PERIOD);
        }
        let took = begun.elapsed().as_nanos() as f64 / ticks as f64;
        // Another program has kept the processor for a tenth of a second: this pass does not count.
        match handle.latest().status.fault {
            Some(_) => handle.reset()?,
            None => shortest = shortest.min(took),
        }
    }
    if shortest.is_finite() { Ok(shortest) } else { Err("no pass was without a fault".into()) }
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, scene, positions, passes] = &arguments[..] else {
        eprintln!("usage: ticks SCENE POSITIONS PASSES");
        exit(2);
    };
    match measure(scene, positions, passes.parse().unwrap_or(1)) {
        Ok(nanoseconds) => println!("{nanoseconds}"),
        Err(error) => {
            eprintln!("ticks: {error}");
            exit(2);
        }
    }
}
