//! Structs of the C interface that may gain members: the first one is the size with which the caller was compiled.
//!
//! A longer library reads what an older program does not know of as its default, and writes no further than that program's
//! struct reaches. A longer struct of a newer program is refused: this library could not obey what stands in it.
#![allow(unsafe_code)] // bytes are copied into and out of structs of callers

use std::ptr::copy_nonoverlapping;

use crate::arguments::{null, shared};
use crate::status::{Outcome, Refusal};

/// A struct that may grow.
///
/// # Safety
/// It is plain data of which every bit pattern is valid, its first member is `struct_size: u32`, and its default has the own
/// size there.
pub unsafe trait VersionedStruct: Copy + Default {
    /// Its name in C.
    const NAME: &str;
    /// Its size when it came into the interface, as a number that never changes: no program has a shorter one.
    const FIRST_SIZE: usize;
}

/// All of it zero, but for its own size.
pub fn zeroed<T: VersionedStruct>() -> T {
    // SAFETY: every bit pattern is a valid `T`.
    let mut value: T = unsafe { std::mem::zeroed() };
    // SAFETY: its first member.
    unsafe { (&raw mut value).cast::<u32>().write(size_of::<T>() as u32) };
    value
}

fn check<T: VersionedStruct>(size: usize) -> Outcome<usize> {
    const { assert!(T::FIRST_SIZE <= size_of::<T>(), "a struct may grow, not shrink") };
    let own = size_of::<T>();
    match size {
        _ if (T::FIRST_SIZE..=own).contains(&size) => Ok(size),
        _ if size > own => Err(Refusal::argument(format!(
            "{} has {size} bytes, this library knows {own}: the program was compiled with a newer palpate.h",
            T::NAME
        ))),
        _ => Err(Refusal::argument(format!("struct_size of {} is {size}: set it to sizeof({})", T::NAME, T::NAME))),
    }
}

/// What a caller has given; defaults where its struct ends.
///
/// # Safety
/// The pointer is null or points to a struct of the size that it states.
pub unsafe fn read<T: VersionedStruct>(from: *const T) -> Outcome<T> {
    // SAFETY: the first member of the caller's struct.
    let size = check::<T>(*unsafe { shared(from.cast::<u32>(), T::NAME) }? as usize)?;
    let mut own = T::default();
    // SAFETY: `size` bytes are within both; every bit pattern is a valid `T`.
    unsafe { copy_nonoverlapping(from.cast::<u8>(), (&raw mut own).cast::<u8>(), size) };
    Ok(own)
}

/// The same, with defaults for a null pointer.
///
/// # Safety
/// See [`read`].
pub unsafe fn read_or_default<T: VersionedStruct>(from: *const T) -> Outcome<T> {
    if from.is_null() {
        return Ok(T::default());
    }
    // SAFETY: by the caller.
    unsafe { read(from) }
}

/// As much of an answer as the caller's struct takes.
///
/// # Safety
/// The pointer is null or points to a struct of the size that it states.
pub unsafe fn write<T: VersionedStruct>(value: &T, to: *mut T) -> Outcome {
    // SAFETY: the first member of the caller's struct.
    let stated_size = *unsafe { shared(to.cast::<u32>(), T::NAME) }? as usize;
    // SAFETY: it has the size that it states.
    unsafe { write_as(value, to, stated_size) }
}

/// The same into a struct of which the size is told beside it.
///
/// # Safety
/// The pointer is null or points to `size` bytes.
pub unsafe fn write_as<T: VersionedStruct>(value: &T, to: *mut T, size: usize) -> Outcome {
    if to.is_null() {
        return Err(null(T::NAME));
    }
    let size = check::<T>(size)?;
    // SAFETY: `size` bytes are within both.
    unsafe { copy_nonoverlapping((&raw const *value).cast::<u8>(), to.cast::<u8>(), size) };
    // SAFETY: the first member of the caller's struct; `size` fits, for it is at most that of `T`.
    unsafe { to.cast::<u32>().write(size as u32) };
    Ok(())
}
