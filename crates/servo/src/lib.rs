//! The 1 kHz force loop: absolute deadlines, a wait-free hand-off, a safety stage that is always on, statistics.
//!
//! The loop and an offline run call the same [`Ticker::tick`], so a recorded path gives the same bits in both.

mod clock;
mod offline;
mod safety;
mod servo;
mod statistics;
mod ticker;

pub use offline::{Recording, Script, run};
pub use safety::{Fault, Safety, SafetyLimits};
pub use servo::{LogRow, Published, RealtimeStatus, Servo, Settings, Status};
pub use statistics::{Histogram, Summary};
pub use ticker::{TickOutput, Ticker};

/// Ticks a second.
pub const RATE: f64 = 1000.0;
