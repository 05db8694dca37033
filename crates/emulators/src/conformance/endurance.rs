//! Endurance check over many ticks: the tip goes around a circle, the spring follows it, and nothing may be missed.

use std::collections::VecDeque;
use std::f64::consts::TAU;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use glam::DVec3;
use palpate_devices::{Device, DeviceFault, Reading};

use super::rig::Rig;
use super::spring::{PUSH, STIFFNESS, Spring};
use super::{Bench, BenchSlot, Check, CheckResult, Facts, Tip};

/// Ticks for one round of the tip. With a prime number the grid of positions is met everywhere.
const ROUND: usize = 499;

/// A tick that takes longer was suspended by a busy machine: meanwhile a driver may have taken the force off, as it must.
const SUSPENDED: Duration = Duration::from_millis(5);

/// How long.
#[derive(Clone, Copy, Debug)]
pub struct Endurance {
    /// Ticks.
    pub ticks: usize,
    /// As fast as possible, where the device allows it, instead of at 1 kHz.
    pub fast: bool,
}

/// What was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurements {
    /// Ticks, all with a finite reading of the right place and the right force.
    pub ticks: usize,
    /// Time that they took, s.
    pub seconds: f64,
    /// Longest time between two ticks, s.
    pub longest_gap: f64,
    /// Median time of reading and writing in a tick, s.
    pub median_cost: f64,
    /// The same for one tick in a thousand, s.
    pub p999_cost: f64,
}

pub fn checks<B: Bench>() -> Vec<Check<B>> {
    vec![Check { name: "no tick of many is missed", run: many }]
}

/// A minute's worth where nothing limits the rate, else a second and a half: the minute is for [`endure`] by hand.
fn many<B: Bench>(slot: &mut BenchSlot<B>) -> CheckResult {
    let fast = slot.bench().facts().can_run_fast;
    let ticks = if fast { 60_000 } else { 1_500 };
    slot.with_open(|rig| run(rig, Endurance { ticks, fast })).map(|_| ())
}

/// Ticks a device for as long as asked.
///
/// # Errors
/// The first tick that was not right, or a device that does not open.
pub fn endure<B: Bench>(bench: B, endurance: Endurance) -> Result<Measurements, String> {
    BenchSlot(Some(bench)).with_open(|rig| run(rig, endurance))
}

fn run<B: Bench>(rig: &mut Rig<B>, endurance: Endurance) -> Result<Measurements, String> {
    rig.run_fast(endurance.fast);
    let mut round = CircularPath::new(rig.facts, endurance.ticks);
    let figures =
        rig.each_tick(endurance.ticks + 1, move |bench, device, now_ns| match round.tick(bench, device, now_ns) {
            Ok(None) => ControlFlow::Continue(()),
            Ok(Some(figures)) => ControlFlow::Break(Ok(figures)),
            Err(seen) => ControlFlow::Break(Err(seen)),
        });
    rig.run_fast(false);
    figures
}

/// The tip on its way around.
struct CircularPath {
    facts: Facts,
    spring: Spring,
    ticks: usize,
    /// Places of this tick and of the ones before it that may still be told.
    places: VecDeque<DVec3>,
    /// Forces of this tick and of the ones before it that the motors may still have.
    forces: VecDeque<DVec3>,
    costs: Vec<f64>,
    last_stamp: u64,
    last: Option<Instant>,
    began: Instant,
    longest_gap: f64,
}

impl CircularPath {
    fn new(facts: Facts, ticks: usize) -> Self {
        Self {
            facts,
            spring: Spring::to(facts.middle),
            ticks,
            places: VecDeque::with_capacity(facts.late_ticks + 2),
            forces: VecDeque::with_capacity(facts.late_ticks + 2),
            costs: Vec::with_capacity(ticks),
            last_stamp: 0,
            last: None,
            began: Instant::now(),
            longest_gap: 0.0,
        }
    }

    fn tick<B: Bench>(
        &mut self,
        bench: &mut B,
        device: &mut dyn Device,
        now_ns: u64,
    ) -> Result<Option<Measurements>, String> {
        let tick = self.costs.len();
        let now = Instant::now();
        let gap = self.last.map_or(0.0, |last| (now - last).as_secs_f64());
        self.longest_gap = self.longest_gap.max(gap);
        self.last = Some(now);
        let angle = TAU * (tick % ROUND) as f64 / ROUND as f64;
        let offset = PUSH * DVec3::new(angle.cos(), angle.sin(), (2.0 * angle).sin());
        bench.set_tip(Tip::at(offset));
        remember(&mut self.places, self.facts.middle + offset, self.facts.late_ticks);
        let asked = Instant::now();
        let (reading, written) = self.spring.tick(device, now_ns);
        self.costs.push(asked.elapsed().as_secs_f64());
        // Two ticks that far apart are the machine's doing, and the driver is right to say so.
        if reading == Err(DeviceFault::Stale) && gap > self.facts.stale_after.as_secs_f64() {
            self.spring.fault = None;
            return Ok((self.costs.len() == self.ticks).then(|| self.figures()));
        }
        let reading = reading.map_err(|fault| format!("tick {tick}: a fault of a device that is well: {fault}"))?;
        if let Some(fault) = self.spring.fault {
            return Err(format!("tick {tick}: a fault of a device that is well: {fault}"));
        }
        remember(&mut self.forces, written.force, self.facts.late_ticks);
        // What is late at the beginning is from before it.
        if tick > 2 * self.facts.late_ticks {
            let motors = bench.motors().force;
            let suspended = asked.elapsed() > SUSPENDED || gap > SUSPENDED.as_secs_f64();
            self.compare(&reading, motors, suspended).map_err(|seen| format!("tick {tick}: {seen}"))?;
        }
        Ok((self.costs.len() == self.ticks).then(|| self.figures()))
    }

    fn compare(&mut self, reading: &Reading, motors: DVec3, suspended: bool) -> CheckResult {
        let (place, tolerance) = (reading.pose.position, self.facts.position_tolerance);
        if !self.places.iter().any(|known| (*known - place).length() <= tolerance) {
            return Err(format!("the position is {place}, none of {:?} within {tolerance}", self.places));
        }
        let tolerance = self.facts.force_tolerance + STIFFNESS * self.facts.position_tolerance;
        let taken_off = suspended && motors == DVec3::ZERO;
        if !taken_off && !self.forces.iter().any(|force| (*force - motors).length() <= tolerance) {
            return Err(format!("the motors have {motors}, none of {:?} within {tolerance}", self.forces));
        }
        if reading.timestamp_ns < self.last_stamp
            || (self.facts.late_ticks == 0 && reading.timestamp_ns == self.last_stamp)
        {
            return Err(format!("the time stamp {} follows {}", reading.timestamp_ns, self.last_stamp));
        }
        self.last_stamp = reading.timestamp_ns;
        Ok(())
    }

    fn figures(&mut self) -> Measurements {
        self.costs.sort_by(f64::total_cmp);
        let quantile = |share: f64| self.costs[(share * (self.costs.len() - 1) as f64) as usize];
        Measurements {
            ticks: self.costs.len(),
            seconds: self.began.elapsed().as_secs_f64(),
            longest_gap: self.longest_gap,
            median_cost: quantile(0.5),
            p999_cost: quantile(0.999),
        }
    }
}

fn remember(latest: &mut VecDeque<DVec3>, value: DVec3, late_ticks: usize) {
    if latest.len() > late_ticks {
        latest.pop_back();
    }
    latest.push_front(value);
}
