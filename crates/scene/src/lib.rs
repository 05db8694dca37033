//! Scenes without Python: a graph of bodies and tools, and what reads one from files.
//!
//! What the force loop needs of a scene is little: stores of Green's functions, where bodies stand, elastic constants at
//! their surfaces, modes of those that move, shapes and laws of tools, limits. [`Scene`] holds it as nodes that can be put
//! together by a program, read from a bare store ([`Scene::of_store`]) or from a scene that `palpate pack` has written
//! ([`Scene::load`]). [`Scene::prepare`] turns it into what [`palpate_servo::ForceLoop`] takes, for the Python package and the
//! C interface alike; [`Prepared::go_on_with`] exchanges it under a running loop. Meshing and finite elements stay with the
//! Python package.

mod bare;
mod body;
mod graph;
mod load;
mod packed;
mod prepared;
mod tool;

pub use bare::{largest_contact_radius, moduli_of_store};
pub use body::{Body, Motion, placement, unit_quaternion};
pub use graph::{BodyId, Scene, ToolId};
pub use packed::checksum;
pub use prepared::{Prepared, carried_over};
pub use tool::{DEFAULT_FRICTION, DEFAULT_MAX_STIFFNESS, Tool};
