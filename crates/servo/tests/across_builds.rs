//! What one build records, another makes again: recordings and stores of `cargo test --release` lie in the target folder, and
//! a build without optimisation and without the offline part gives the same bits.

#[cfg(feature = "offline")]
mod common;

#[cfg(feature = "offline")]
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::sync::Arc;

#[cfg(feature = "offline")]
use glam::{DQuat, DVec3};
use palpate_core::contact::Moduli;
use palpate_core::contact::shape::ToolShape;
use palpate_core::dynamics::{Integration, ModalModel, Newmark, Rayleigh};
use palpate_core::green::GreensFunction;
use palpate_core::simulation::{BodyDynamics, BodyModel, LawKind, Model, Placement, ToolModel};
use palpate_devices::DeviceLimits;
use palpate_recording::Ticks;
use palpate_servo::{Replay, SafetyLimits, Settings, StrainPreparer};

/// A scene whose bits depend on its parts: at rest or in motion, one tool or two, and their law.
struct Scene {
    name: &'static str,
    moving: bool,
    tools: usize,
    law: LawKind,
}

const SCENES: [Scene; 4] = [
    Scene { name: "rest", moving: false, tools: 1, law: LawKind::Local },
    Scene { name: "rest-two", moving: false, tools: 2, law: LawKind::Local },
    Scene { name: "motion", moving: true, tools: 1, law: LawKind::Local },
    Scene { name: "motion-two", moving: true, tools: 2, law: LawKind::Patch },
];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("across-builds")
}

fn store() -> PathBuf {
    folder().join("cube.palpate")
}

fn recording(scene: &Scene) -> PathBuf {
    folder().join(format!("{}.mcap", scene.name))
}

/// A cube 0.1 m wide under a sphere and a capsule.
fn model(scene: &Scene) -> Arc<Model> {
    let green = Arc::new(GreensFunction::load(&store(), None).expect("a store that the release build has written"));
    let nodes = green.surface_count();
    let moduli = Moduli { youngs: vec![10e3; nodes], poissons: vec![0.4; nodes], homogeneous: true };
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
        shape: if rank == 0 || scene.law == LawKind::Patch { sphere() } else { capsule() },
        radius: 0.01,
        law: scene.law,
        pad_youngs_modulus: None,
        max_stiffness: 5000.0,
    };
    Arc::new(Model::new(vec![body], (0..scene.tools).map(tool).collect()).expect("a valid scene"))
}

fn settings() -> Settings {
    let mut settings = Settings::default();
    settings.contact_radius = settings.contact_radius.map(|_| 0.02);
    settings.friction = settings.friction.map(|_| 0.3);
    settings
}

/// Presses, slides to and fro and lifts, turning a little.
#[cfg(feature = "offline")]
fn pose(tool: usize, tick: usize) -> palpate_devices::Pose {
    let turn = TAU * tick as f64 / 400.0;
    let x = 0.03 + 0.04 * tool as f64 + 0.01 * (2.0 * turn).sin();
    let position = DVec3::new(x, 0.05, 0.1115 - 0.004 * (1.0 - turn.cos()));
    palpate_devices::Pose { position, orientation: DQuat::from_rotation_x(0.1 * turn.sin()) }
}

/// Writes store and recordings, by another name first: tests of other builds may be reading.
#[cfg(feature = "offline")]
fn record() {
    use palpate_core::green::{Precision, precompute};
    use palpate_recording::{Header, TickWriter};
    use palpate_servo::{Script, TickRecord, run};

    std::fs::create_dir_all(folder()).expect("a folder");
    let green = precompute(&common::cube(5), Precision::F32, &|_, _| true).expect("a solvable cube");
    green.save(&store()).expect("room on the disk");
    for scene in &SCENES {
        let model = model(scene);
        let poses: Vec<_> = (0..800 * scene.tools).map(|k| pose(k % scene.tools, k / scene.tools)).collect();
        let script = Script { period: 1e-3, poses: &poses, grabs: &[], strikes: &[], watch: &[] };
        let header = Header { about: Default::default(), tools: scene.tools, bodies: 1, rate: 1e3, begun_ns: 0 };
        let mut writer = TickWriter::new(std::io::Cursor::new(Vec::new()), header).expect("room in memory");
        let mut touching = 0;
        let each = |record: &TickRecord| {
            touching += record.output.contacts.iter().len();
            writer.push(record).expect("room in memory");
        };
        let strain = StrainPreparer::new(&model);
        run(&model, SafetyLimits::default(), settings(), &strain, &script, each).expect("a valid script");
        assert!(touching > 200 * scene.tools, "{}: {touching}", scene.name);
        let bytes = writer.finish(None).expect("room in memory").into_inner();
        let beside = recording(scene).with_extension("new");
        std::fs::write(&beside, bytes).and_then(|()| std::fs::rename(&beside, recording(scene))).expect("a file");
    }
}

#[test]
fn recordings_of_the_release_build_are_made_again_bit_for_bit() {
    #[cfg(feature = "offline")]
    record();
    for scene in &SCENES {
        let model = model(scene);
        let devices = vec![DeviceLimits::UNLIMITED; scene.tools];
        let strain = StrainPreparer::new(&model);
        let replay = Replay::new(&model, &devices, SafetyLimits::default(), settings(), strain);
        let mut replay = replay.expect("a valid loop");
        let ticks = Ticks::open(&recording(scene)).expect("a recording that the release build has written");
        let mut made = 0;
        for record in ticks {
            let differences = replay.tick(&record.expect("whole messages")).expect("valid settings");
            assert!(differences.is_empty(), "{}: {}", scene.name, differences[0]);
            made += 1;
        }
        assert_eq!(made, 800);
    }
}
