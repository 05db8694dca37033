//! Status codes of the C functions, and the message of the last error.

use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use palpate_core::Error;

/// What a function returns: negative for a refused call, which has changed nothing.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// Done.
    PalpateOk = 0,
    /// A fault has latched: the tools that it concerns have no wrench until palpate_loop_reset.
    PalpateFault = 1,
    /// A null pointer, a wrong length, an unknown handle, a number out of range.
    PalpateErrorArgument = -1,
    /// The operating system's: a file that cannot be read, no thread, no memory.
    PalpateErrorSystem = -2,
    /// A store or packed scene that is damaged, of another version, or does not belong to the scene.
    PalpateErrorStore = -3,
    /// An equation without an answer, or one that the store's digits do not carry.
    PalpateErrorSolve = -4,
    /// Not now: the loop's own thread runs, or does not.
    PalpateErrorState = -5,
    /// Another thread is within a tick of the same loop.
    PalpateErrorBusy = -6,
    /// A mistake within the library: please report it.
    PalpateErrorInternal = -7,
}

/// Why a call is refused.
#[derive(Debug)]
pub struct Refusal {
    /// What is returned.
    pub status: Status,
    /// What was wrong, in one line.
    pub message: String,
}

impl Refusal {
    /// Of an argument.
    pub fn argument(message: impl Into<String>) -> Self {
        Self { status: Status::PalpateErrorArgument, message: message.into() }
    }

    /// Of a call at the wrong time.
    pub fn state(message: impl Into<String>) -> Self {
        Self { status: Status::PalpateErrorState, message: message.into() }
    }
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        let status = match error {
            Error::Invalid(_) => Status::PalpateErrorArgument,
            Error::Store { .. } => Status::PalpateErrorStore,
            Error::Singular(_) | Error::Precision(_) => Status::PalpateErrorSolve,
            Error::Io { .. } | Error::Memory(_) | Error::Interrupted => Status::PalpateErrorSystem,
        };
        Self { status, message: error.to_string() }
    }
}

impl From<()> for Status {
    fn from((): ()) -> Self {
        Self::PalpateOk
    }
}

/// Result of what stands behind a function.
pub type Outcome<T = ()> = Result<T, Refusal>;

thread_local! {
    static LAST: RefCell<CString> = RefCell::new(CString::default());
}

/// Runs what stands behind a function: a refusal leaves its message, a panic stays inside.
pub fn catching_panics<T: Into<Status>>(run: impl FnOnce() -> Outcome<T>) -> Status {
    match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(done)) => done.into(),
        Ok(Err(refusal)) => {
            set_last_error(refusal.message);
            refusal.status
        }
        Err(panic) => {
            set_last_error(format!("a mistake within palpate, please report it: {}", panic_message(&*panic)));
            Status::PalpateErrorInternal
        }
    }
}

fn panic_message(panic: &dyn Any) -> &str {
    let owned = panic.downcast_ref::<String>().map(String::as_str);
    owned.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message")
}

/// Stores the error message of the calling thread.
pub fn set_last_error(message: String) {
    let mut bytes = message.into_bytes();
    bytes.retain(|&byte| byte != 0);
    let text = CString::new(bytes).unwrap_or_default();
    // A thread that ends has nobody left to tell.
    let _ = LAST.try_with(|last| last.replace(text));
}

/// Error message of the calling thread.
pub fn last_error() -> *const c_char {
    const NONE: &CStr = c"";
    LAST.try_with(|last| last.borrow().as_ptr()).unwrap_or(NONE.as_ptr())
}
