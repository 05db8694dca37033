//! Haply's Inverse Service, emulated: a websocket on this machine that speaks as releases 3.0, 3.1, 3.4 and 3.5 do.
//!
//! What it does as the vendor documents: a full state on connecting, then exactly one state for each message and none
//! unasked; a device's readings are new only if a command or a probe addresses it, and its paired grip's with it; commands
//! hold for one message and a timeout, configurations for a session; unknown keys are ignored (and kept as complaints for
//! tests); two entries of a device count as one; a preset and a mount at once are refused.
//!
//! What the vendor does not say, and so may differ: the timeout (100 ms), the motors' largest force (10 N an axis), that a
//! second session's forces are ignored while another one's hold, how messages of 3.0 look, where the middle of the workspace is.

mod arm;
mod release;
mod reply_flaw;
mod requests;
mod server;
mod session;
mod shared;
mod state;
mod steering;
mod world;

pub use arm::MIDDLE;
pub use release::Release;
pub use reply_flaw::ReplyFlaw;
pub use server::{InverseService, Options};
pub use steering::MotorForce;
