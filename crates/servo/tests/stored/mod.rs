//! Scenes on a store that the release build has left in the target folder: builds without the offline part have no other.
#![allow(dead_code)] // each test file uses its part

use std::path::{Path, PathBuf};
use std::sync::Arc;

use palpate_core::contact::Moduli;
use palpate_core::contact::shape::ToolShape;
use palpate_core::dynamics::{Integration, ModalModel, Newmark, Rayleigh};
use palpate_core::green::GreensFunction;
use palpate_core::simulation::{BodyDynamics, BodyModel, LawKind, Model, Placement, ToolModel};
use palpate_servo::Settings;

/// A scene whose bits depend on its parts: at rest or in motion, one tool or two, and their law.
pub struct Scene {
    pub name: &'static str,
    pub moving: bool,
    pub tools: usize,
    pub law: LawKind,
}

pub const SCENES: [Scene; 4] = [
    Scene { name: "rest", moving: false, tools: 1, law: LawKind::LOCAL },
    Scene { name: "rest-two", moving: false, tools: 2, law: LawKind::LOCAL },
    Scene { name: "motion", moving: true, tools: 1, law: LawKind::LOCAL },
    Scene { name: "motion-two", moving: true, tools: 2, law: LawKind::PATCH },
];

pub fn folder() -> PathBuf {
    // One for all builds, whatever they are for.
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/tmp/across-builds")
}

pub fn store() -> PathBuf {
    folder().join("cube.palpate")
}

pub fn recording(scene: &Scene) -> PathBuf {
    folder().join(format!("{}.mcap", scene.name))
}

/// A cube 0.1 m wide under a sphere and a capsule.
pub fn model(scene: &Scene) -> Arc<Model> {
    let green = Arc::new(GreensFunction::load(&store(), None).expect("a store that the release build has written"));
    let nodes = green.surface_count();
    let moduli = Moduli::linear(vec![10e3; nodes], vec![0.4; nodes], true);
    let mut body = BodyModel::new(green, Placement::default()).expect("a valid body");
    body = body.with_moduli(moduli).expect("constants that match");
    if scene.moving {
        let eigenvalues: Vec<f64> = (0..20).map(|i| 1e3 * f64::from(i + 1)).collect();
        // Products and sums only: a library's sine may differ in its last bit.
        let shape = |k: usize| 0.3 * ((k % 17) as f64 / 8.0 - 1.0) * ((k % 5) as f64 / 2.0 - 1.0);
        let shapes: Vec<f64> = (0..60 * nodes).map(shape).collect();
        let newmark = Newmark::new(1e-3, 0.3025, 0.6).expect("a valid scheme");
        let rayleigh = Rayleigh { mass: 1.0, stiffness: 1e-4 };
        let modes = ModalModel::new(&eigenvalues, &shapes, &rayleigh, Integration::Newmark(newmark));
        let dynamics = BodyDynamics::new(modes.expect("valid modes"), 500.0).expect("a valid coupling");
        body = body.with_dynamics(dynamics).expect("rows that match");
    }
    let capsule = || ToolShape::capsule(0.005, 0.005).expect("a capsule");
    let sphere = || ToolShape::sphere(0.01).expect("a sphere");
    let tool = |rank: usize| ToolModel {
        shape: if rank == 0 || scene.law == LawKind::PATCH { sphere() } else { capsule() },
        radius: 0.01,
        law: scene.law,
        pad_youngs_modulus: None,
        max_stiffness: 5000.0,
    };
    Arc::new(Model::new(vec![body], (0..scene.tools).map(tool).collect()).expect("a valid scene"))
}

pub fn settings() -> Settings {
    let mut settings = Settings::default();
    settings.contact_radius = settings.contact_radius.map(|_| 0.02);
    settings.friction = settings.friction.map(|_| 0.3);
    settings
}
