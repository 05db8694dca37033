//! Models by the string of `HD_DEVICE_MODEL_TYPE`.

use crate::{DeviceLimits, known};

/// Limits of a model. One that is not known renders what the weakest does; `nominal_force` is what the library says of it, N.
pub fn limits(model: &str, nominal_force: f64) -> DeviceLimits {
    let known = match model {
        "PHANTOM Omni" => known::PHANTOM_OMNI,
        "PHANTOM Desktop" => known::PHANTOM_DESKTOP,
        "PHANTOM Premium 1.5 6DOF" => known::PHANTOM_PREMIUM_1_5,
        "PHANTOM Premium 3.0 6DOF" => known::PHANTOM_PREMIUM_3_0,
        _ => known::TOUCH,
    };
    let nominal = if nominal_force > 0.0 { nominal_force } else { f64::INFINITY };
    DeviceLimits { max_force: known.max_force.min(nominal), rate: Some(1000.0), ..known }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weaker_of_what_is_known_and_what_is_said_counts() {
        assert_eq!(limits("Touch", 3.3).max_force, 3.3);
        assert_eq!(limits("PHANTOM Desktop", 6.0).max_force, 6.0);
        assert_eq!(limits("PHANTOM Desktop", 60.0).max_force, 7.9);
        assert_eq!(limits("Something new", f64::NAN), DeviceLimits { rate: Some(1000.0), ..known::TOUCH });
    }
}
