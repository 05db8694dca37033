//! Chapter 10 of docs/theory.md: the tick. `step(&Model, &mut State, &mut Scratch, &Input) -> Output` never allocates,
//! locks, reads a clock or panics on bad numbers; the same input gives the same bits.
//!
//! `input` is what comes from outside, `model` what is fixed, `state` what evolves. `law` says when a contact begins, how it
//! follows its tool and when it ends; `limit` keeps strain within what linear elasticity can say; `solve` finds the forces of
//! all contacts of a body together. A body that moves has a
//! `motion`, which a `strike` may set going, and an `energy` that is accounted for; on one at rest `passivity` keeps contacts from
//! giving out more than was put in. `snapshot` is what is drawn.

mod admissible;
mod body;
mod contacts;
mod covering;
mod energy;
mod further;
mod input;
mod kept;
mod law;
mod limit;
mod model;
mod motion;
mod passivity;
mod rotation;
mod scratch;
mod slip;
mod snapshot;
mod solve;
mod sound;
mod state;
mod step;
mod strain_watch;
mod strike;
mod system;
mod time;
mod tool;

pub use body::{BodyDynamics, BodyModel, PreparedBody};
pub use contacts::{Contact, Contacts, Mode};
pub use input::{Controls, Input, Output, Placement, Pose, Strike, ToolInput, Twist, Wrench};
pub use kept::Kept;
pub use model::Model;
pub use scratch::Scratch;
pub use snapshot::Snapshot;
pub use state::{BodyState, State, ToolState};
pub use step::step;
pub use strain_watch::StrainWatch;
pub use tool::{LawKind, ToolModel, contact_size};

/// Most tools a simulation may have.
pub const MAX_TOOLS: usize = 4;
/// Most bodies a simulation may have.
pub const MAX_BODIES: usize = 4;
/// Most places at which a tool may touch a body at once.
pub const MAX_PLACES: usize = 3;
/// Most contacts at once: each tool may touch each body, and some of them at further places.
pub const MAX_CONTACTS: usize = MAX_TOOLS * MAX_BODIES + MAX_FURTHER;
/// Most contacts at further places, and contacts that fade, of all tools together.
const MAX_FURTHER: usize = 8;
