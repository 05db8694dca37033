//! C functions of the module: memory, files, one session, and what it answers.
//!
//! A call that fails returns -1, and its reason is the answer's text. Answers stay in place until the next call.
#![allow(unsafe_code)] // pointers into this module's memory, and names without mangling

use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

use palpate_core::{Error, Result, files};

use crate::command::Command;
use crate::session::Session;
use crate::{frame, run};

/// Where the files of the scene are provided.
const FOLDER: &str = "scene";
/// What the names of files of contacts end with.
const CONTACTS: &str = ".contact.palpate";

#[derive(Default)]
struct Module {
    session: Option<Session>,
    text: Vec<u8>,
    numbers: Vec<f64>,
}

static MODULE: Mutex<Option<Module>> = Mutex::new(None);

fn module() -> MutexGuard<'static, Option<Module>> {
    MODULE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Does something with the module: 0, or -1 with the reason as text.
fn with_module(work: impl FnOnce(&mut Module) -> Result<()>) -> i32 {
    let mut module = module();
    let module = module.get_or_insert_default();
    match work(module) {
        Ok(()) => 0,
        Err(error) => {
            module.text = error.to_string().into_bytes();
            -1
        }
    }
}

/// The same with its session, and where its texts and numbers go.
fn with_session(work: impl FnOnce(&mut Session, &mut Vec<u8>, &mut Vec<f64>) -> Result<()>) -> i32 {
    with_module(|Module { session, text, numbers }| {
        let none = || Error::Invalid("no scene is open".into());
        work(session.as_mut().ok_or_else(none)?, text, numbers)
    })
}

/// Memory of `length` bytes, aligned for numbers.
#[unsafe(no_mangle)]
pub extern "C" fn palpate_alloc(length: usize) -> *mut u8 {
    let words = vec![0u64; length.div_ceil(8)];
    Box::leak(words.into_boxed_slice()).as_mut_ptr().cast()
}

/// Gives memory of [`palpate_alloc`] back.
///
/// # Safety
/// A pointer that [`palpate_alloc`] gave for that length, once.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_free(pointer: *mut u8, length: usize) {
    let words = std::ptr::slice_from_raw_parts_mut(pointer.cast::<u64>(), length.div_ceil(8));
    // SAFETY: by the caller.
    drop(unsafe { Box::from_raw(words) });
}

/// Provides a file of the scene.
///
/// # Safety
/// Names and bytes within this module's memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_provide(name: *const u8, name_length: usize, bytes: *const u8, length: usize) {
    // SAFETY: by the caller.
    let (name, bytes) =
        unsafe { (std::slice::from_raw_parts(name, name_length), std::slice::from_raw_parts(bytes, length)) };
    files::provide(Path::new(FOLDER).join(&*String::from_utf8_lossy(name)), bytes.to_vec());
}

/// Opens the scene whose files were provided, and forgets them but for those of contacts, which other tools may need.
#[unsafe(no_mangle)]
pub extern "C" fn palpate_open() -> i32 {
    let opened = Session::open(&Path::new(FOLDER).join("scene.json"));
    files::keep_provided(|path| path.to_string_lossy().ends_with(CONTACTS));
    with_module(|module| {
        module.session = Some(opened?);
        Ok(())
    })
}

/// Carries out a command in JSON.
///
/// # Safety
/// A text within this module's memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_command(text: *const u8, length: usize) -> i32 {
    // SAFETY: by the caller.
    let text = unsafe { std::slice::from_raw_parts(text, length) };
    with_session(|session, _, _| {
        let command = serde_json::from_slice::<Command>(text).map_err(|error| Error::Invalid(error.to_string()))?;
        command.apply(session)
    })
}

/// Makes the ticks that are due at a time of the page's clock, ms; how many.
#[unsafe(no_mangle)]
pub extern "C" fn palpate_advance(now_ms: f64) -> u32 {
    let mut module = module();
    let session = module.as_mut().and_then(|module| module.session.as_mut());
    session.map_or(0, |session| session.advance((1e6 * now_ms) as u64) as u32)
}

/// The latest tick, as text.
#[unsafe(no_mangle)]
pub extern "C" fn palpate_frame() -> i32 {
    with_session(|session, text, _| {
        *text = frame::frame(session).to_string().into_bytes();
        Ok(())
    })
}

/// Displacements of a body's surface, as numbers.
#[unsafe(no_mangle)]
pub extern "C" fn palpate_displacements(body: usize) -> i32 {
    with_session(|session, _, numbers| {
        *numbers = frame::displacements(session, body);
        Ok(())
    })
}

/// Rows of the log since the last call, as numbers.
#[unsafe(no_mangle)]
pub extern "C" fn palpate_log(body: usize) -> i32 {
    with_session(|session, _, numbers| {
        *numbers = frame::log(session, body);
        Ok(())
    })
}

/// Forces at given positions (three numbers each), as numbers.
///
/// # Safety
/// Numbers within this module's memory, aligned.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_run(positions: *const f64, count: usize) -> i32 {
    // SAFETY: by the caller.
    let positions = unsafe { std::slice::from_raw_parts(positions, count) };
    with_session(|session, _, numbers| {
        *numbers = run::forces(session, positions)?;
        Ok(())
    })
}

/// Times of ticks and forces on devices at given positions of all tools (three numbers each), as numbers; see
/// [`run::times`].
///
/// # Safety
/// Numbers within this module's memory, aligned; four of the orientation.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn palpate_times(positions: *const f64, count: usize, orientation: *const [f64; 4]) -> i32 {
    // SAFETY: by the caller.
    let (positions, orientation) = unsafe { (std::slice::from_raw_parts(positions, count), *orientation) };
    with_session(|session, _, numbers| {
        *numbers = run::times(session, positions, orientation)?;
        Ok(())
    })
}

/// Ends the recording: the bytes of its file, as text.
#[unsafe(no_mangle)]
pub extern "C" fn palpate_end_recording() -> i32 {
    with_session(|session, text, _| {
        *text = session.end_recording()?;
        Ok(())
    })
}

/// Text of the last answer.
#[unsafe(no_mangle)]
pub extern "C" fn palpate_text() -> *const u8 {
    module().get_or_insert_default().text.as_ptr()
}

/// Bytes of the text.
#[unsafe(no_mangle)]
pub extern "C" fn palpate_text_length() -> usize {
    module().get_or_insert_default().text.len()
}

/// Numbers of the last answer.
#[unsafe(no_mangle)]
pub extern "C" fn palpate_numbers() -> *const f64 {
    module().get_or_insert_default().numbers.as_ptr()
}

/// How many numbers.
#[unsafe(no_mangle)]
pub extern "C" fn palpate_numbers_length() -> usize {
    module().get_or_insert_default().numbers.len()
}
