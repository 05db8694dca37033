//! Conversion of scene arguments from Python, and of what is read back.

use std::collections::BTreeMap;
use std::sync::Arc;

use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use palpate_core::contact::Moduli;
use palpate_core::contact::shape::ToolShape;
use palpate_core::dynamics::Energy;
use palpate_core::simulation::{Contact, KnownSeries, LawKind, Mode, Model, Pose, Snapshot};
use palpate_core::{Error, Result};
use palpate_devices::DeviceLimits;
use palpate_scene::{Body, Motion, Tool, device_pose, placement};
use palpate_servo::{Per, Setting, Settings};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::dynamics::{SchemeArguments, scheme};
use crate::errors::Answer;
use crate::green::GreenCore;
use crate::series::Series;

/// Eigenvalues (m), their shapes at the surface dofs (3s, m), the scheme, whether each mode is integrated exactly instead,
/// and the spring between tools and patches, N/m.
pub type DynamicsArguments<'py> = (PyReadonlyArray1<'py, f64>, PyReadonlyArray2<'py, f64>, SchemeArguments, bool, f64);
/// Young's modulus (s, Pa) and Poisson's ratio (s) at the surface nodes, coefficients of finite strain (s, 3) of a material that is not
/// linear, and whether all of the body is of one material.
pub type ModuliArguments<'py> =
    (PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, f64>, Option<PyReadonlyArray2<'py, f64>>, bool);
/// Green's function, position (m), orientation (unit quaternion w x y z), what moves the body, its elastic constants, and series by the
/// radius of tools, m; `None` where nothing is known yet.
pub type BodyArguments<'py> = (
    PyRef<'py, GreenCore>,
    [f64; 3],
    [f64; 4],
    Option<DynamicsArguments<'py>>,
    Option<ModuliArguments<'py>>,
    Vec<(f64, Option<PyRef<'py, Series>>)>,
);
/// What a tool looks like: a kind and its lengths in m, three at most; of a surface vertices and triangles.
pub type ShapeArguments = (String, [f64; 3], Vec<[f64; 3]>, Vec<[u32; 3]>);
/// Shape, contact law, largest stiffness (N/m), Young's modulus of the pad (Pa), settings by their names.
pub type ToolArguments = (ShapeArguments, String, f64, Option<f64>, BTreeMap<String, f64>);

/// Tool, body, mode, (point, normal, force, torque, anchor, displacement) in the world, whether it is limited and slips,
/// contact radius (m), depth (m) and stiffness (N/m) under the local law and relative error of the force, nodes and weights
/// of a contact, and its point and normal in the body's own frame.
pub type ContactRecord =
    (usize, usize, &'static str, [[f64; 3]; 6], [bool; 2], [f64; 4], Vec<u32>, Vec<f64>, [[f64; 3]; 2]);

/// Takes arguments out of the interpreter's hands.
pub fn scene_body(arguments: &BodyArguments<'_>) -> Answer<Body> {
    let (green, position, orientation, dynamics, moduli, series) = arguments;
    let motion = dynamics
        .as_ref()
        .map(|(eigenvalues, shapes, arguments, exact, coupling)| -> Answer<_> {
            let (newmark, rayleigh) = scheme(*arguments)?;
            let (eigenvalues, shapes) = (eigenvalues.as_slice()?.to_vec(), shapes.as_slice()?.to_vec());
            Ok(Motion { eigenvalues, shapes, newmark, rayleigh, exact: *exact, coupling: *coupling })
        })
        .transpose()?;
    let moduli = moduli
        .as_ref()
        .map(|(youngs, poissons, terms, homogeneous)| -> Answer<_> {
            let linear = Moduli::linear(youngs.as_slice()?.to_vec(), poissons.as_slice()?.to_vec(), *homogeneous);
            let Some(terms) = terms else { return Ok(linear) };
            Ok(Moduli { strain_terms: terms.as_slice()?.as_chunks().0.to_vec(), ..linear })
        })
        .transpose()?;
    let placement = placement(*position, *orientation);
    let of_radius = |(radius, series): &(f64, Option<PyRef<'_, Series>>)| match series {
        Some(series) => series.for_loop(*radius),
        None => Arc::new(KnownSeries::new(*radius, vec![], vec![])),
    };
    let series = series.iter().map(of_radius).collect();
    Ok(Body { name: String::new(), green: green.green.clone(), placement, moduli, motion, strain: None, series })
}

/// Hex BLAKE3 hash, as a packed scene names it.
#[pyfunction]
pub fn checksum(data: &[u8]) -> String {
    palpate_scene::checksum(data)
}

/// A tool that is rendered as soft as its device needs.
pub fn scene_tool(arguments: ToolArguments) -> Result<Tool> {
    let (shape, law, max_stiffness, pad_youngs_modulus, settings) = arguments;
    let shape = Some(tool_shape(shape)?);
    let unknown = || Error::Invalid(format!("there is no contact law '{law}'"));
    let (law, device) = (Some(LawKind::parse(&law).ok_or_else(unknown)?), DeviceLimits::UNLIMITED);
    Ok(Tool { shape, law, settings, pad_youngs_modulus, max_stiffness, device, softened: true })
}

fn tool_shape((kind, lengths, vertices, triangles): ShapeArguments) -> Result<ToolShape> {
    match kind.as_str() {
        "surface" => ToolShape::surface(&vertices, &triangles),
        _ => ToolShape::of_lengths(&kind, lengths),
    }
}

/// Names of what is set for each tool.
pub fn tool_settings() -> Vec<&'static str> {
    Setting::ALL.iter().filter(|setting| setting.per == Per::Tool).map(|setting| setting.name).collect()
}

/// Settings by their names: a number, or a list with one for each tool or body.
pub fn settings_dict<'py>(
    py: Python<'py>,
    settings: &Settings,
    tools: usize,
    bodies: usize,
) -> Answer<Bound<'py, PyDict>> {
    let answer = PyDict::new(py);
    for setting in &Setting::ALL {
        let values = setting.values(settings);
        match setting.per {
            Per::Tool => answer.set_item(setting.name, values[..tools.min(values.len())].to_vec())?,
            Per::Body => answer.set_item(setting.name, values[..bodies.min(values.len())].to_vec())?,
            Per::Scene => answer.set_item(setting.name, values[0])?,
        }
    }
    Ok(answer)
}

/// Poses of (ticks, tools, 3) positions and (ticks, tools, 4) orientations.
pub fn poses(positions: &[f64], orientations: &[f64]) -> Vec<Pose> {
    let (positions, orientations) = (positions.as_chunks::<3>().0, orientations.as_chunks::<4>().0);
    positions.iter().zip(orientations).map(|(&position, &orientation)| device_pose(position, orientation)).collect()
}

/// Kinetic, strain, coupling, dissipated, work; J.
pub fn energy_array(e: &Energy) -> [f64; 5] {
    [e.kinetic, e.strain, e.coupling, e.dissipated, e.work]
}

/// The contacts of a tick.
pub fn contact_records(model: &Model, state: &Snapshot) -> Vec<ContactRecord> {
    let record = |contact: &Contact, nodes: &[u32], weights: &[f64]| {
        let placement = &model.bodies[contact.body].placement;
        let vectors = [
            placement.point_to_world(contact.point),
            placement.vector_to_world(contact.normal),
            placement.vector_to_world(contact.force),
            -placement.vector_to_world(contact.torque),
            placement.point_to_world(contact.anchor),
            placement.vector_to_world(contact.displacement),
        ];
        let mode = if contact.mode == Mode::Grab { "grab" } else { "press" };
        let flags = [contact.limited, contact.slipping];
        let numbers = [contact.radius, contact.depth, contact.stiffness, contact.error];
        let vectors = vectors.map(|v| v.to_array());
        let own = [contact.point, contact.normal].map(|v| v.to_array());
        (contact.tool, contact.body, mode, vectors, flags, numbers, nodes.to_vec(), weights.to_vec(), own)
    };
    let contacts = state.contacts.iter();
    contacts.map(|(contact, patch)| record(contact, patch.patch().nodes(), patch.patch().weights())).collect()
}
