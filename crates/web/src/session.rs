//! A running scene: its loop, its simulated devices, and a recording under way.

use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec3;
use palpate_core::{Error, Result};
use palpate_devices::simulated::{Handle, Target, simulated_with};
use palpate_recording::{Header, RecordingInMemory};
use palpate_scene::{PreparedScene, Scene, Tool, unit_quaternion};
use palpate_servo::{LogRow, PacedLoop, Published, Settings, TickRecord};
use rtrb::Consumer;

/// A scene and its loop.
pub struct Session {
    graph: Scene,
    /// Tools as the scene has them.
    own_tools: Vec<Tool>,
    pub(crate) scene: PreparedScene,
    pub(crate) paced: PacedLoop,
    tools: Vec<(Handle, Target)>,
    recording: Option<Recording>,
    pub(crate) rows: Vec<LogRow>,
}

/// Ticks on their way into bytes.
struct Recording {
    records: Consumer<TickRecord>,
    file: RecordingInMemory,
}

impl Session {
    /// Of a packed scene.
    ///
    /// # Errors
    /// A file that is missing or damaged; see [`Scene::prepare`].
    pub fn open(folder: &Path) -> Result<Self> {
        let graph = Scene::load(folder)?;
        let scene = graph.prepare()?;
        let own_tools = graph.tools().map(|(_, tool)| tool.clone()).collect();
        let (paced, tools) = start(&scene)?;
        Ok(Self { graph, own_tools, scene, paced, tools, recording: None, rows: Vec::new() })
    }

    /// Gives a tool another shape and law, or those of the scene again: a new loop on the same bodies, settings at their first
    /// values.
    ///
    /// # Errors
    /// No such tool, a tool that the bodies refuse, or a recording under way; everything stays as it was.
    pub fn exchange_tool(&mut self, rank: usize, tool: Option<Tool>) -> Result<()> {
        if self.recording.is_some() {
            return Err(Error::Invalid("end the recording before you choose another tool".into()));
        }
        self.tool(rank)?;
        let mut graph = self.graph.clone();
        graph.replace_tool(self.scene.tools[rank], tool.unwrap_or_else(|| self.own_tools[rank].clone()));
        let (scene, _) = graph.prepare_change(&self.scene)?;
        let (paced, tools) = start(&scene)?;
        (self.graph, self.scene, self.paced, self.tools) = (graph, scene, paced, tools);
        self.rows.clear();
        Ok(())
    }

    /// Makes the ticks that are due at a time of the page's clock, ns; how many.
    pub fn advance(&mut self, now_ns: u64) -> u64 {
        let recording = &mut self.recording;
        let made = self.paced.advance(now_ns, |_| {
            if let Some(recording) = recording {
                recording.take_up();
            }
        });
        let rows = &mut self.rows;
        self.paced.handle.drain_log(|row| rows.push(row));
        made
    }

    /// The latest tick.
    pub fn latest(&mut self) -> &Published {
        self.paced.handle.latest()
    }

    /// Sends a tool to a place, m; what it holds of an orientation (w x y z) stays where none is given.
    ///
    /// # Errors
    /// No such tool.
    pub fn press(&mut self, tool: usize, position: [f64; 3], orientation: Option<[f64; 4]>, grab: bool) -> Result<()> {
        let (handle, target) = self.tool(tool)?;
        target.pose.position = position.into();
        orientation.into_iter().for_each(|turned| target.pose.orientation = unit_quaternion(turned));
        (target.velocity, target.active, target.grab) = (DVec3::ZERO, true, grab);
        handle.set(*target);
        Ok(())
    }

    /// Takes a tool out of the scene.
    ///
    /// # Errors
    /// No such tool.
    pub fn release(&mut self, tool: usize) -> Result<()> {
        let (handle, target) = self.tool(tool)?;
        (target.active, target.grab) = (false, false);
        handle.set(*target);
        Ok(())
    }

    fn tool(&mut self, tool: usize) -> Result<&mut (Handle, Target)> {
        let count = self.tools.len();
        self.tools
            .get_mut(tool)
            .ok_or_else(|| Error::Invalid(format!("there is no tool {tool}, the scene has {count}")))
    }

    /// Changes a setting of a tool or body, or of the scene.
    ///
    /// # Errors
    /// A name that no setting has, or a value that is refused.
    pub fn set(&mut self, name: &str, rank: usize, value: f64) -> Result<()> {
        let mut settings = self.scene.settings;
        settings.set(name, rank, value)?;
        if name == "contact_radius" {
            self.scene.model.check_contact_radius(value)?;
        }
        self.change_settings(settings)
    }

    /// Watches a surface node, by its rank.
    ///
    /// # Errors
    /// A body or node that there is not.
    pub fn watch(&mut self, body: usize, node: u32) -> Result<()> {
        self.change_settings(Settings { watch: Some((body, node)), ..self.scene.settings })
    }

    fn change_settings(&mut self, settings: Settings) -> Result<()> {
        self.paced.handle.set(settings)?;
        self.scene.settings = settings;
        Ok(())
    }

    /// Begins a recording, whose texts say what is recorded; `begun_ns` is since 1970.
    ///
    /// # Errors
    /// A recording that is under way.
    pub fn record(&mut self, about: BTreeMap<String, String>, begun_ns: u64) -> Result<()> {
        if self.recording.is_some() {
            return Err(Error::Invalid("this session is being recorded already".into()));
        }
        let (tools, bodies) = (self.scene.tools.len(), self.scene.bodies.len());
        let header = Header { about, tools, bodies, rate: self.scene.scheduling.rate, begun_ns };
        let file = RecordingInMemory::new(header)?;
        self.recording = Some(Recording { records: self.paced.handle.begin_recording()?, file });
        Ok(())
    }

    /// Ticks recorded so far, and why no more are; `None` where nothing is recorded.
    pub fn recorded(&self) -> Option<(u64, Option<&str>)> {
        self.recording.as_ref().map(|recording| recording.file.status())
    }

    /// Ends the recording: the bytes of its file.
    ///
    /// # Errors
    /// No recording, or one that could not be written.
    pub fn end_recording(&mut self) -> Result<Vec<u8>> {
        let none = || Error::Invalid("nothing is being recorded".into());
        let mut recording = self.recording.take().ok_or_else(none)?;
        self.paced.handle.end_recording();
        recording.take_up();
        recording.file.finish()
    }
}

impl Recording {
    fn take_up(&mut self) {
        while let Ok(record) = self.records.pop() {
            self.file.push(&record);
        }
    }
}

/// A loop of a scene, and what moves its tools.
fn start(scene: &PreparedScene) -> Result<(PacedLoop, Vec<(Handle, Target)>)> {
    let (handles, devices): (Vec<_>, Vec<_>) = scene.devices.iter().map(simulated_with).unzip();
    let period = 1.0 / scene.scheduling.rate;
    let limits = scene.limits.of_any_tick_time();
    let paced = PacedLoop::new(scene.model.clone(), devices, limits, scene.settings, scene.strain.clone(), period)?;
    Ok((paced, handles.into_iter().map(|handle| (handle, Target::default())).collect()))
}
