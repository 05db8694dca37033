//! Reader of packed scenes.

use std::path::Path;
use std::sync::Arc;

use palpate_core::contact::local::SERIES_FIELDS;
use palpate_core::contact::shape::ToolShape;
use palpate_core::contact::{Moduli, SeriesFields};
use palpate_core::dynamics::{Newmark, Rayleigh};
use palpate_core::files;
use palpate_core::green::GreensFunction;
use palpate_core::simulation::{KnownSeries, LawKind};
#[cfg(not(feature = "offline"))]
use palpate_core::strain::StrainMeasure;
use palpate_core::{Error, Result};
use palpate_devices::DeviceLimits;
use palpate_servo::{SafetyLimits, Scheduling};
use safetensors::tensor::Dtype;

use super::arrays::{Arrays, file_of};
use super::description::{
    BodyDescription, MotionDescription, SceneDescription, Scheme, ShapeDescription, ToolDescription,
};
#[cfg(feature = "offline")]
use super::elements::strain;
use crate::body::{Body, Motion, placement};
use crate::graph::Scene;
use crate::tool::Tool;

/// The file that describes the scene.
pub const SCENE_FILE: &str = "scene.json";
const FORMAT: &str = "palpate-scene";
const VERSION: u32 = 3;

/// Reads the scene of a folder.
///
/// # Errors
/// A file that is missing, damaged, of another format or version, or that does not belong to the others.
pub fn read(folder: &Path) -> Result<Scene> {
    let path = folder.join(SCENE_FILE);
    let text = read_text(&path)?;
    let described = describe(&path, &text)?;
    let mut scene = Scene::default();
    scene.strain_limit = described.strain_limit;
    let device = described.device;
    scene.limits = SafetyLimits {
        max_force: device.max_force,
        max_slew: device.max_slew,
        ramp: device.ramp,
        ..SafetyLimits::default()
    };
    scene.scheduling = Scheduling { rate: device.rate, cpus: device.cpus, priority: device.priority };
    for described in described.bodies {
        scene.add_body(body(folder, described)?)?;
    }
    for described in described.tools {
        scene.add_tool(tool(folder, described)?)?;
    }
    Ok(scene)
}

/// Checks format and version before anything else: the keys of another version may be others.
fn describe(path: &Path, text: &str) -> Result<SceneDescription> {
    let foreign = |error: serde_json::Error| Error::store(path, format!("is not a packed scene: {error}"));
    let value: serde_json::Value = serde_json::from_str(text).map_err(foreign)?;
    if value["format"] != FORMAT {
        return Err(Error::store(path, "is not a packed scene: write one by 'palpate pack'"));
    }
    if value["version"] != VERSION {
        let version = &value["version"];
        return Err(Error::store(
            path,
            format!("has version {version}, this program reads {VERSION}; pack the scene again"),
        ));
    }
    serde_json::from_value(value).map_err(foreign)
}

fn body(folder: &Path, described: BodyDescription) -> Result<Body> {
    let store = file_of(folder, &described.store.file)?;
    let green = Arc::new(GreensFunction::load(&store, Some(&described.store.key))?);
    let arrays = Arrays::read(folder, &described.arrays)?;
    let (youngs, poissons) = (arrays.optional("youngs", Dtype::F64, 1)?, arrays.optional("poissons", Dtype::F64, 1)?);
    let strain_terms: Option<Vec<f64>> = arrays.optional("strain_terms", Dtype::F64, 3)?;
    let moduli = youngs.zip(poissons).map(|(youngs, poissons)| {
        let linear = Moduli::linear(youngs, poissons, described.one_material);
        match strain_terms {
            Some(terms) => Moduli { strain_terms: terms.as_chunks().0.to_vec(), ..linear },
            None => linear,
        }
    });
    Ok(Body {
        name: described.name,
        placement: placement(described.position, described.orientation),
        moduli,
        motion: described.motion.map(|described| motion(&arrays, &described)).transpose()?,
        strain: Some(Arc::new(strain(&arrays, &green)?)),
        series: series(&arrays)?,
        green,
    })
}

/// Series of all radii one after the other.
fn series(arrays: &Arrays) -> Result<Vec<Arc<KnownSeries>>> {
    let radii: Vec<f64> = arrays.optional("series_radii", Dtype::F64, 1)?.unwrap_or_default();
    let fields: Vec<f64> = arrays.optional("series", Dtype::F64, SERIES_FIELDS)?.unwrap_or_default();
    let fields: &[SeriesFields] = fields.as_chunks().0;
    let each = fields.len() / radii.len().max(1);
    Ok(radii
        .into_iter()
        .zip(fields.chunks_exact(each.max(1)))
        .map(|(radius, fields)| Arc::new(KnownSeries::new(radius, fields.to_vec(), vec![])))
        .collect())
}

fn motion(arrays: &Arrays, described: &MotionDescription) -> Result<Motion> {
    let eigenvalues: Vec<f64> = arrays.numbers("eigenvalues", Dtype::F64, 1)?;
    let [mass, stiffness] = described.rayleigh;
    Ok(Motion {
        shapes: arrays.numbers("shapes", Dtype::F64, eigenvalues.len())?,
        eigenvalues,
        newmark: Newmark::new(described.dt, described.alpha, described.delta)?,
        rayleigh: Rayleigh { mass, stiffness },
        exact: described.scheme == Scheme::Exact,
        coupling: described.coupling,
    })
}

/// By the surface: the inside of the body is not known without the offline part.
#[cfg(not(feature = "offline"))]
fn strain(_arrays: &Arrays, green: &GreensFunction) -> Result<StrainMeasure> {
    Ok(StrainMeasure::of_surface(&green.surface))
}

/// Text of a file.
fn read_text(path: &Path) -> Result<String> {
    let io = |source| Error::Io { path: path.to_owned(), source };
    String::from_utf8(files::read(path).map_err(io)?).map_err(|_| Error::store(path, "is no text"))
}

/// Reads one tool as `scene.json` describes it; its shape is not that of a file.
///
/// # Errors
/// A description that is none, or that names arrays.
pub fn read_tool(description: &serde_json::Value) -> Result<Tool> {
    let described: ToolDescription = serde_json::from_value(description.clone())
        .map_err(|error| Error::Invalid(format!("this describes no tool: {error}")))?;
    if described.shape.arrays.is_some() {
        return Err(Error::Invalid("a tool whose shape is a file's comes with its scene only".into()));
    }
    tool(Path::new(""), described)
}

fn tool(folder: &Path, described: ToolDescription) -> Result<Tool> {
    let ShapeDescription { kind, lengths, arrays } = described.shape;
    let shape = match arrays {
        None => ToolShape::of_lengths(&kind, lengths)?,
        Some(arrays) => {
            let arrays = Arrays::read(folder, &arrays)?;
            let vertices: Vec<[f64; 3]> = arrays.numbers("vertices", Dtype::F64, 3)?;
            ToolShape::surface(&vertices, &arrays.numbers::<[u32; 3]>("triangles", Dtype::U32, 3)?)?
        }
    };
    let unknown = || Error::Invalid(format!("there is no contact law '{}'", described.law));
    Ok(Tool {
        shape: Some(shape),
        law: Some(LawKind::parse(&described.law).ok_or_else(unknown)?),
        settings: described.settings,
        pad_youngs_modulus: described.pad_youngs_modulus,
        max_stiffness: described.max_stiffness,
        device: DeviceLimits { max_force: described.max_force, ..DeviceLimits::UNLIMITED },
        softened: false,
    })
}
