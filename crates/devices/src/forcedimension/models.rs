//! Models by the numbers of `dhdGetSystemType`.

use std::ffi::c_int;

use crate::{DeviceLimits, known};

/// What is known of a model.
pub struct Model {
    pub name: &'static str,
    pub limits: DeviceLimits,
}

/// A model; one that is not known renders what the weakest does.
pub fn model(system_type: c_int) -> Model {
    let (name, limits) = match system_type {
        33 => ("omega.3", known::OMEGA),
        34 | 36 => ("omega.6", known::OMEGA),
        35 | 37 => ("omega.7", known::OMEGA),
        60 => ("Novint Falcon", known::FALCON),
        63 => ("delta.3", known::DELTA),
        // Without the wrist of the .7.
        203 => ("lambda.3", DeviceLimits { max_torque: 0.0, max_angular_damping: 0.0, ..known::LAMBDA }),
        131 | 132 => ("lambda.6", DeviceLimits { max_torque: 0.0, max_angular_damping: 0.0, ..known::LAMBDA }),
        108 | 109 => ("lambda.7", known::LAMBDA),
        206 => ("sigma.3", DeviceLimits { max_torque: 0.0, max_angular_damping: 0.0, ..known::SIGMA }),
        104 | 105 => ("sigma.7", known::SIGMA),
        _ => ("device of an unknown model", known::FALCON),
    };
    Model { name, limits }
}
