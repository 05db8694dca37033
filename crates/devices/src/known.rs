//! Limits of devices that are sold, for their drivers and for scenes that want to run on them.
//!
//! Stiffness and damping are not vendors' data. Those of 3D Systems, Novint and Force Dimension are what the drivers of CHAI3D
//! recommend (`src/devices/CPhantomDevices.cpp`, `CDeltaDevices.cpp`, version 3.3), from trying them at 1 kHz; those of Haply the
//! ends of the sliders of its tutorials. The damping of their own mechanics is not published: a driver that has measured
//! it states it, and so the stiffness that [`DeviceLimits::largest_stiffness`] allows.

use crate::DeviceLimits;

/// Fastest that a hand moves the tip of a desktop device, m/s.
const HAND_SPEED: f64 = 10.0;

const fn desktop(max_force: f64, max_stiffness: f64, max_damping: f64) -> DeviceLimits {
    DeviceLimits {
        max_force,
        max_torque: 0.0,
        max_stiffness,
        max_damping,
        max_angular_damping: 0.0,
        max_speed: Some(HAND_SPEED),
        ..DeviceLimits::UNLIMITED
    }
}

/// With motors of rotation.
const fn turning(translation: DeviceLimits) -> DeviceLimits {
    DeviceLimits { max_torque: 0.2, max_angular_damping: 0.07, ..translation }
}

/// 3D Systems Touch.
pub const TOUCH: DeviceLimits = desktop(3.3, 400.0, 4.0);
/// SensAble PHANTOM Omni.
pub const PHANTOM_OMNI: DeviceLimits = desktop(3.3, 700.0, 5.0);
/// SensAble PHANTOM Desktop.
pub const PHANTOM_DESKTOP: DeviceLimits = desktop(7.9, 1000.0, 5.0);
/// Novint Falcon.
pub const FALCON: DeviceLimits = desktop(8.0, 3000.0, 20.0);
/// Force Dimension omega.3, omega.6 and omega.7.
pub const OMEGA: DeviceLimits = desktop(12.0, 5000.0, 30.0);
/// Force Dimension sigma.7.
pub const SIGMA: DeviceLimits = turning(desktop(12.0, 4000.0, 30.0));
/// Force Dimension lambda.7.
pub const LAMBDA: DeviceLimits = turning(desktop(12.0, 8000.0, 30.0));
/// Haply Inverse3. Its force is the scene's to limit: the tutorials state none.
pub const INVERSE3: DeviceLimits = desktop(f64::INFINITY, 800.0, 3.0);

/// Force Dimension delta.3.
pub const DELTA: DeviceLimits = desktop(20.0, 5000.0, 30.0);
/// SensAble PHANTOM Premium 1.5 with six degrees of freedom.
pub const PHANTOM_PREMIUM_1_5: DeviceLimits = DeviceLimits { max_torque: 0.188, ..desktop(8.5, 800.0, 5.0) };
/// SensAble PHANTOM Premium 3.0 with six degrees of freedom.
pub const PHANTOM_PREMIUM_3_0: DeviceLimits = DeviceLimits { max_torque: 0.188, ..desktop(22.0, 1000.0, 5.0) };

/// Those on a desk, by name.
pub const ALL: [(&str, DeviceLimits); 8] = [
    ("Touch", TOUCH),
    ("PHANTOM Omni", PHANTOM_OMNI),
    ("PHANTOM Desktop", PHANTOM_DESKTOP),
    ("Falcon", FALCON),
    ("omega", OMEGA),
    ("sigma.7", SIGMA),
    ("lambda.7", LAMBDA),
    ("Inverse3", INVERSE3),
];
