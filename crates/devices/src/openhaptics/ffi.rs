//! Functions, types and numbers of OpenHaptics' HD interface, version 3. Our own declarations, by the names and types that the
//! vendor documents.
#![allow(unsafe_code)]

use std::ffi::{c_char, c_double, c_int, c_uint, c_ulong, c_ushort, c_void};
use std::mem::{offset_of, size_of};

use crate::library::api;

/// A device.
pub type Handle = c_uint;
/// A number of the interface.
pub type Enum = c_uint;
/// What a callback returns.
pub type CallbackCode = c_uint;
/// A callback of the scheduler.
pub type Callback = unsafe extern "system" fn(*mut c_void) -> CallbackCode;
/// A scheduled callback.
pub type SchedulerHandle = c_ulong;

pub const INVALID_HANDLE: Handle = 0xFFFF_FFFF;
pub const CALLBACK_CONTINUE: CallbackCode = 1;
/// In the middle of 0 to 65535.
pub const DEFAULT_PRIORITY: c_ushort = 32767;

/// An entry of the error stack; returned by value.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct ErrorInfo {
    pub code: Enum,
    /// The vendor's own number, for its support.
    pub internal: c_int,
    pub device: Handle,
}

const _: () = assert!(size_of::<ErrorInfo>() == 12);
const _: () = assert!(offset_of!(ErrorInfo, internal) == 4 && offset_of!(ErrorInfo, device) == 8);

/// What is asked and set by number.
pub mod parameter {
    use super::Enum;

    pub const CURRENT_BUTTONS: Enum = 0x2000;
    pub const CURRENT_INKWELL_SWITCH: Enum = 0x2002;
    pub const CURRENT_VELOCITY: Enum = 0x2051;
    pub const CURRENT_TRANSFORM: Enum = 0x2052;
    pub const CURRENT_ANGULAR_VELOCITY: Enum = 0x2053;
    pub const VERSION: Enum = 0x2500;
    pub const DEVICE_MODEL_TYPE: Enum = 0x2501;
    pub const DEVICE_DRIVER_VERSION: Enum = 0x2502;
    pub const DEVICE_SERIAL_NUMBER: Enum = 0x2504;
    pub const OUTPUT_DOF: Enum = 0x2554;
    pub const CALIBRATION_STYLE: Enum = 0x2555;
    pub const NOMINAL_MAX_STIFFNESS: Enum = 0x2602;
    pub const NOMINAL_MAX_FORCE: Enum = 0x2603;
    pub const NOMINAL_MAX_CONTINUOUS_FORCE: Enum = 0x2604;
    pub const CURRENT_FORCE: Enum = 0x2700;
    /// Deprecated by the vendor for torques of single motors, and what drivers use.
    pub const CURRENT_TORQUE: Enum = 0x2701;
}

/// What is switched on and off.
pub mod capability {
    use super::Enum;

    pub const FORCE_OUTPUT: Enum = 0x4000;
}

/// Whether it is calibrated, and how it can be.
pub mod calibration {
    use super::Enum;

    pub const OK: Enum = 0x5000;
    pub const NEEDS_UPDATE: Enum = 0x5001;
    pub const STYLE_INKWELL: Enum = 4;
}

/// Errors of the stack.
pub mod error {
    use super::Enum;

    pub const SUCCESS: Enum = 0;
    pub const BAD_HANDLE: Enum = 0x0104;
    pub const WARM_MOTORS: Enum = 0x0200;
    pub const DEVICE_FAULT: Enum = 0x0300;
    pub const DEVICE_ALREADY_INITIATED: Enum = 0x0301;
    pub const COMMUNICATION: Enum = 0x0302;
}

api! {
    needed {
        init_device = c"hdInitDevice": unsafe extern "system" fn(*const c_char) -> Handle;
        disable_device = c"hdDisableDevice": unsafe extern "system" fn(Handle);
        make_current = c"hdMakeCurrentDevice": unsafe extern "system" fn(Handle);
        enable = c"hdEnable": unsafe extern "system" fn(Enum);
        begin_frame = c"hdBeginFrame": unsafe extern "system" fn(Handle);
        end_frame = c"hdEndFrame": unsafe extern "system" fn(Handle);
        get_booleans = c"hdGetBooleanv": unsafe extern "system" fn(Enum, *mut u8);
        get_integers = c"hdGetIntegerv": unsafe extern "system" fn(Enum, *mut c_int);
        get_doubles = c"hdGetDoublev": unsafe extern "system" fn(Enum, *mut c_double);
        get_string = c"hdGetString": unsafe extern "system" fn(Enum) -> *const c_char;
        set_doubles = c"hdSetDoublev": unsafe extern "system" fn(Enum, *const c_double);
        get_error = c"hdGetError": unsafe extern "system" fn() -> ErrorInfo;
        error_string = c"hdGetErrorString": unsafe extern "system" fn(Enum) -> *const c_char;
        check_calibration = c"hdCheckCalibration": unsafe extern "system" fn() -> Enum;
        update_calibration = c"hdUpdateCalibration": unsafe extern "system" fn(Enum);
        schedule = c"hdScheduleAsynchronous": unsafe extern "system" fn(Callback, *mut c_void, c_ushort) -> SchedulerHandle;
        unschedule = c"hdUnschedule": unsafe extern "system" fn(SchedulerHandle);
        start_scheduler = c"hdStartScheduler": unsafe extern "system" fn();
        stop_scheduler = c"hdStopScheduler": unsafe extern "system" fn();
    }
    optional {}
}
