//! Requirements on every driver, checked against its emulated device.
//!
//! A driver's tests implement [`Bench`] and call [`assert_conforms`]. The suite plays the person (puts the tip somewhere, moves
//! it, presses buttons), the hardware's bad days ([`Disturbance`]) and the force loop, and compares what the driver says with
//! what was done to the tip, and what the motors got with what the loop put out.
//!
//! Everything is in the terms of the person in front of the device: x right, y away, z up; m, N, N m, rad.

mod bench;
mod endurance;
mod faults;
#[cfg(test)]
mod flaws;
#[cfg(test)]
mod ideal;
mod readings;
mod rig;
mod spring;
mod stalls;
mod wrenches;

pub use bench::{Bench, Disturbance, Facts};
pub use endurance::{Endurance, Measurements, endure};

use crate::tip::Tip;
use rig::Rig;
use stalls::StallWatch;

/// One thing that a driver must do. Fails with what was seen instead.
pub struct Check<B: Bench> {
    /// What it checks.
    pub name: &'static str,
    run: fn(&mut BenchSlot<B>) -> CheckResult,
}

/// Passed, or what was seen instead.
type CheckResult = Result<(), String>;

/// The bench between checks, when no driver has it.
struct BenchSlot<B: Bench>(Option<B>);

impl<B: Bench> BenchSlot<B> {
    fn bench(&mut self) -> &mut B {
        self.0.as_mut().expect("the bench is here between checks")
    }

    /// Opens the driver, gives it to `check`, and closes it.
    fn with_open<R>(&mut self, check: impl FnOnce(&mut Rig<B>) -> Result<R, String>) -> Result<R, String> {
        let bench = self.0.take().expect("the bench is here between checks");
        let (bench, result) = match Rig::open(bench) {
            Ok(mut rig) => {
                let result = check(&mut rig);
                (rig.close(), result)
            }
            Err((bench, error)) => (bench, Err(format!("does not open: {error}"))),
        };
        self.0 = Some(bench);
        result
    }
}

/// All checks, in the order in which they are worth reading.
pub fn checks<B: Bench>() -> Vec<Check<B>> {
    let mut all = Vec::new();
    all.extend(readings::checks());
    all.extend(wrenches::checks());
    all.extend(endurance::checks());
    all.extend(faults::checks());
    all
}

/// How often a check is run that fails while the machine stalls.
const MOST_RUNS: usize = 5;

/// Runs every check; the names of those that fail, with what was seen. One that fails while the machine stalls is run again: of
/// a driver's thread that got no time it tells nothing.
pub fn failures<B: Bench>(bench: B) -> Vec<(&'static str, String)> {
    let mut slot = BenchSlot(Some(bench));
    let mut failures = Vec::new();
    for check in checks::<B>() {
        for run in 1..=MOST_RUNS {
            let watch = StallWatch::begin();
            let verdict = (check.run)(&mut slot);
            let stalled = watch.end();
            slot.bench().disturb(None);
            slot.bench().set_tip(Tip::default());
            match verdict {
                Ok(()) => break,
                Err(_) if stalled && run < MOST_RUNS => (),
                Err(seen) => {
                    failures.push((check.name, seen));
                    break;
                }
            }
        }
    }
    failures
}

/// Runs every check.
///
/// # Panics
/// When one fails: with all that did.
pub fn assert_conforms<B: Bench>(bench: B) {
    let failures = failures(bench);
    let lines: Vec<String> = failures.iter().map(|(name, seen)| format!("  {name}: {seen}")).collect();
    assert!(failures.is_empty(), "the driver does not conform:\n{}", lines.join("\n"));
}
