//! Scenes without Python: a graph of bodies and tools, and its readers.
//!
//! What the force loop needs of a scene is little: stores of Green's functions, where bodies stand, elastic constants at
//! their surfaces, modes of those that move, shapes and laws of tools, limits. [`Scene`] holds it as nodes that can be put
//! together by a program, read from a bare store ([`Scene::of_store`]) or from a scene that `palpate pack` has written
//! ([`Scene::load`]). [`Scene::prepare`] turns it into what [`palpate_servo::ForceLoop`] takes, for the Python package and the
//! C interface alike; [`PreparedScene::continue_with`] exchanges it under a running loop. Meshing and finite elements stay with the
//! Python package.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod body;
mod graph;
mod load;
mod packed;
mod prepared;
mod store_defaults;
mod tool;

pub use body::{Body, Motion, device_pose, placement, unit_quaternion, wxyz};
pub use graph::{BodyId, Scene, ToolId};
pub use packed::{checksum, read_tool};
pub use prepared::{PreparedScene, carried_over};
pub use store_defaults::{largest_contact_radius, moduli_of_store};
pub use tool::{DEFAULT_FRICTION, DEFAULT_MAX_STIFFNESS, Tool};
