//! Scenes and devices for the tests of the loop.
#![allow(dead_code)] // each test file uses its part

use std::collections::HashMap;
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use glam::{DMat3, DVec3};
use palpate_core::contact::Moduli;
use palpate_core::contact::shape::ToolShape;
use palpate_core::dynamics::{Integration, ModalModel, Newmark, Rayleigh};
use palpate_core::fem::Supports;
use palpate_core::green::{GreensFunction, Precision, Problem, precompute};
use palpate_core::mesh::{Faces, TetMesh, Tets};
use palpate_core::simulation::{BodyDynamics, BodyModel, LawKind, MAX_TOOLS, Model, Placement, ToolModel};
use palpate_devices::{Device, DeviceFault, DeviceLimits, Reading, Wrench};
use palpate_servo::Settings;

#[path = "../../../core/tests/common/mod.rs"]
mod bodies;
pub use bodies::cube;

pub const PERIOD: f64 = 1e-3;
pub const PERIOD_NS: u64 = 1_000_000;
pub const TOOL: ToolModel = ToolModel {
    shape: ToolShape::Sphere { radius: 0.005 },
    radius: 0.005,
    law: LawKind::PATCH,
    pad_youngs_modulus: None,
    max_stiffness: 5000.0,
};

/// Two tools and two cubes 0.1 m wide, one at the origin, the other turned by a right angle, with its corner at
/// (0.25, 0, 0): it may be touched in its half of larger x.
pub fn scene(moving: bool, quadratic: bool) -> Arc<Model> {
    let problem = || if quadratic { raised(cube(3)) } else { cube(4) };
    let first = BodyModel::new(green(&problem()), Placement::default()).expect("a valid body");
    let first = if moving { set_in_motion(first) } else { first };
    let mut half = problem();
    let near = |rank: &u32| half.mesh.nodes[half.surface_nodes[*rank as usize] as usize].y < 0.08;
    half.touch = (0..half.surface_nodes.len() as u32).filter(near).collect();
    let placement = Placement { position: DVec3::new(0.25, 0.0, 0.0), rotation: DMat3::from_rotation_z(FRAC_PI_2) };
    let second = BodyModel::new(green(&half), placement).expect("a valid body");
    Arc::new(Model::new(vec![first, second], vec![TOOL; 2]).expect("a valid scene"))
}

/// A cube at the origin and one tool.
pub fn single(moving: bool) -> Arc<Model> {
    let body = BodyModel::new(green(&cube(4)), Placement::default()).expect("a valid body");
    let body = if moving { set_in_motion(body) } else { body };
    Arc::new(Model::new(vec![body], vec![TOOL]).expect("a valid scene"))
}

/// A cube at rest at the origin under one tool.
pub fn single_with(tool: ToolModel) -> Arc<Model> {
    let body = BodyModel::new(green(&cube(4)), Placement::default()).expect("a valid body");
    Arc::new(Model::new(vec![body], vec![tool]).expect("a valid scene"))
}

/// A cube at the origin under tools of the local law, one a shape.
pub fn sliding(moving: bool, shapes: [ToolShape; 2]) -> Arc<Model> {
    let body = BodyModel::new(green(&cube(6)), Placement::default()).expect("a valid body");
    let nodes = body.green().surface_count();
    let moduli = Moduli::linear(vec![10e3; nodes], vec![0.4; nodes], true);
    let body = body.with_moduli(moduli).expect("constants that match");
    let body = if moving { set_in_motion(body) } else { body };
    let tools = shapes.map(|shape| ToolModel { shape, radius: 0.01, law: LawKind::LOCAL, ..TOOL });
    Arc::new(Model::new(vec![body], tools.into()).expect("a valid scene"))
}

pub fn settings() -> Settings {
    Settings { contact_radius: [0.02; MAX_TOOLS], ..Settings::default() }
}

fn green(problem: &Problem) -> Arc<GreensFunction> {
    Arc::new(precompute(problem, Precision::F32, &|_, _| true).expect("a solvable cube"))
}

/// Weight of the new acceleration in the velocity of a step of the bodies in motion.
pub const DELTA: f64 = 0.6;

/// Any shapes will do, but they must be small: the modes may not be softer than the body is at rest.
fn set_in_motion(body: BodyModel) -> BodyModel {
    let (dofs, modes) = (body.free_displacements().len(), 20);
    let eigenvalues: Vec<f64> = (0..modes).map(|i| 1e3 * f64::from(i + 1)).collect();
    let shapes: Vec<f64> = (0..dofs * modes as usize).map(|i| 0.3 * (0.1 * i as f64).sin()).collect();
    let newmark = Newmark::new(1e-3, 0.3025, DELTA).expect("a valid scheme");
    let rayleigh = Rayleigh { mass: 1.0, stiffness: 1e-4 };
    let modes = ModalModel::new(&eigenvalues, &shapes, &rayleigh, Integration::Newmark(newmark));
    let dynamics = BodyDynamics::new(modes.expect("valid modes"), 500.0).expect("a valid coupling");
    body.with_dynamics(dynamics).expect("rows that match")
}

/// A device by what it reads, and what becomes of what is written.
pub struct Scripted<R, W> {
    pub read: R,
    pub write: W,
    pub limits: DeviceLimits,
}

impl<R, W> Device for Scripted<R, W>
where
    R: FnMut(u64) -> Result<Reading, DeviceFault> + Send,
    W: FnMut(Wrench) -> Result<(), DeviceFault> + Send,
{
    fn name(&self) -> &str {
        "scripted"
    }

    fn read(&mut self, now_ns: u64, _period: f64) -> Result<Reading, DeviceFault> {
        (self.read)(now_ns)
    }
    fn write(&mut self, wrench: Wrench) -> Result<(), DeviceFault> {
        (self.write)(wrench)
    }
    fn limits(&self) -> DeviceLimits {
        self.limits
    }
}

/// A device that takes everything.
pub fn device(read: impl FnMut(u64) -> Result<Reading, DeviceFault> + Send + 'static) -> Box<dyn Device> {
    Box::new(Scripted { read, write: |_| Ok(()), limits: DeviceLimits::UNLIMITED })
}

/// The same body in 10-node tetrahedra, with the middles of its edges after its nodes.
pub fn raised(linear: Problem) -> Problem {
    let (Tets::Linear(tets), Faces::Linear(triangles)) = (&linear.mesh.tets, &linear.surface_faces) else {
        panic!("4-node tetrahedra")
    };
    let mut nodes = linear.mesh.nodes.clone();
    let mut middles = HashMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            nodes.push(0.5 * (nodes[a as usize] + nodes[b as usize]));
            nodes.len() as u32 - 1
        })
    };
    let edges = [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]];
    let tets: Vec<[u32; 10]> = tets
        .iter()
        .map(|t| std::array::from_fn(|k| if k < 4 { t[k] } else { middle(t[edges[k - 4][0]], t[edges[k - 4][1]]) }))
        .collect();
    let faces: Vec<[u32; 6]> = triangles
        .iter()
        .map(|t| std::array::from_fn(|k| if k < 3 { t[k] } else { middle(t[k - 3], t[(k - 2) % 3]) }))
        .collect();
    let mut surface_nodes = faces.as_flattened().to_vec();
    surface_nodes.sort_unstable();
    surface_nodes.dedup();
    let below = (0..nodes.len() as u32).filter(|&i| nodes[i as usize].z < 1e-9);
    let fixed: Vec<u32> = below.flat_map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Problem {
        supports: Supports::new(3 * nodes.len(), fixed).expect("valid supports"),
        mesh: TetMesh::new(nodes, tets).expect("a valid mesh"),
        materials: linear.materials,
        touch: (0..surface_nodes.len() as u32).collect(),
        loads: Vec::new(),
        surface_nodes,
        surface_faces: faces.into(),
    }
}
