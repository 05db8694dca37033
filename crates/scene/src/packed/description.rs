//! Contents of `scene.json`. Numbers are SI; vectors x y z, quaternions w x y z.

use std::collections::BTreeMap;

use serde::Deserialize;

/// The whole file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneDescription {
    /// Both are checked before the rest is looked at.
    #[serde(rename = "format")]
    _format: String,
    #[serde(rename = "version")]
    _version: u32,
    /// Version of the package that wrote it, and what the scene is called: for people.
    #[serde(rename = "palpate")]
    _palpate: String,
    #[serde(rename = "name")]
    _name: String,
    pub bodies: Vec<BodyDescription>,
    pub tools: Vec<ToolDescription>,
    pub device: DeviceDescription,
    pub strain_limit: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyDescription {
    pub name: String,
    pub store: StoreFile,
    /// Elastic constants, modes, elements.
    pub arrays: ArrayFile,
    pub position: [f64; 3],
    pub orientation: [f64; 4],
    /// Whether all of the body, not only its surface, is of one material.
    pub one_material: bool,
    pub motion: Option<MotionDescription>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoreFile {
    pub file: String,
    /// Content key.
    pub key: String,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArrayFile {
    pub file: String,
    /// Hex BLAKE3 hash of the whole file.
    pub checksum: String,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionDescription {
    pub scheme: Scheme,
    pub dt: f64,
    pub alpha: f64,
    pub delta: f64,
    /// Factors of mass, 1/s, and stiffness, s.
    pub rayleigh: [f64; 2],
    pub coupling: f64,
}

#[derive(Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum Scheme {
    Newmark,
    Exact,
}

/// A key that is none of these is a setting.
#[derive(Debug, Deserialize)]
pub struct ToolDescription {
    pub shape: ShapeDescription,
    pub law: String,
    #[serde(flatten)]
    pub settings: BTreeMap<String, f64>,
    pub pad_youngs_modulus: Option<f64>,
    pub max_stiffness: f64,
    /// Largest force in the scene that its device may put out, N.
    pub max_force: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShapeDescription {
    pub kind: String,
    /// As [`palpate_core::contact::shape::ToolShape::of_lengths`] takes them; zeros of a surface.
    pub lengths: [f64; 3],
    /// Vertices and triangles of a surface.
    pub arrays: Option<ArrayFile>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeviceDescription {
    pub max_force: f64,
    pub max_slew: f64,
    pub ramp: f64,
    pub rate: f64,
    pub cpus: Vec<usize>,
    pub priority: u8,
}
