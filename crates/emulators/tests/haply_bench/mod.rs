//! The emulated service as the shared suite wants it.

mod closed_loop;
mod farewell;
mod figures;

use std::sync::{PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::time::Duration;

use glam::DVec3;
use palpate_devices::haply::open;
use palpate_devices::{Buttons, Connection, DeviceFault, OpenError, Opened, Wrench};
use palpate_emulators::be_on_time;
use palpate_emulators::conformance::{Bench, Disturbance, Facts, Motors, Tip};
use palpate_emulators::inverse_service::{GripKind, Held, InverseService, MIDDLE, Options, Persona, Trouble};
use serde_json::json;

/// Identities of the arm and its grip.
pub const ARM: &str = "0A01";
pub const GRIP: &str = "61576";

static MACHINE: RwLock<()> = RwLock::new(());

/// Tests of times run one after another, and on time.
pub fn alone() -> RwLockWriteGuard<'static, ()> {
    be_on_time();
    MACHINE.write().unwrap_or_else(PoisonError::into_inner)
}

/// Tests that a few late milliseconds do not fail run beside each other.
pub fn beside_others() -> RwLockReadGuard<'static, ()> {
    be_on_time();
    MACHINE.read().unwrap_or_else(PoisonError::into_inner)
}

/// A service with an arm and a grip.
pub fn service(persona: Persona) -> InverseService {
    let service = InverseService::start(&Options { persona, ..Options::default() }).expect("a free port");
    service.add_held_arm(ARM, "inverse3");
    service.add_grip(GRIP, GripKind::Wireless, ARM);
    service
}

pub struct HaplyBench {
    persona: Persona,
    pub service: InverseService,
}

impl HaplyBench {
    pub fn new(persona: Persona) -> Self {
        Self { persona, service: service(persona) }
    }
}

impl Bench for HaplyBench {
    fn facts(&self) -> Facts {
        Facts {
            middle: if self.persona >= Persona::V35 { DVec3::ZERO } else { MIDDLE },
            position_tolerance: 1e-9,
            velocity_tolerance: 1e-9,
            velocity_settles: Duration::from_millis(60),
            force_tolerance: 1e-9,
            turns: true,
            buttons: 3,
            // An exchange takes less than one; the rest is for a machine that runs other things too.
            late_ticks: 10,
            stale_after: Duration::from_millis(50),
            force_holds: Duration::from_millis(100),
            recovers_within: Duration::from_secs(4),
            driver_error: DeviceFault::Driver(1),
            hurries: false,
        }
    }

    fn open(&mut self) -> Result<Opened, OpenError> {
        // Longer than a machine pauses that builds and tests other things: the suite asks that no force be withheld then.
        let address = format!("{}&hold=40", self.service.address());
        open(&Connection { address: Some(address), ..Connection::default() })
    }

    fn set_tip(&mut self, tip: Tip) {
        let Tip { position, velocity, orientation, angular_velocity } = tip;
        self.service.hold(ARM, Held { position, velocity, orientation, angular_velocity });
    }

    fn press(&mut self, buttons: Buttons) {
        self.service.press(GRIP, buttons);
    }

    fn motors(&mut self) -> Motors {
        let motors = self.service.motors(ARM);
        Motors { wrench: Wrench { force: motors.force, torque: DVec3::ZERO }, at: motors.at }
    }

    fn disturb(&mut self, disturbance: Option<Disturbance>) {
        self.service.plug(ARM, disturbance != Some(Disturbance::Unplugged));
        let old = disturbance == Some(Disturbance::WrongVersion);
        self.service.set_persona(if old { Persona::V30 } else { self.persona });
        self.service.set_trouble(match disturbance {
            Some(Disturbance::DriverError) => Some(Trouble::Truncated),
            Some(Disturbance::SlowReplies) => Some(Trouble::Late(Duration::from_millis(150))),
            Some(Disturbance::NotFinite) => Some(Trouble::Replaced("/inverse3/0/state/cursor_position/x", json!(null))),
            _ => None,
        });
    }
}
