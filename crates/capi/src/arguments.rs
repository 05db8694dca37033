//! Conversion of C pointers to references and slices. A null pointer is an error that names the argument.
#![allow(unsafe_code)] // raw pointers of callers, who answer for what they point to

use std::ffi::{CStr, c_char};
use std::path::Path;

use crate::status::{Outcome, Refusal};

/// Refusal of a null pointer.
pub fn null(name: &str) -> Refusal {
    Refusal::argument(format!("{name} is a null pointer"))
}

/// Refuses a length in bytes that nothing in memory has, and no slice may have.
fn require_size<T>(count: usize, name: &str) -> Outcome {
    match count.checked_mul(size_of::<T>()) {
        Some(bytes) if bytes <= isize::MAX as usize => Ok(()),
        _ => Err(Refusal::argument(format!("{name} has {count} elements, more than memory holds"))),
    }
}

/// An object behind a handle.
///
/// # Safety
/// The pointer is null or points to a living object.
pub unsafe fn shared<'a, T>(pointer: *const T, name: &str) -> Outcome<&'a T> {
    // SAFETY: the caller's.
    unsafe { pointer.as_ref() }.ok_or_else(|| null(name))
}

/// An object behind a handle or a place for an answer, to be changed.
///
/// # Safety
/// The pointer is null or points to a living object that nobody else uses meanwhile.
pub unsafe fn exclusive<'a, T>(pointer: *mut T, name: &str) -> Outcome<&'a mut T> {
    // SAFETY: the caller's.
    unsafe { pointer.as_mut() }.ok_or_else(|| null(name))
}

/// An array to read; none may be null.
///
/// # Safety
/// The pointer is null or points to `count` elements.
pub unsafe fn array<'a, T>(pointer: *const T, count: usize, name: &str) -> Outcome<&'a [T]> {
    require_size::<T>(count, name)?;
    match count {
        0 => Ok(&[]),
        _ if pointer.is_null() => Err(null(name)),
        // SAFETY: the caller's; not null.
        _ => Ok(unsafe { std::slice::from_raw_parts(pointer, count) }),
    }
}

/// An array to fill.
///
/// # Safety
/// The pointer is null or points to `count` elements that nobody else uses meanwhile.
pub unsafe fn array_mut<'a, T>(pointer: *mut T, count: usize, name: &str) -> Outcome<&'a mut [T]> {
    require_size::<T>(count, name)?;
    match count {
        0 => Ok(&mut []),
        _ if pointer.is_null() => Err(null(name)),
        // SAFETY: the caller's; not null.
        _ => Ok(unsafe { std::slice::from_raw_parts_mut(pointer, count) }),
    }
}

/// An array that may be left out.
///
/// # Safety
/// As of [`array_mut`].
pub unsafe fn optional_mut<'a, T>(pointer: *mut T, count: usize) -> Option<&'a mut [T]> {
    // SAFETY: the caller's; not null.
    (!pointer.is_null()).then(|| unsafe { std::slice::from_raw_parts_mut(pointer, count) })
}

/// Text.
///
/// # Safety
/// The pointer is null or points to a text with a zero at its end.
pub unsafe fn text<'a>(pointer: *const c_char, name: &str) -> Outcome<&'a str> {
    if pointer.is_null() {
        return Err(null(name));
    }
    // SAFETY: the caller's; not null.
    unsafe { CStr::from_ptr(pointer) }.to_str().map_err(|_| Refusal::argument(format!("{name} is not UTF-8")))
}

/// A path.
///
/// # Safety
/// As of [`text`].
pub unsafe fn path<'a>(pointer: *const c_char, name: &str) -> Outcome<&'a Path> {
    // SAFETY: the caller's.
    unsafe { text(pointer, name) }.map(Path::new)
}

/// Moves an object to the heap and stores its pointer for the caller.
///
/// # Safety
/// The place is null or may be written.
pub unsafe fn store_handle<T>(object: T, place: *mut *mut T, name: &str) -> Outcome {
    if place.is_null() {
        return Err(null(name));
    }
    // SAFETY: the caller's; not null.
    unsafe { place.write(Box::into_raw(Box::new(object))) };
    Ok(())
}

/// Frees an object; nothing for null.
///
/// # Safety
/// The pointer is null or came from [`store_handle`], and nobody uses it any more.
pub unsafe fn free_handle<T>(pointer: *mut T) -> Outcome {
    if !pointer.is_null() {
        // SAFETY: the caller's.
        drop(unsafe { Box::from_raw(pointer) });
    }
    Ok(())
}

/// Refuses a length other than the one that there is.
///
/// # Errors
/// Both lengths, by name.
pub fn require_count(name: &str, given: usize, wanted: usize) -> Outcome {
    match given == wanted {
        true => Ok(()),
        false => Err(Refusal::argument(format!("{name} is {given}, it must be {wanted}"))),
    }
}
