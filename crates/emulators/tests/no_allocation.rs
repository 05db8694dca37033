//! No driver allocates in a tick. The emulated libraries have allocators of their own.
#![allow(unsafe_code)] // a counting allocator

#[path = "../../core/tests/common/counting_allocator.rs"]
mod counting_allocator;

use std::sync::mpsc::channel;
use std::time::Duration;

use glam::DVec3;
use palpate_devices::{Connection, Device, ReadyDevice, Wrench, forcedimension, haply, openhaptics};
use palpate_emulators::SteeredTip;
use palpate_emulators::inverse_service::{InverseService, Options};
use palpate_emulators::library::EmulatedLibrary;

use counting_allocator::allocations;

/// What a tick allocates and frees.
fn counted(device: &mut dyn Device, tick: u64) -> u64 {
    let before = allocations();
    let reading = device.read(1_000_000 * tick, 1e-3);
    let written = device.write(Wrench { force: 20.0 * DVec3::X, torque: DVec3::Y });
    let count = allocations() - before;
    assert!(reading.is_ok() && written.is_ok(), "{reading:?} {written:?}");
    count
}

#[test]
fn a_tick_of_haply() {
    let service = InverseService::start(&Options::default()).expect("a free port");
    service.add_arm("0A01", "inverse3", SteeredTip::held());
    let connection = Connection { address: Some(service.address()), ..Connection::default() };
    let mut device = haply::open(&connection).expect("opens").device;
    let ticks = (0..500).map(|tick| {
        std::thread::sleep(Duration::from_micros(100));
        counted(&mut *device, tick)
    });
    assert_eq!(ticks.max(), Some(0));
}

#[test]
fn a_tick_of_force_dimension() {
    let library = EmulatedLibrary::with_devices("palpate_emulated_dhd", "omega.6");
    let mut device = forcedimension::open(&library.connection(None)).expect("opens").device;
    let most = (0..1000).map(|tick| counted(&mut *device, tick)).max();
    assert_eq!(most, Some(0));
}

#[test]
fn a_tick_of_openhaptics() {
    let library = EmulatedLibrary::with_devices("palpate_emulated_hd", "Touch");
    let ReadyDevice { mut device, scheduler } = openhaptics::open(&library.connection(None)).expect("opens");
    let scheduler = scheduler.expect("the library has its own loop");
    let (sender, results) = channel();
    let (mut tick, mut most) = (0, 0);
    let begun = scheduler.start(Box::new(move || {
        most = most.max(counted(&mut *device, tick));
        tick += 1;
        if tick == 500 {
            let _ = sender.send(most);
        }
    }));
    begun.expect("the scheduler starts");
    let most = results.recv_timeout(Duration::from_secs(20));
    scheduler.stop();
    assert_eq!(most, Ok(0));
}
