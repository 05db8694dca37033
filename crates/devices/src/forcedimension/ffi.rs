//! Functions of Force Dimension's DHD, of the libraries `dhd` and `drd`, version 3. Our own declarations, by the names and types
//! that the vendor documents; each takes the device's number last, where -1 is the default device.
#![allow(unsafe_code)]

use std::ffi::{c_char, c_double, c_int, c_uchar, c_uint, c_ushort};

use crate::library::api;

/// A device's number. `c_char` has a sign on some systems and none on others.
pub type Id = c_char;

type VectorFunction = unsafe extern "system" fn(*mut c_double, *mut c_double, *mut c_double, Id) -> c_int;

/// What `-1` must be as a [`c_char`], signed or not.
pub fn id(number: i8) -> Id {
    number as Id
}

/// Results that are not errors, though they are not zero: `< 0` is an error.
pub mod result {
    use std::ffi::c_int;

    /// The values are those of the last call: this one came too early.
    pub const TIMEGUARD: c_int = 1;
}

/// Numbers of `dhdErrorGetLast`.
pub mod error {
    use std::ffi::c_int;

    pub const COMMUNICATION: c_int = 2;
    pub const NO_DRIVER_FOUND: c_int = 4;
    pub const NO_DEVICE_FOUND: c_int = 5;
    pub const NOT_AVAILABLE: c_int = 6;
    pub const TIMEOUT: c_int = 7;
    pub const DEVICE_NOT_READY: c_int = 12;
    pub const DEVICE_IN_USE: c_int = 20;
}

/// Length of the array of `dhdGetStatus`, and what is where in it. Version 3 writes 17; the rest is for a library that writes
/// more.
pub mod status {
    pub const LENGTH: usize = 64;
    pub const POWER: usize = 0;
    pub const CONNECTED: usize = 1;
    pub const RESET: usize = 3;
    pub const FORCE_OFF_CAUSE: usize = 14;
}

/// Values of the status's cause of motors that are off.
pub mod force_off {
    use std::ffi::c_int;

    pub const NONE: c_int = 0;
    pub const BUTTON: c_int = 1;
    pub const DEAD_MAN: c_int = 6;
}

api! {
    needed {
        device_count = c"dhdGetDeviceCount": unsafe extern "system" fn() -> c_int;
        open = c"dhdOpenID": unsafe extern "system" fn(Id) -> c_int;
        close = c"dhdClose": unsafe extern "system" fn(Id) -> c_int;
        enable_force = c"dhdEnableForce": unsafe extern "system" fn(c_uchar, Id) -> c_int;
        position = c"dhdGetPosition": VectorFunction;
        linear_velocity = c"dhdGetLinearVelocity": VectorFunction;
        /// `double[3][3]`, rows one after the other.
        orientation = c"dhdGetOrientationFrame": unsafe extern "system" fn(*mut [[c_double; 3]; 3], Id) -> c_int;
        set_force = c"dhdSetForce": unsafe extern "system" fn(c_double, c_double, c_double, Id) -> c_int;
        set_force_and_torque = c"dhdSetForceAndTorque": unsafe extern "system" fn(c_double, c_double, c_double, c_double, c_double, c_double, Id) -> c_int;
        button_mask = c"dhdGetButtonMask": unsafe extern "system" fn(Id) -> c_uint;
        gravity_compensation = c"dhdSetGravityCompensation": unsafe extern "system" fn(c_int, Id) -> c_int;
        system_type = c"dhdGetSystemType": unsafe extern "system" fn(Id) -> c_int;
        system_name = c"dhdGetSystemName": unsafe extern "system" fn(Id) -> *const c_char;
        status = c"dhdGetStatus": unsafe extern "system" fn(*mut [c_int; status::LENGTH], Id) -> c_int;
        /// C++'s `bool`, of which another compiler need not keep that it is 0 or 1.
        has_wrist = c"dhdHasWrist": unsafe extern "system" fn(Id) -> u8;
        has_active_wrist = c"dhdHasActiveWrist": unsafe extern "system" fn(Id) -> u8;
        last_error = c"dhdErrorGetLast": unsafe extern "system" fn() -> c_int;
        error_text = c"dhdErrorGetStr": unsafe extern "system" fn(c_int) -> *const c_char;
        sdk_version = c"dhdGetSDKVersion": unsafe extern "system" fn(*mut c_int, *mut c_int, *mut c_int, *mut c_int);
    }
    optional {
        angular_velocity = c"dhdGetAngularVelocityRad": VectorFunction;
        max_force = c"dhdGetMaxForce": unsafe extern "system" fn(Id) -> c_double;
        expert_mode = c"dhdEnableExpertMode": unsafe extern "system" fn() -> c_int;
        serial_number = c"dhdGetSerialNumber": unsafe extern "system" fn(*mut c_ushort, Id) -> c_int;
        watchdog = c"dhdSetWatchdog": unsafe extern "system" fn(c_uchar, Id) -> c_int;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_device_is_minus_one_with_and_without_a_sign() {
        assert_eq!(id(-1).to_ne_bytes(), [0xff]);
        assert_eq!(id(3).to_ne_bytes(), [3]);
    }
}
