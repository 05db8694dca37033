//! Numbers of the interface.

pub mod parameter {
    pub const CURRENT_BUTTONS: u32 = 0x2000;
    pub const CURRENT_SAFETY_SWITCH: u32 = 0x2001;
    pub const CURRENT_INKWELL_SWITCH: u32 = 0x2002;
    pub const CURRENT_POSITION: u32 = 0x2050;
    pub const CURRENT_VELOCITY: u32 = 0x2051;
    pub const CURRENT_TRANSFORM: u32 = 0x2052;
    pub const CURRENT_ANGULAR_VELOCITY: u32 = 0x2053;
    pub const LAST_BUTTONS: u32 = 0x2200;
    pub const LAST_POSITION: u32 = 0x2250;
    pub const LAST_VELOCITY: u32 = 0x2251;
    pub const LAST_TRANSFORM: u32 = 0x2252;
    pub const VERSION: u32 = 0x2500;
    pub const DEVICE_MODEL_TYPE: u32 = 0x2501;
    pub const DEVICE_DRIVER_VERSION: u32 = 0x2502;
    pub const DEVICE_VENDOR: u32 = 0x2503;
    pub const DEVICE_SERIAL_NUMBER: u32 = 0x2504;
    pub const DEVICE_FIRMWARE_VERSION: u32 = 0x2505;
    pub const MAX_WORKSPACE_DIMENSIONS: u32 = 0x2550;
    pub const USABLE_WORKSPACE_DIMENSIONS: u32 = 0x2551;
    pub const TABLETOP_OFFSET: u32 = 0x2552;
    pub const INPUT_DOF: u32 = 0x2553;
    pub const OUTPUT_DOF: u32 = 0x2554;
    pub const CALIBRATION_STYLE: u32 = 0x2555;
    pub const UPDATE_RATE: u32 = 0x2600;
    pub const INSTANTANEOUS_UPDATE_RATE: u32 = 0x2601;
    pub const NOMINAL_MAX_STIFFNESS: u32 = 0x2602;
    pub const NOMINAL_MAX_FORCE: u32 = 0x2603;
    pub const NOMINAL_MAX_CONTINUOUS_FORCE: u32 = 0x2604;
    pub const MOTOR_TEMPERATURE: u32 = 0x2605;
    pub const SOFTWARE_VELOCITY_LIMIT: u32 = 0x2606;
    pub const SOFTWARE_FORCE_IMPULSE_LIMIT: u32 = 0x2607;
    pub const FORCE_RAMPING_RATE: u32 = 0x2608;
    pub const NOMINAL_MAX_DAMPING: u32 = 0x2609;
    pub const CURRENT_FORCE: u32 = 0x2700;
    pub const CURRENT_TORQUE: u32 = 0x2701;
    pub const CURRENT_JOINT_TORQUE: u32 = 0x2703;
    pub const CURRENT_MOTOR_DAC_VALUES: u32 = 0x2750;
    pub const LAST_FORCE: u32 = 0x2800;
}

pub mod capability {
    pub const FORCE_OUTPUT: u32 = 0x4000;
    pub const MAX_FORCE_CLAMPING: u32 = 0x4001;
    pub const FORCE_RAMPING: u32 = 0x4002;
    pub const SOFTWARE_FORCE_LIMIT: u32 = 0x4003;
    pub const ONE_FRAME_LIMIT: u32 = 0x4004;
    pub const SOFTWARE_VELOCITY_LIMIT: u32 = 0x2606;
    pub const SOFTWARE_FORCE_IMPULSE_LIMIT: u32 = 0x2607;
    pub const ALL: [u32; 7] = [
        FORCE_OUTPUT,
        MAX_FORCE_CLAMPING,
        FORCE_RAMPING,
        SOFTWARE_FORCE_LIMIT,
        ONE_FRAME_LIMIT,
        SOFTWARE_VELOCITY_LIMIT,
        SOFTWARE_FORCE_IMPULSE_LIMIT,
    ];
}

pub mod calibration {
    pub const OK: u32 = 0x5000;
    pub const NEEDS_MANUAL_INPUT: u32 = 0x5002;
    pub const STYLE_INKWELL: i32 = 4;
}

pub mod error {
    pub const INVALID_ENUM: u32 = 0x0100;
    pub const INVALID_VALUE: u32 = 0x0101;
    pub const INVALID_OPERATION: u32 = 0x0102;
    pub const INVALID_INPUT_TYPE: u32 = 0x0103;
    pub const BAD_HANDLE: u32 = 0x0104;
    pub const WARM_MOTORS: u32 = 0x0200;
    pub const EXCEEDED_MAX_FORCE: u32 = 0x0201;
    pub const EXCEEDED_MAX_FORCE_IMPULSE: u32 = 0x0202;
    pub const EXCEEDED_MAX_VELOCITY: u32 = 0x0203;
    pub const FORCE_ERROR: u32 = 0x0204;
    pub const DEVICE_FAULT: u32 = 0x0300;
    pub const DEVICE_ALREADY_INITIATED: u32 = 0x0301;
    pub const COMMUNICATION: u32 = 0x0302;
    pub const TIMER: u32 = 0x0304;
    pub const ILLEGAL_BEGIN: u32 = 0x0400;
    pub const ILLEGAL_END: u32 = 0x0401;
    pub const FRAME: u32 = 0x0402;
}

pub const INVALID_HANDLE: u32 = 0xFFFF_FFFF;
