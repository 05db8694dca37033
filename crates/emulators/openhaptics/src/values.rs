//! What is asked and set by number.

use std::ffi::{c_char, c_double, c_float, c_int, c_long};

use glam::DVec3;
use palpate_emulators::conformance::Disturbance;

use crate::device::{Device, from_vendor, to_vendor, transform};
use crate::numbers::{INVALID_HANDLE, calibration, error, parameter};
use crate::{scheduler, world};

/// Of which type a value is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Boolean,
    Integer,
    Real,
    Long,
}

/// Longest value.
const LONGEST: usize = 16;

/// A value: its type, its numbers and how many there are.
struct Value(Kind, [f64; LONGEST], usize);

fn real(numbers: &[f64]) -> Value {
    let mut all = [0.0; LONGEST];
    all[..numbers.len()].copy_from_slice(numbers);
    Value(Kind::Real, all, numbers.len())
}

fn of(kind: Kind, number: impl Into<f64>) -> Value {
    let Value(_, numbers, count) = real(&[number.into()]);
    Value(kind, numbers, count)
}

fn value(device: &Device, asked: u32) -> Option<Value> {
    let (now, last) = (&device.snapshot, &device.last);
    let millimetres = |v: DVec3| real(&(1e3 * to_vendor(v)).to_array());
    Some(match asked {
        parameter::CURRENT_BUTTONS => of(Kind::Integer, now.buttons),
        parameter::LAST_BUTTONS => of(Kind::Integer, last.buttons),
        parameter::CURRENT_SAFETY_SWITCH => of(Kind::Boolean, 1),
        // Out of the well, as one driver's author has measured it.
        parameter::CURRENT_INKWELL_SWITCH => of(Kind::Boolean, 1),
        parameter::CURRENT_POSITION => millimetres(now.tip.position),
        parameter::CURRENT_VELOCITY => millimetres(now.tip.velocity),
        parameter::CURRENT_TRANSFORM => real(&transform(&now.tip)),
        parameter::CURRENT_ANGULAR_VELOCITY => real(&to_vendor(now.tip.angular_velocity).to_array()),
        parameter::LAST_POSITION => millimetres(last.tip.position),
        parameter::LAST_VELOCITY => millimetres(last.tip.velocity),
        parameter::LAST_TRANSFORM => real(&transform(&last.tip)),
        parameter::DEVICE_FIRMWARE_VERSION => real(&[1.0]),
        parameter::MAX_WORKSPACE_DIMENSIONS => real(&[-210.0, -110.0, -85.0, 210.0, 205.0, 130.0]),
        parameter::USABLE_WORKSPACE_DIMENSIONS => real(&[-80.0, -60.0, -35.0, 80.0, 60.0, 35.0]),
        parameter::TABLETOP_OFFSET => real(&[-104.0]),
        parameter::INPUT_DOF => of(Kind::Integer, 6),
        parameter::OUTPUT_DOF => of(Kind::Integer, if device.has_torque { 6 } else { 3 }),
        parameter::CALIBRATION_STYLE => of(Kind::Integer, calibration::STYLE_INKWELL),
        parameter::UPDATE_RATE | parameter::INSTANTANEOUS_UPDATE_RATE => of(Kind::Integer, scheduler::rate()),
        parameter::NOMINAL_MAX_STIFFNESS => real(&[0.5]),
        parameter::NOMINAL_MAX_FORCE => real(&[device.limits.force]),
        parameter::NOMINAL_MAX_CONTINUOUS_FORCE => real(&[0.88]),
        parameter::MOTOR_TEMPERATURE => real(&[0.0; 3]),
        parameter::SOFTWARE_VELOCITY_LIMIT => real(&[device.limits.speed]),
        parameter::SOFTWARE_FORCE_IMPULSE_LIMIT => real(&[device.limits.impulse]),
        parameter::FORCE_RAMPING_RATE => real(&[device.limits.ramp]),
        parameter::NOMINAL_MAX_DAMPING => real(&[0.004]),
        parameter::CURRENT_FORCE => real(&to_vendor(device.commanded.force).to_array()),
        parameter::CURRENT_TORQUE => millimetres(device.commanded.torque),
        parameter::LAST_FORCE => real(&to_vendor(device.last_force).to_array()),
        parameter::CURRENT_MOTOR_DAC_VALUES => Value(Kind::Long, [0.0; LONGEST], 3),
        _ => return None,
    })
}

/// Numbers of a value of the current device, or an error on the stack.
fn numbers(asked: u32, kind: Kind) -> Option<([f64; LONGEST], usize)> {
    let mut world = world();
    let handle = world.current;
    let nonsense = world.talks_nonsense();
    let device = world.current()?;
    let found = value(device, asked);
    let broken = device.disturbance == Some(Disturbance::NotFinite);
    let Some(Value(is, mut numbers, count)) = found else {
        world.raise(error::INVALID_ENUM, handle);
        return None;
    };
    if is != kind {
        world.raise(error::INVALID_INPUT_TYPE, handle);
        return None;
    }
    match asked {
        parameter::CURRENT_POSITION if broken => numbers[0] = f64::NAN,
        parameter::CURRENT_TRANSFORM if broken => numbers[12] = f64::NAN,
        _ => (),
    }
    if nonsense && world.bits().is_multiple_of(2) {
        numbers[..count].fill_with(|| world.number());
    }
    Some((numbers, count))
}

macro_rules! getters {
    ($($name:ident: $type:ty = $kind:expr, $convert:expr;)*) => {
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "system" fn $name(asked: u32, values: *mut $type) {
                let Some((numbers, count)) = numbers(asked, $kind) else { return };
                if !values.is_null() {
                    for (entry, number) in numbers[..count].iter().enumerate() {
                        // SAFETY: not null, and by the caller as many as are documented.
                        unsafe { values.add(entry).write($convert(*number)) };
                    }
                }
            }
        )*
    };
}

getters! {
    hdGetBooleanv: u8 = Kind::Boolean, |number: f64| u8::from(number != 0.0);
    hdGetIntegerv: c_int = Kind::Integer, |number: f64| number as c_int;
    hdGetFloatv: c_float = Kind::Real, |number: f64| number as c_float;
    hdGetDoublev: c_double = Kind::Real, |number: f64| number;
    hdGetLongv: c_long = Kind::Long, |number: f64| number as c_long;
}

/// Null where there is none.
#[unsafe(no_mangle)]
pub extern "system" fn hdGetString(asked: u32) -> *const c_char {
    let mut world = world();
    if world.talks_nonsense() {
        return std::ptr::null();
    }
    let handle = world.current;
    let old = world.devices.iter().any(|device| device.disturbance == Some(Disturbance::WrongVersion));
    let text = match (asked, world.current()) {
        (parameter::VERSION, _) if old => c"2.0.9".as_ptr(),
        (parameter::VERSION, _) => c"3.4.0".as_ptr(),
        (parameter::DEVICE_DRIVER_VERSION, Some(_)) => c"4.3".as_ptr(),
        (parameter::DEVICE_VENDOR, Some(_)) => c"emulated".as_ptr(),
        (parameter::DEVICE_SERIAL_NUMBER, Some(_)) => c"E0001".as_ptr(),
        (parameter::DEVICE_MODEL_TYPE, Some(device)) => device.model.as_ptr(),
        _ => std::ptr::null(),
    };
    if text.is_null() {
        world.raise(error::INVALID_ENUM, handle);
    }
    text
}

/// Three numbers, set within a frame; of limits one.
fn set(asked: u32, numbers: [f64; 3], limit: f64) {
    let mut world = world();
    let handle = world.current;
    let Some(device) = world.current() else { return };
    let vector = from_vendor(DVec3::from_array(numbers));
    let framed = device.is_framed();
    let set = match asked {
        parameter::CURRENT_FORCE if framed => {
            (device.commanded.force, device.commanded.at_tip) = (vector, true);
            Ok(())
        }
        parameter::CURRENT_TORQUE if framed => {
            (device.commanded.torque, device.commanded.at_tip) = (1e-3 * vector, true);
            Ok(())
        }
        // Torques of single motors take the place of a force at the tip, which here they do not make.
        parameter::CURRENT_JOINT_TORQUE if framed => {
            device.commanded.force = DVec3::ZERO;
            Ok(())
        }
        parameter::CURRENT_FORCE | parameter::CURRENT_TORQUE | parameter::CURRENT_JOINT_TORQUE => Err(error::FRAME),
        parameter::SOFTWARE_VELOCITY_LIMIT
        | parameter::SOFTWARE_FORCE_IMPULSE_LIMIT
        | parameter::FORCE_RAMPING_RATE
            if limit.is_nan() || limit <= 0.0 =>
        {
            Err(error::INVALID_VALUE)
        }
        parameter::SOFTWARE_VELOCITY_LIMIT => {
            device.limits.speed = limit;
            Ok(())
        }
        parameter::SOFTWARE_FORCE_IMPULSE_LIMIT => {
            device.limits.impulse = limit;
            Ok(())
        }
        parameter::FORCE_RAMPING_RATE => {
            device.limits.ramp = limit;
            Ok(())
        }
        _ => Err(error::INVALID_ENUM),
    };
    if let Err(code) = set {
        world.raise(code, handle);
    }
}

/// Whether a parameter that is set is a vector.
fn is_vector(asked: u32) -> bool {
    matches!(asked, parameter::CURRENT_FORCE | parameter::CURRENT_TORQUE | parameter::CURRENT_JOINT_TORQUE)
}

macro_rules! setters {
    ($($name:ident: $type:ty;)*) => {
        $(
            #[unsafe(no_mangle)]
            pub unsafe extern "system" fn $name(asked: u32, values: *const $type) {
                if values.is_null() {
                    return world().raise(error::INVALID_VALUE, INVALID_HANDLE);
                }
                // SAFETY: not null, and by the caller as many as are documented: three or one.
                let number = |entry: usize| f64::from(unsafe { values.add(entry).read() });
                let numbers = if is_vector(asked) { [number(0), number(1), number(2)] } else { [0.0; 3] };
                set(asked, numbers, number(0));
            }
        )*
    };
}

setters! {
    hdSetFloatv: c_float;
    hdSetDoublev: c_double;
}

/// Motors one by one: in a frame with a force at the tip an error of forces.
#[unsafe(no_mangle)]
pub extern "system" fn hdSetLongv(asked: u32, _values: *const c_long) {
    let mut world = world();
    let handle = world.current;
    match (asked, world.current()) {
        (parameter::CURRENT_MOTOR_DAC_VALUES, Some(device)) if device.is_framed() => device.commanded.motors = true,
        (parameter::CURRENT_MOTOR_DAC_VALUES, Some(_)) => world.raise(error::FRAME, handle),
        _ => world.raise(error::INVALID_ENUM, handle),
    }
}

/// Nothing can be set by these.
#[unsafe(no_mangle)]
pub extern "system" fn hdSetBooleanv(_asked: u32, _values: *const u8) {
    world().raise(error::INVALID_ENUM, INVALID_HANDLE);
}

#[unsafe(no_mangle)]
pub extern "system" fn hdSetIntegerv(_asked: u32, _values: *const c_int) {
    world().raise(error::INVALID_ENUM, INVALID_HANDLE);
}
