//! Commands of a page, as JSON.

use std::collections::BTreeMap;

use palpate_core::Result;
use palpate_core::simulation::Strike;
use palpate_scene::read_tool;
use serde::Deserialize;

use crate::session::Session;

/// What a page asks for. Lengths in m, impulses in N s, times in s; vectors in the frame of the scene.
#[derive(Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Command {
    /// Sends a tool to a place.
    Press {
        /// Its rank.
        tool: usize,
        /// Where to.
        position: [f64; 3],
        /// w x y z.
        orientation: Option<[f64; 4]>,
        /// Whether it holds on.
        grab: bool,
    },
    /// Takes a tool out of the scene.
    Release {
        /// Its rank.
        tool: usize,
    },
    /// Changes a setting.
    Set {
        /// Its name.
        name: String,
        /// Of which tool or body; 0 of the scene.
        rank: usize,
        /// What to.
        value: f64,
    },
    /// Gives a tool another shape and law.
    Tool {
        /// Its rank.
        tool: usize,
        /// An entry of `tools` in `scene.json`; without one, the scene's own.
        description: Option<serde_json::Value>,
    },
    /// Lets go of everything and clears faults.
    Reset,
    /// Strikes a body in motion on a patch of the first tool's contact radius.
    Strike {
        /// Its rank.
        body: usize,
        /// Where.
        point: [f64; 3],
        /// What it gets.
        impulse: [f64; 3],
        /// How long it takes.
        duration: f64,
    },
    /// Logs the displacement of a surface node.
    Watch {
        /// Rank of the body.
        body: usize,
        /// Rank of the node on the surface.
        node: u32,
    },
    /// Begins a recording.
    Record {
        /// What it says of itself.
        about: BTreeMap<String, String>,
        /// Since 1970, ms.
        begun_ms: f64,
    },
}

impl Command {
    /// Does it.
    ///
    /// # Errors
    /// What is refused.
    pub fn apply(self, session: &mut Session) -> Result<()> {
        match self {
            Command::Press { tool, position, orientation, grab } => session.press(tool, position, orientation, grab),
            Command::Release { tool } => session.release(tool),
            Command::Set { name, rank, value } => session.set(&name, rank, value),
            Command::Tool { tool, description } => {
                session.exchange_tool(tool, description.as_ref().map(read_tool).transpose()?)
            }
            Command::Reset => session.paced.handle.reset(),
            Command::Strike { body, point, impulse, duration } => {
                let radius = session.scene.settings.contact_radius[0];
                let (point, impulse) = (point.into(), impulse.into());
                session.paced.handle.strike(Strike { body, point, impulse, radius, duration })
            }
            Command::Watch { body, node } => session.watch(body, node),
            Command::Record { about, begun_ms } => session.record(about, (1e6 * begun_ms) as u64),
        }
    }
}
