//! Models that can be emulated.

use palpate_devices::emulated::{Mechanics, known};

/// What is told of a model.
#[derive(Clone, Copy, Debug)]
pub struct Model {
    /// As the library says it, with its zero.
    pub name: &'static std::ffi::CStr,
    pub system_type: i32,
    pub wrist: bool,
    pub active_wrist: bool,
    pub gripper: bool,
    /// N, beyond which motors saturate.
    pub max_force: f64,
    /// N m.
    pub max_torque: f64,
    pub mechanics: Mechanics,
}

/// By name; `None` for one that nobody has.
pub fn model(name: &str) -> Option<Model> {
    let (said, system_type, wrist, active_wrist, max_force, max_torque, mechanics) = match name {
        "omega.3" => (c"omega.3", 33, false, false, 12.0, 0.0, "omega"),
        "omega.6" => (c"omega.6 (right)", 34, true, false, 12.0, 0.0, "omega"),
        "omega.7" => (c"omega.7 (right)", 35, true, false, 12.0, 0.0, "omega"),
        "delta.3" => (c"delta.3", 63, false, false, 20.0, 0.0, "omega"),
        "sigma.7" => (c"sigma.7 (right)", 104, true, true, 12.0, 0.2, "sigma.7"),
        "lambda.7" => (c"lambda.7 (right)", 108, true, true, 12.0, 0.2, "lambda.7"),
        "falcon" => (c"Novint Falcon", 60, false, false, 8.0, 0.0, "Falcon"),
        _ => return None,
    };
    let gripper = name.ends_with(".7");
    let mechanics = known::mechanics(mechanics)?;
    Some(Model { name: said, system_type, wrist, active_wrist, gripper, max_force, max_torque, mechanics })
}

/// What is plugged in when nobody says.
pub const USUAL: &str = "omega.6";
