//! The kinds of devices, by name.

use crate::{Connection, Listing, OpenError, ReadyDevice, forcedimension, haply, openhaptics};

/// What the module of a driver does.
struct Driver {
    kind: &'static str,
    list: fn(&Connection) -> Listing,
    open: fn(&Connection) -> Result<ReadyDevice, OpenError>,
}

/// All drivers, by the kind that a scene names.
static DRIVERS: [Driver; 3] = [
    Driver { kind: "haply", list: haply::list, open: haply::open },
    Driver { kind: "touch", list: openhaptics::list, open: openhaptics::open },
    Driver { kind: "forcedimension", list: forcedimension::list, open: forcedimension::open },
];

fn driver(kind: &str) -> Result<&'static Driver, OpenError> {
    DRIVERS.iter().find(|driver| driver.kind == kind).ok_or_else(|| {
        OpenError::new(
            format!("there is no kind of device called '{kind}'"),
            "choose one of those of 'palpate devices'",
        )
    })
}

/// Kinds of devices that there are drivers for.
pub fn kinds() -> impl Iterator<Item = &'static str> {
    DRIVERS.iter().map(|driver| driver.kind)
}

/// What the driver of a kind sees.
///
/// # Errors
/// A kind that there is not.
pub fn list(kind: &str, connection: &Connection) -> Result<Listing, OpenError> {
    driver(kind).map(|driver| (driver.list)(connection))
}

/// Opens the device of a kind.
///
/// # Errors
/// See the driver's own; a kind that there is not.
pub fn open(kind: &str, connection: &Connection) -> Result<ReadyDevice, OpenError> {
    driver(kind).and_then(|driver| (driver.open)(connection))
}
