//! The force loop: devices, wait-free hand-offs, a safety stage that is always on, statistics.
//!
//! [`ForceLoop::tick`] is the whole of a tick. The servo's own thread calls it at a fixed rate ([`Servo`]), a driver's
//! callback may call it instead, and an offline run calls it without a clock ([`run`]): the same input gives the same bits
//! in all of them.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod caller;
mod change;
mod clock;
mod commands;
mod emulated;
mod exchange;
mod force_loop;
mod handoff;
mod log;
mod offline;
mod paced;
mod platform;
mod preparation;
mod preparer;
mod record;
mod recorder;
mod replay;
mod safety;
mod scheduling;
mod self_check;
mod series;
mod servo;
mod settings;
mod statistics;
mod stepper;
mod strain;
mod timing;

pub use clock::now_ns;
pub use emulated::{EmulatedTick, Emulation};
pub use force_loop::{ForceLoop, check_period};
pub use handoff::{LoopHandle, Published};
pub use log::{LogRow, RealtimeStatus, Status};
pub use offline::{Recording, Script, rerun, run};
pub use paced::PacedLoop;
pub use preparer::{StrainPreparer, StrainWorker};
pub use record::{
    RecordedContact, RecordedContacts, RecordedInput, RecordedOutput, RecordedTool, StrainArrivals, StrainRequestId,
    TickRecord,
};
pub use recorder::RecordingProgress;
pub use replay::{Difference, Owner, Replay};
pub use safety::{ComputedWrench, Fault, FaultReason, PortEnergy, SafetyLimits, SafetyStage};
pub use scheduling::Scheduling;
pub use self_check::{LARGEST_FORCE, Observation, SelfCheck, Task};
pub use servo::{SceneChange, Servo};
pub use settings::{Per, Setting, Settings};
pub use statistics::{Histogram, Summary};
pub use stepper::Stepper;
