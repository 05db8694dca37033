//! Recordings of the force loop as MCAP files, which Foxglove and the tools of ROS 2 open as they are.
//!
//! The loop pushes a record of each tick into a ring and knows nothing of files; a thread beside it writes them
//! ([`Recorder`]), and [`Ticks`] gives them back, bit for bit, also from a file that was cut short.

mod checksummed;
mod memory;
mod messages;
mod reader;
mod recorder;
mod schemas;
mod writer;

pub use memory::RecordingInMemory;
pub use messages::same_settings;
pub use reader::{FileEnd, Ticks};
pub use recorder::{Recorder, RecorderStatus};
pub use writer::{Header, TickWriter};
