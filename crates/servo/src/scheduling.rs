//! How the loop's own thread runs: its rate, the processors it keeps to, its priority, and memory that is never swapped out.

use palpate_core::Result;
use palpate_core::memory::Ranges;

use crate::log::RealtimeStatus;
use crate::platform::{allowed_cpus, keep_to_cpus, lock, lock_thread, request_realtime_priority};
use crate::settings::refuse_unless;

/// Rates that the thread can keep, Hz.
const RATES: std::ops::RangeInclusive<f64> = 100.0..=10_000.0;
/// Priorities of `SCHED_FIFO`, and 0 for ordinary scheduling.
const PRIORITIES: std::ops::RangeInclusive<u8> = 0..=99;

/// How the loop's own thread runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Scheduling {
    /// Ticks a second, 100 to 10000 Hz.
    pub rate: f64,
    /// Processors that the thread keeps to, by their numbers; none for any that the process has.
    pub cpus: Vec<usize>,
    /// Priority under `SCHED_FIFO`, 1 to 99, as far as the system grants it; 0 does not ask for one.
    pub priority: u8,
}

impl Scheduling {
    /// What is asked for by default. Above the threads of interrupts (50), below the kernel's own
    /// migration and watchdog threads (99): a tick that never ends must leave those a chance.
    pub const DEFAULT_PRIORITY: u8 = 80;

    /// At a rate, Hz, with the priority by default and on any processor.
    pub fn at(rate: f64) -> Self {
        Self { rate, cpus: Vec::new(), priority: Self::DEFAULT_PRIORITY }
    }

    /// Refuses what the loop or this process cannot have. The system would take a set of processors of which it has
    /// some, and leave out the others without a word.
    ///
    /// # Errors
    /// A rate or a priority out of range; a processor that there is not, or that this process may not run on.
    pub fn check(&self) -> Result<()> {
        let (rate, priority) = (self.rate, self.priority);
        refuse_unless(RATES.contains(&rate), || {
            format!("the loop ticks at {} to {} Hz, got {rate}", RATES.start(), RATES.end())
        })?;
        refuse_unless(PRIORITIES.contains(&priority), || {
            format!("device.priority: must be 1 to {}, or 0 for ordinary scheduling, got {priority}", PRIORITIES.end())
        })?;
        let allowed = allowed_cpus();
        for &cpu in &self.cpus {
            refuse_unless(allowed.contains(&cpu), || {
                format!(
                    "device.cpus: this process may not run on CPU {cpu}, only on {}; choose among them, or widen its set \
                     ('taskset', cgroup cpuset)",
                    ranges(&allowed)
                )
            })?;
        }
        Ok(())
    }

    /// Gives the calling thread what was asked for, and keeps in memory what it reads; what the system granted.
    ///
    /// # Errors
    /// A processor that has been taken from the process since it was checked.
    pub(crate) fn apply(&self, memory: Ranges) -> Result<RealtimeStatus> {
        let bound = self.cpus.is_empty() || keep_to_cpus(&self.cpus);
        refuse_unless(bound, || format!("device.cpus: the system refused CPUs {}", ranges(&self.cpus)))?;
        // Locked first: at real-time priority it would keep other programs from the processor for a tenth of a second.
        let locked_memory = lock(memory) && lock_thread();
        let priority = self.priority > 0 && request_realtime_priority(self.priority);
        Ok(RealtimeStatus { priority, locked_memory })
    }
}

/// Sorted numbers as ranges: `0-3,6`.
fn ranges(numbers: &[usize]) -> String {
    let mut sorted = numbers.to_vec();
    sorted.sort_unstable();
    let runs = sorted.chunk_by(|a, b| a + 1 == *b);
    let texts = runs.map(|run| match run {
        [one] => one.to_string(),
        _ => format!("{}-{}", run[0], run[run.len() - 1]),
    });
    texts.collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_told_as_ranges() {
        for (numbers, text) in
            [(vec![], ""), (vec![3], "3"), (vec![2, 0, 1], "0-2"), (vec![0, 1, 5, 7, 8], "0-1,5,7-8")]
        {
            assert_eq!(ranges(&numbers), text);
        }
    }

    #[test]
    fn what_cannot_be_had_is_refused() {
        let check = |scheduling: Scheduling| scheduling.check().map_err(|error| error.to_string());
        assert_eq!(check(Scheduling::at(1000.0)), Ok(()));
        let beyond = Scheduling { cpus: vec![100_000], ..Scheduling::at(1000.0) };
        assert!(check(beyond).is_err_and(|error| error.contains("device.cpus") && error.contains("CPU 100000")));
        let steep = Scheduling { priority: 100, ..Scheduling::at(1000.0) };
        assert!(check(steep).is_err_and(|error| error.contains("device.priority")));
        assert!(check(Scheduling::at(50.0)).is_err_and(|error| error.contains("100 to 10000 Hz")));
    }

    #[test]
    fn a_thread_keeps_to_its_processors() {
        let all = allowed_cpus();
        let last = *all.last().expect("a processor");
        let thread_end = std::thread::spawn(move || {
            let scheduling = Scheduling { cpus: vec![last], priority: 0, ..Scheduling::at(1000.0) };
            (scheduling.apply(Ranges::default()).map(|granted| granted.priority).ok(), allowed_cpus())
        });
        assert_eq!(thread_end.join().expect("a thread that ends"), (Some(false), vec![last]));
        assert_eq!(allowed_cpus(), all, "other threads stay where they are");
    }
}
