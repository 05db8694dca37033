//! Chapter 10 of docs/theory.md: the tick. `step(&Model, &mut State, &mut Scratch, &Input) -> Output` never allocates,
//! locks, reads a clock or panics on bad numbers; the same input gives the same bits.
//!
//! `input` has the inputs of a tick, `model` the constant data, `state` the data that evolve. A `law` begins, follows and ends a
//! contact and finds its force. `limit` keeps the strain in the range of linear elasticity. `solve` finds the forces of all linear
//! contacts of a body together. A body in motion has a `motion`, which a `strike` may start, and an `energy` balance. On a body at
//! rest `passivity` prevents contacts from releasing more energy than tools have put in. `snapshot` has the data to draw, `indented`
//! the drawn surface below a tool, `taxels` the pressures on a tool.

mod body;
mod contacts;
mod energy;
mod indented;
mod input;
mod known_series;
mod law;
mod limit;
mod linear_error;
mod model;
mod motion;
mod passivity;
mod previous_ranks;
mod scratch;
mod series_take_up;
mod slip;
mod snapshot;
mod solve;
mod state;
mod step;
mod strain_projection;
mod strain_watch;
mod strike;
mod system;
mod taxels;
mod time;
mod tool;
mod weight_scratch;

pub use body::{BodyDynamics, BodyModel, PreparedBody};
pub use contacts::{Contact, Contacts, Mode};
pub use input::{Controls, Input, Output, Placement, Pose, Strike, ToolInput, Twist, Wrench};
pub use known_series::KnownSeries;
pub use model::Model;
pub use previous_ranks::PreviousRanks;
pub use scratch::Scratch;
pub use snapshot::Snapshot;
pub use state::{BodyState, State, ToolState};
pub use step::step;
pub use strain_watch::StrainWatch;
pub use taxels::TaxelGrid;
pub use tool::{LawKind, ToolModel, contact_size};

/// Most tools a simulation may have.
pub const MAX_TOOLS: usize = 4;
/// Most bodies a simulation may have.
pub const MAX_BODIES: usize = 4;
/// Most contacts of a tool with a body at once.
pub const MAX_PLACES: usize = 3;
/// Most contacts at once: one of each tool with each body, and additional ones.
pub const MAX_CONTACTS: usize = MAX_TOOLS * MAX_BODIES + MAX_ADDITIONAL;
/// Most additional and fading contacts of all tools together.
const MAX_ADDITIONAL: usize = 8;
