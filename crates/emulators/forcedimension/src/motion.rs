//! Functions that read positions and write forces.

use std::ffi::{c_char, c_double, c_int};

use glam::DVec3;
use palpate_emulators::conformance::Disturbance;

use crate::device::{Device, from_vendor, rows, to_vendor};
use crate::error;
use crate::world::{perhaps_nonsense, vector, with};

/// The values are those of the last call.
const TIMEGUARD: c_int = 1;
const MOTOR_SATURATED: c_int = 2;

/// Writes three numbers, if there is room for them.
///
/// # Safety
/// Each pointer is null or to a number of the caller.
unsafe fn put(places: [*mut c_double; 3], (code, values): (c_int, [f64; 3])) -> c_int {
    if code >= 0 {
        for (place, value) in places.into_iter().zip(values) {
            if !place.is_null() {
                // SAFETY: not null, and by the caller a number.
                unsafe { place.write(value) };
            }
        }
    }
    code
}

fn get(id: c_char, of: impl FnOnce(&mut Device) -> Result<([f64; 3], c_int), c_int>) -> (c_int, [f64; 3]) {
    let (code, mut values) = vector(id, of);
    (perhaps_nonsense(id, code, &mut values), values)
}

fn position(device: &mut Device) -> Result<([f64; 3], c_int), c_int> {
    let (tip, cached) = device.measure()?;
    let mut position = to_vendor(tip.position);
    if device.disturbance == Some(Disturbance::NotFinite) {
        position.y = f64::NAN;
    }
    Ok((position.to_array(), if cached { TIMEGUARD } else { 0 }))
}

#[unsafe(no_mangle)]
pub unsafe extern "system" fn dhdGetPosition(
    x: *mut c_double,
    y: *mut c_double,
    z: *mut c_double,
    id: c_char,
) -> c_int {
    // SAFETY: by the caller.
    unsafe { put([x, y, z], get(id, position)) }
}

#[unsafe(no_mangle)]
pub unsafe extern "system" fn dhdGetLinearVelocity(
    x: *mut c_double,
    y: *mut c_double,
    z: *mut c_double,
    id: c_char,
) -> c_int {
    // SAFETY: by the caller.
    unsafe { put([x, y, z], get(id, |device| Ok((to_vendor(device.latest()?.velocity).to_array(), 0)))) }
}

#[unsafe(no_mangle)]
pub unsafe extern "system" fn dhdGetAngularVelocityRad(
    x: *mut c_double,
    y: *mut c_double,
    z: *mut c_double,
    id: c_char,
) -> c_int {
    // SAFETY: by the caller.
    unsafe { put([x, y, z], get(id, |device| Ok((to_vendor(device.latest()?.angular_velocity).to_array(), 0)))) }
}

/// Nine numbers, row by row.
#[unsafe(no_mangle)]
pub unsafe extern "system" fn dhdGetOrientationFrame(matrix: *mut [[c_double; 3]; 3], id: c_char) -> c_int {
    let mut frame = [[0.0; 3]; 3];
    let code = with(id, |device| {
        frame = rows(&device.latest()?);
        if matrix.is_null() { Err(error::NULL_ARGUMENT) } else { Ok(0) }
    });
    let code = perhaps_nonsense(id, code, frame.as_flattened_mut());
    if code >= 0 && !matrix.is_null() {
        // SAFETY: not null, and by the caller nine numbers.
        unsafe { matrix.write(frame) };
    }
    code
}

#[unsafe(no_mangle)]
pub unsafe extern "system" fn dhdGetPositionAndOrientationFrame(
    x: *mut c_double,
    y: *mut c_double,
    z: *mut c_double,
    matrix: *mut [[c_double; 3]; 3],
    id: c_char,
) -> c_int {
    // SAFETY: by the caller; so below.
    let code = unsafe { dhdGetPosition(x, y, z, id) };
    // SAFETY: as above.
    let turned = unsafe { dhdGetOrientationFrame(matrix, id) };
    if code < 0 { code } else { turned.min(code) }
}

fn tell(id: c_char, force: DVec3, torque: DVec3) -> c_int {
    let code = with(id, |device| {
        let torque = if device.model.active_wrist { torque } else { DVec3::ZERO };
        let saturated = device.tell(from_vendor(force), from_vendor(torque))?;
        Ok(if saturated { MOTOR_SATURATED } else { 0 })
    });
    perhaps_nonsense(id, code, &mut [])
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdSetForce(x: c_double, y: c_double, z: c_double, id: c_char) -> c_int {
    tell(id, DVec3::new(x, y, z), DVec3::ZERO)
}

#[unsafe(no_mangle)]
pub extern "system" fn dhdSetForceAndTorque(
    x: c_double,
    y: c_double,
    z: c_double,
    about_x: c_double,
    about_y: c_double,
    about_z: c_double,
    id: c_char,
) -> c_int {
    tell(id, DVec3::new(x, y, z), DVec3::new(about_x, about_y, about_z))
}

/// The gripper has no motor here.
#[unsafe(no_mangle)]
#[allow(clippy::too_many_arguments)] // The vendor's.
pub extern "system" fn dhdSetForceAndTorqueAndGripperForce(
    x: c_double,
    y: c_double,
    z: c_double,
    about_x: c_double,
    about_y: c_double,
    about_z: c_double,
    _gripper: c_double,
    id: c_char,
) -> c_int {
    dhdSetForceAndTorque(x, y, z, about_x, about_y, about_z, id)
}

#[unsafe(no_mangle)]
pub unsafe extern "system" fn dhdGetForce(x: *mut c_double, y: *mut c_double, z: *mut c_double, id: c_char) -> c_int {
    // SAFETY: by the caller.
    unsafe { put([x, y, z], get(id, |device| Ok((to_vendor(device.motors().0).to_array(), 0)))) }
}
