//! What one build records, another makes again: recordings and stores of `cargo test --release` lie in the target folder, and
//! a build without optimisation and without the offline part gives the same bits.

#[cfg(feature = "offline")]
mod common;
mod stored;

#[cfg(feature = "offline")]
use glam::{DQuat, DVec3};
use palpate_devices::DeviceLimits;
use palpate_recording::Ticks;
use palpate_servo::{Replay, SafetyLimits, StrainPreparer};
#[cfg(feature = "offline")]
use std::f64::consts::TAU;

use stored::{SCENES, model, recording, settings};
#[cfg(feature = "offline")]
use stored::{folder, store};

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
        let script = Script { period: 1e-3, poses: &poses, grabs: &[], strikes: &[], watch: &[], devices: &[] };
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

/// By itself, for the harness of tests is not made for sanitizers of threads.
fn main() {
    #[cfg(feature = "offline")]
    record();
    for scene in &SCENES {
        let model = model(scene);
        let devices = vec![DeviceLimits::UNLIMITED; scene.tools];
        let strain = StrainPreparer::new(&model);
        let replay = Replay::new(&model, &devices, SafetyLimits::default(), settings(), strain);
        let mut replay = replay.expect("a valid loop");
        let records = Ticks::open(&recording(scene)).expect("a recording that the release build has written");
        let mut ticks = 0;
        for record in records {
            let differences = replay.tick(&record.expect("whole messages")).expect("valid settings");
            assert!(differences.is_empty(), "{}: {}", scene.name, differences[0]);
            ticks += 1;
        }
        assert_eq!(ticks, 800);
    }
}
