//! Numbers of errors.

pub const NONE: i32 = 0;
pub const COMMUNICATION: i32 = 2;
pub const NO_DEVICE_FOUND: i32 = 5;
pub const NOT_AVAILABLE: i32 = 6;
pub const GEOMETRY: i32 = 8;
pub const EXPERT_MODE_DISABLED: i32 = 9;
pub const INVALID_INDEX: i32 = 15;
pub const NOT_ENABLED: i32 = 19;
pub const DEVICE_IN_USE: i32 = 20;
pub const INVALID: i32 = 21;
