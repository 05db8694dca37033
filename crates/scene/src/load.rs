//! Scenes read from files.

use std::path::Path;
use std::sync::Arc;

use palpate_core::Result;
use palpate_core::green::GreensFunction;

use crate::body::Body;
use crate::graph::Scene;
use crate::packed;
use crate::tool::Tool;

impl Scene {
    /// Reads a packed scene (a folder, or the `scene.json` in it) or a bare store.
    ///
    /// # Errors
    /// A file that is missing, damaged, of another format or version, or that does not belong to the others.
    pub fn load(path: &Path) -> Result<Self> {
        if path.is_dir() {
            return packed::read(path);
        }
        match path.parent().filter(|_| path.file_name().is_some_and(|name| name == packed::SCENE_FILE)) {
            Some(folder) => packed::read(folder),
            None => Self::of_store(path),
        }
    }

    /// A store at the origin, and a tool that suits it.
    ///
    /// # Errors
    /// A file that is missing, no store, or damaged.
    pub fn of_store(path: &Path) -> Result<Self> {
        let mut scene = Self::default();
        scene.add_body(Body::of_store(Arc::new(GreensFunction::load(path, None)?))?)?;
        scene.add_tool(Tool::default())?;
        Ok(scene)
    }
}
