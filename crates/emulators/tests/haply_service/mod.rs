//! The emulated service for the tests of the driver.

mod closed_loop;
mod farewell;
mod figures;

use std::sync::{PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

use palpate_emulators::inverse_service::{InverseService, Options, Release};
use palpate_emulators::{SteeredTip, request_realtime};

/// Identities of the arm and its grip.
pub const ARM: &str = "0A01";
pub const GRIP: &str = "61576";

static MACHINE: RwLock<()> = RwLock::new(());

/// Tests of times run one after another, and on time.
pub fn alone() -> RwLockWriteGuard<'static, ()> {
    request_realtime();
    MACHINE.write().unwrap_or_else(PoisonError::into_inner)
}

/// Tests that a few late milliseconds do not fail run beside each other.
pub fn beside_others() -> RwLockReadGuard<'static, ()> {
    request_realtime();
    MACHINE.read().unwrap_or_else(PoisonError::into_inner)
}

/// A service with an arm and a grip.
pub fn service(release: Release) -> InverseService {
    let service = InverseService::start(&Options { release, ..Options::default() }).expect("a free port");
    service.add_arm(ARM, "inverse3", SteeredTip::held());
    service.add_grip(GRIP, ARM);
    service
}
