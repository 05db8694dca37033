//! What is written is read again, bit for bit; a file that was cut short up to there.

#[path = "../../servo/tests/common/mod.rs"]
mod common;

use std::collections::BTreeMap;
use std::io::{Cursor, Read};
use std::path::PathBuf;

use glam::DVec3;
use palpate_core::simulation::Strike;
use palpate_devices::{Buttons, Device, DeviceFault, Pose, Reading, Twist};
use palpate_recording::{FileEnd, Header, Recorder, TickWriter, Ticks};
use palpate_servo::{FaultReason, ForceLoop, LoopHandle, SafetyLimits, Settings, TickRecord};

use common::{PERIOD, PERIOD_NS, device, scene, settings};

const TICKS: u64 = 900;

fn reading_of(tool: usize, tick: u64) -> Result<Reading, DeviceFault> {
    if tool == 1 && tick > 800 {
        return Err(if tick.is_multiple_of(2) { DeviceFault::Driver(-7) } else { DeviceFault::Program });
    }
    let t = PERIOD * tick as f64;
    let x = if tool == 0 { 0.03 + 0.02 * t } else { 0.24 - 0.1 * t };
    let pose = Pose::at(DVec3::new(x, 0.05, 0.105 - 0.01 * (9.0 * t).sin()));
    let twist = Twist { linear: DVec3::new(0.1, -1e-300, t), angular: DVec3::new(t, 0.0, -0.0) };
    let buttons = Buttons(if tick > 500 { 5 } else { 0 });
    Ok(Reading { pose, twist, buttons, active: true, timestamp_ns: tick * PERIOD_NS + 7 })
}

fn new_loop() -> (ForceLoop, LoopHandle) {
    let devices = [0, 1].map(|tool| device(move |now_ns| reading_of(tool, now_ns / PERIOD_NS)) as Box<dyn Device>);
    let limits = SafetyLimits { max_compute: f64::INFINITY, max_overruns: u32::MAX, ..SafetyLimits::default() };
    ForceLoop::new(scene(true, false), devices.into(), limits, settings()).expect("a valid loop")
}

fn settings_at(tick: u64) -> Settings {
    // Of tools that the scene does not have nothing is kept.
    let mut of_two = Settings { time_scale: if tick > 300 { 0.5 } else { 1.0 }, ..Settings::default() };
    for tool in 0..2 {
        (of_two.contact_radius[tool], of_two.friction[tool]) = (0.02, 0.1);
    }
    of_two
}

fn ticks(force_loop: &mut ForceLoop, handle: &mut LoopHandle, ticks: std::ops::Range<u64>) {
    for tick in ticks {
        handle.set(settings_at(tick)).expect("valid settings");
        if tick == 301 {
            let point = DVec3::new(0.02, 0.02, 0.1);
            let impulse = DVec3::new(0.0, 0.0, -1e-3);
            handle.strike(Strike { body: 0, point, impulse, radius: 0.02, duration: 3e-3 }).expect("room");
        }
        if tick == 850 {
            force_loop.latch(FaultReason::Overrun);
        }
        force_loop.tick(tick * PERIOD_NS, PERIOD);
    }
}

fn records() -> Vec<TickRecord> {
    let (mut force_loop, mut handle) = new_loop();
    let mut ring = handle.begin_recording().expect("no recording yet");
    ticks(&mut force_loop, &mut handle, 0..TICKS);
    std::iter::from_fn(|| ring.pop().ok()).collect()
}

fn header() -> Header {
    let about = BTreeMap::from([("scene".into(), "two cubes".into())]);
    Header { about, tools: 2, bodies: 2, rate: 1000.0, begun_ns: 1_700_000_000_000_000_000 }
}

fn written(records: &[TickRecord], ticks: u64) -> Vec<u8> {
    let mut writer = TickWriter::new(Cursor::new(Vec::new()), header()).expect("room in memory");
    for (rank, record) in records.iter().enumerate() {
        writer.push(record).expect("room in memory");
        if rank % 50 == 49 {
            writer.flush().expect("room in memory");
        }
    }
    writer.finish(Some(ticks)).expect("room in memory").into_inner()
}

fn read<R: Read>(mut ticks: Ticks<R>) -> (Vec<TickRecord>, Option<FileEnd>) {
    let records = ticks.by_ref().collect::<palpate_core::Result<Vec<_>>>().expect("whole messages");
    (records, ticks.ending)
}

fn of_bytes(bytes: &[u8]) -> Result<Ticks<&[u8]>, String> {
    Ticks::new(bytes)
}

/// All numbers as text with the fewest digits that read back the same.
fn text(record: &TickRecord) -> String {
    let mut record = *record;
    // The loop of these tests is due at times long past.
    record.delay_ns = 0;
    format!("{record:?}")
}

#[test]
fn every_bit_is_read_again() {
    let records = records();
    let pressed = records.iter().filter(|record| record.output.contacts.iter().len() > 0).count();
    assert!(records.len() as u64 == TICKS && pressed > 100);
    let bytes = written(&records, TICKS);
    let file = of_bytes(&bytes).expect("a file of ours");
    assert_eq!(file.about["scene"], "two cubes");
    let (again, ending) = read(file);
    assert_eq!(ending, Some(FileEnd { dropped: 0 }));
    assert_eq!(again.len(), records.len());
    for (a, b) in again.iter().zip(&records) {
        assert_eq!(text(a), text(b));
    }
}

#[test]
fn a_file_that_was_cut_gives_all_up_to_there() {
    let records = records();
    let bytes = written(&records, TICKS);
    let mut before = 0;
    for share in [0.05, 0.3, 0.6, 0.8] {
        let cut = &bytes[..(share * bytes.len() as f64) as usize];
        let (again, ending) = read(of_bytes(cut).expect("the beginning is whole"));
        assert!(ending.is_none() && again.len().is_multiple_of(50) && again.len() >= before, "{}", again.len());
        assert!(again.iter().zip(&records).all(|(a, b)| text(a) == text(b)));
        before = again.len();
    }
    assert!(before > TICKS as usize / 2);
    for bad in [&b"ISO-10303-21;"[..], &[], &bytes[..8]] {
        assert!(of_bytes(bad).is_err());
    }
}

/// The length of a record is read before any checksum can be: one of 2^56 bytes is an error, not an allocation.
#[test]
fn a_damaged_length_is_found() {
    let mut bytes = written(&records(), TICKS);
    let (magic, chunk) = (8, 6);
    let mut at = magic;
    let length = |bytes: &[u8], at: usize| u64::from_le_bytes(bytes[at + 1..at + 9].try_into().expect("eight bytes"));
    while bytes[at] != chunk {
        at += 9 + length(&bytes, at) as usize;
    }
    bytes[at + 8] ^= 1;
    let again = of_bytes(&bytes).expect("the beginning is whole").collect::<palpate_core::Result<Vec<_>>>();
    let error = again.expect_err("a length beyond all memory").to_string();
    assert!(error.starts_with("the recording is damaged: "), "{error}");
}

/// A bit that has changed is found, or it was none of a tick's.
#[test]
fn damage_is_found() {
    let records = records();
    let bytes = written(&records, TICKS);
    let mut found = 0;
    for place in (20..100).step_by(3) {
        let mut damaged = bytes.clone();
        damaged[place * bytes.len() / 150] ^= 1;
        let again = of_bytes(&damaged).expect("the beginning is whole").collect::<palpate_core::Result<Vec<_>>>();
        match again {
            Ok(again) => assert!(again.iter().zip(&records).all(|(a, b)| text(a) == text(b))),
            Err(error) => {
                assert!(error.to_string().starts_with("the recording is damaged: "), "{error}");
                found += 1;
            }
        }
    }
    assert!(found > 6, "{found}");
}

#[test]
fn what_was_dropped_is_counted_and_told() {
    let mut records = records();
    records.drain(400..412);
    let bytes = written(&records, TICKS + 5);
    let events = mcap::MessageStream::new(&bytes).expect("a file").filter_map(Result::ok);
    let events: Vec<_> = events.filter(|message| message.channel.topic == "/events").collect();
    let text = |data: &[u8]| String::from_utf8_lossy(data).into_owned();
    let events: String = events.iter().map(|message| text(&message.data)).collect();
    for expected in ["12 ticks were not recorded", "strike of 0.001 N s on body 0", "tool 1: the device's program"] {
        assert!(events.contains(expected), "{expected}: {events}");
    }
    let (again, ending) = read(of_bytes(&bytes).expect("a file of ours"));
    assert_eq!((again.len() as u64, ending), (TICKS - 12, Some(FileEnd { dropped: 17 })));
}

fn scratch(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("palpate-recording-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    folder.join(name)
}

#[test]
fn a_thread_beside_the_loop_writes_the_file() {
    let path = scratch("beside.mcap");
    let (mut force_loop, mut handle) = new_loop();
    let ring = handle.begin_recording().expect("no recording yet");
    let recorder = Recorder::start(&path, header(), ring).expect("a new file");
    ticks(&mut force_loop, &mut handle, 0..400);
    // What is in the file after the longest wait survives a process that is killed now.
    std::thread::sleep(std::time::Duration::from_millis(300));
    let (so_far, ending) = read(Ticks::open(&path).expect("readable while it grows"));
    assert_eq!((so_far.len(), ending), (400, None));
    ticks(&mut force_loop, &mut handle, 400..TICKS);
    let status = recorder.finish(TICKS);
    assert_eq!((status.ticks, status.error), (TICKS, None));
    assert_eq!(std::fs::metadata(&path).expect("a file").len(), status.bytes);
    let (all, ending) = read(Ticks::open(&path).expect("a file of ours"));
    assert_eq!((all.len() as u64, ending), (TICKS, Some(FileEnd { dropped: 0 })));
    let (_unused, ring) = rtrb::RingBuffer::new(1);
    let refused = Recorder::start(&path, header(), ring).err().expect("the file is there").to_string();
    assert!(refused.ends_with("beside.mcap: exists: give another name, or delete it first"), "{refused}");
    assert!(Ticks::open(&scratch("none.mcap")).is_err());
    std::fs::remove_dir_all(path.parent().expect("a folder")).expect("removable");
}
