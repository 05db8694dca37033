//! Scenes as `palpate pack` writes them: a folder with `scene.json`, stores, and arrays as safetensors.
//!
//! `scene.json` names its format and version, the content key of every store and a checksum of every file of arrays. Stores
//! verify themselves block by block. What does not match is refused.

mod arrays;
mod description;
#[cfg(feature = "offline")]
mod elements;
mod read;

pub use arrays::checksum;
pub use read::{SCENE_FILE, read, read_tool};
