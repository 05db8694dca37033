//! Status and log row of a tick.

use glam::DVec3;
use palpate_core::dynamics::Energy;
use palpate_core::simulation::{MAX_BODIES, MAX_TOOLS};
use palpate_devices::{Reading, Wrench};

use crate::recorder::RecordingProgress;
use crate::safety::{Fault, PortEnergy};
use crate::settings::Settings;
use crate::statistics::Summary;

/// What the operating system granted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RealtimeStatus {
    /// Real-time scheduling.
    pub priority: bool,
    /// Locked memory.
    pub locked_memory: bool,
}

/// Numbers of the latest tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct Status {
    /// Time since the first tick, s.
    pub time: f64,
    /// Ticks since the start.
    pub ticks: u64,
    /// Deadlines that passed within ticks that took longer than a period.
    pub missed_computing: u64,
    /// Deadlines that passed because a tick began late.
    pub missed_waking: u64,
    /// Log rows lost because nobody drained them.
    pub dropped_rows: u64,
    /// Those in force.
    pub settings: Settings,
    /// What went out to the devices.
    pub wrenches: [Wrench; MAX_TOOLS],
    /// What the devices said.
    pub readings: [Reading; MAX_TOOLS],
    /// Energy at the devices' ports.
    pub ports: [PortEnergy; MAX_TOOLS],
    /// Whether the limit of strain keeps each tool from following its device.
    pub limited: [bool; MAX_TOOLS],
    /// Time that ticks take as a whole, statistics and hand-off included, us.
    pub compute: Summary,
    /// Delay between the time a tick is due and its begin, us.
    pub wakeup: Summary,
    /// Latched fault: that of the whole loop, or the first tool's that has one.
    pub fault: Option<Fault>,
    /// What the operating system granted the loop's own thread.
    pub realtime: RealtimeStatus,
    /// How far a recording has come.
    pub recording: RecordingProgress,
    /// Blocks of places at which each tool has the higher orders of each body's displacement.
    pub series_blocks: [[u32; MAX_BODIES]; MAX_TOOLS],
}

impl Status {
    /// Deadlines that passed without a tick.
    pub fn missed_deadlines(&self) -> u64 {
        self.missed_computing + self.missed_waking
    }
}

/// One tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct LogRow {
    /// Time since the first tick, s.
    pub time: f64,
    /// Tip position of the first tool, m.
    pub position: DVec3,
    /// Force on the first device, N.
    pub force: DVec3,
    /// Forces on all devices, N.
    pub forces: [DVec3; MAX_TOOLS],
    /// Time that the whole tick took, this row included, us.
    pub compute_us: f64,
    /// Delay between the time it was due and its begin, us.
    pub wakeup_us: f64,
    /// Displacement of the watched node, m, in its body's frame.
    pub watched: Option<DVec3>,
    /// Time that each body in motion has gone through, s.
    pub body_time: [f64; MAX_BODIES],
    /// Energies of each body in motion.
    pub energy: [Energy; MAX_BODIES],
}
