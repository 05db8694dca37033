//! Models that can be emulated.

use std::ffi::CStr;

use palpate_devices::emulated::{Mechanics, known};

/// What is known of a model.
#[derive(Clone, Copy, Debug)]
pub struct Model {
    pub name: &'static CStr,
    pub system_type: i32,
    pub wrist: bool,
    pub active_wrist: bool,
    pub mechanics: Mechanics,
}

/// The model of a name.
pub fn model(name: &str) -> Option<Model> {
    let (name, system_type, wrist, active_wrist, mechanics) = match name {
        "omega.3" => (c"omega.3", 33, false, false, "omega"),
        "omega.6" => (c"omega.6 (right)", 34, true, false, "omega"),
        "omega.7" => (c"omega.7 (right)", 35, true, false, "omega"),
        "delta.3" => (c"delta.3", 63, false, false, "omega"),
        "sigma.7" => (c"sigma.7 (right)", 104, true, true, "sigma.7"),
        "lambda.7" => (c"lambda.7 (right)", 108, true, true, "lambda.7"),
        "falcon" => (c"Novint Falcon", 60, false, false, "Falcon"),
        _ => return None,
    };
    Some(Model { name, system_type, wrist, active_wrist, mechanics: known::mechanics(mechanics)? })
}
