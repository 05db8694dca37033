//! Numbers of the interface.

pub mod parameter {
    pub const CURRENT_BUTTONS: u32 = 0x2000;
    pub const CURRENT_INKWELL_SWITCH: u32 = 0x2002;
    pub const CURRENT_VELOCITY: u32 = 0x2051;
    pub const CURRENT_TRANSFORM: u32 = 0x2052;
    pub const CURRENT_ANGULAR_VELOCITY: u32 = 0x2053;
    pub const VERSION: u32 = 0x2500;
    pub const DEVICE_MODEL_TYPE: u32 = 0x2501;
    pub const DEVICE_DRIVER_VERSION: u32 = 0x2502;
    pub const DEVICE_SERIAL_NUMBER: u32 = 0x2504;
    pub const OUTPUT_DOF: u32 = 0x2554;
    pub const CALIBRATION_STYLE: u32 = 0x2555;
    pub const NOMINAL_MAX_STIFFNESS: u32 = 0x2602;
    pub const NOMINAL_MAX_FORCE: u32 = 0x2603;
    pub const NOMINAL_MAX_CONTINUOUS_FORCE: u32 = 0x2604;
    pub const CURRENT_FORCE: u32 = 0x2700;
    pub const CURRENT_TORQUE: u32 = 0x2701;
}

pub mod capability {
    pub const FORCE_OUTPUT: u32 = 0x4000;
}

pub mod calibration {
    pub const OK: u32 = 0x5000;
    pub const NEEDS_MANUAL_INPUT: u32 = 0x5002;
    pub const STYLE_INKWELL: i32 = 4;
}

pub mod error {
    pub const INVALID_ENUM: u32 = 0x0100;
    pub const INVALID_OPERATION: u32 = 0x0102;
    pub const BAD_HANDLE: u32 = 0x0104;
    pub const WARM_MOTORS: u32 = 0x0200;
    pub const EXCEEDED_MAX_FORCE: u32 = 0x0201;
    pub const DEVICE_FAULT: u32 = 0x0300;
    pub const DEVICE_ALREADY_INITIATED: u32 = 0x0301;
    pub const COMMUNICATION: u32 = 0x0302;
    pub const TIMER: u32 = 0x0304;
    pub const ILLEGAL_BEGIN: u32 = 0x0400;
    pub const ILLEGAL_END: u32 = 0x0401;
    pub const FRAME: u32 = 0x0402;
}

pub const INVALID_HANDLE: u32 = 0xFFFF_FFFF;
