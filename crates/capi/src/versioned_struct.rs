//! Structs of the C interface that may gain members: the first one is the size with which the caller was compiled.
//!
//! A longer library reads what an older program does not know of as its default, and writes no further than that program's
//! struct reaches. A longer struct of a newer program is refused: this library could not obey what stands in it.
#![allow(unsafe_code)] // bytes are copied into and out of structs of callers

use std::ptr::copy_nonoverlapping;

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
    if from.is_null() {
        return Err(Refusal::argument(format!("{} is a null pointer", T::NAME)));
    }
    // SAFETY: the first member of the caller's struct.
    let size = check::<T>(unsafe { from.cast::<u32>().read() } as usize)?;
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
    if to.is_null() {
        return Err(Refusal::argument(format!("{} is a null pointer", T::NAME)));
    }
    // SAFETY: the first member of the caller's struct.
    let stated_size = unsafe { to.cast::<u32>().read() };
    // SAFETY: it has the size that it states.
    unsafe { write_as(value, to, stated_size as usize) }
}

/// The same into a struct of which the size is told beside it.
///
/// # Safety
/// The pointer is null or points to `size` bytes.
pub unsafe fn write_as<T: VersionedStruct>(value: &T, to: *mut T, size: usize) -> Outcome {
    if to.is_null() {
        return Err(Refusal::argument(format!("{} is a null pointer", T::NAME)));
    }
    let size = check::<T>(size)?;
    // SAFETY: `size` bytes are within both.
    unsafe { copy_nonoverlapping((&raw const *value).cast::<u8>(), to.cast::<u8>(), size) };
    // SAFETY: the first member of the caller's struct; `size` fits, for it is at most that of `T`.
    unsafe { to.cast::<u32>().write(size as u32) };
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::status::Status;

    /// A struct of two numbers that has grown by a third one.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, PartialEq)]
    struct NewerStruct {
        struct_size: u32,
        first: u32,
        second: f64,
        added: f64,
    }

    impl Default for NewerStruct {
        fn default() -> Self {
            Self { struct_size: size_of::<Self>() as u32, first: 1, second: 2.0, added: 3.0 }
        }
    }

    // SAFETY: numbers only; the size comes first.
    unsafe impl VersionedStruct for NewerStruct {
        const NAME: &str = "grown";
        const FIRST_SIZE: usize = 16;
    }

    /// What an older program has, and memory behind it that is not the struct's.
    #[repr(C)]
    struct OlderStruct {
        struct_size: u32,
        first: u32,
        second: f64,
        behind: f64,
    }

    #[test]
    fn an_older_struct_is_read_and_filled_as_far_as_it_reaches() {
        let mut older = OlderStruct { struct_size: 16, first: 7, second: 8.0, behind: 9.0 };
        // SAFETY: 16 bytes are there.
        let read = unsafe { read((&raw const older).cast::<NewerStruct>()) }.expect("an older struct");
        assert_eq!(read, NewerStruct { struct_size: 16, first: 7, second: 8.0, added: 3.0 });
        let answer = NewerStruct { first: 4, second: 5.0, added: 6.0, ..NewerStruct::default() };
        // SAFETY: 16 bytes are there.
        unsafe { write(&answer, (&raw mut older).cast::<NewerStruct>()) }.expect("an older struct");
        assert_eq!((older.struct_size, older.first, older.second, older.behind), (16, 4, 5.0, 9.0));
        // SAFETY: 16 bytes are there.
        unsafe { write_as(&NewerStruct::default(), (&raw mut older).cast::<NewerStruct>(), 16) }
            .expect("an older struct");
        assert_eq!((older.struct_size, older.first, older.second, older.behind), (16, 1, 2.0, 9.0));
    }

    #[test]
    fn a_newer_struct_and_none_at_all_are_refused() {
        for (size, words) in [(32, "newer palpate.h"), (15, "set it to sizeof(grown)"), (0, "sizeof(grown)")] {
            let mut stated_size = NewerStruct { struct_size: size, ..NewerStruct::default() };
            // SAFETY: refused by its size alone.
            let refusals = unsafe {
                [read(&raw const stated_size).err(), write(&NewerStruct::default(), &raw mut stated_size).err()]
            };
            for refusal in refusals {
                let refusal = refusal.expect("refused");
                assert_eq!(refusal.status, Status::PalpateErrorArgument);
                assert!(refusal.message.contains(words), "{}", refusal.message);
            }
        }
    }
}
