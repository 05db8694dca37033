//! The kinds of devices, by name.

use crate::{Connection, OpenError, Opened};

/// Opens the device of a kind.
///
/// # Errors
/// See the driver's own; a kind that there is not.
pub fn open(kind: &str, _connection: &Connection) -> Result<Opened, OpenError> {
    Err(OpenError::new(
        format!("there is no kind of device called '{kind}'"),
        "choose one of those of 'palpate devices'",
    ))
}
