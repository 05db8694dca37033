//! A vendor's library, loaded at run time: search paths, and error messages if it is not found.
//!
//! A library that has been loaded stays: unloading those that run a thread of their own, and loading them again, breaks them.
#![allow(unsafe_code)] // To run somebody else's code is unsafe, whatever its declarations say.

use std::env;
use std::ffi::{CStr, c_char};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use libloading::Library;

use crate::{Connection, OpenError};

/// How a vendor's library is found.
pub(crate) struct LibrarySearch {
    /// Name of the library's product, as a person knows it.
    pub product: &'static str,
    /// Environment variable that names the file.
    pub variable: &'static str,
    /// Names by which the system's loader may find it, the likeliest first.
    pub names: &'static [&'static str],
    /// Environment variables that name a folder of the vendor's, and where below it libraries lie.
    pub folders: &'static [(&'static str, &'static str)],
    /// What to do when it is nowhere.
    pub advice: &'static str,
}

impl LibrarySearch {
    /// Files to try, in their order: what was asked for, and only that; else the usual ones.
    fn candidates(&self, connection: &Connection) -> Vec<PathBuf> {
        if let Some(asked) = &connection.library {
            return vec![asked.clone()];
        }
        if let Some(asked) = env::var_os(self.variable).filter(|asked| !asked.is_empty()) {
            return vec![PathBuf::from(asked)];
        }
        let mut candidates: Vec<PathBuf> = self.names.iter().map(PathBuf::from).collect();
        for (variable, below) in self.folders {
            if let Some(folder) = env::var_os(variable) {
                let folder = Path::new(&folder).join(below);
                candidates.extend(self.names.iter().map(|name| folder.join(name)));
            }
        }
        candidates
    }

    /// Loads the first one that there is.
    fn load(&self, connection: &Connection) -> Result<(PathBuf, &'static Library), OpenError> {
        let candidates = self.candidates(connection);
        let mut broken = None;
        for path in &candidates {
            // SAFETY: the library's initialisation runs here. It is the vendor's, or one that the user has named to be run.
            match unsafe { Library::new(path) } {
                Ok(library) => return Ok((path.clone(), Box::leak(Box::new(library)))),
                Err(error) if path.exists() => broken = Some(format!("{} does not load ({error})", path.display())),
                Err(_) => (),
            }
        }
        let tried: Vec<String> = candidates.iter().map(|path| path.display().to_string()).collect();
        let tried = tried.join(", ");
        let what =
            broken.unwrap_or_else(|| format!("the library of {} is not found, looked for as {tried}", self.product));
        Err(OpenError::new(one_line(&what), format!("{}, or set {} to its file", self.advice, self.variable)))
    }
}

/// Declares the functions of a vendor's library by their symbols: those that it must have, and those that it may.
macro_rules! api {
    (
        needed { $($(#[$doc:meta])* $field:ident = $symbol:literal: $signature:ty;)* }
        optional { $($extra:ident = $name:literal: $kind:ty;)* }
    ) => {
        /// The functions, as they lie in a library that is never unloaded.
        pub struct Api {
            $($(#[$doc])* pub $field: $signature,)*
            $(pub $extra: Option<$kind>,)*
        }

        impl Api {
            /// Finds them.
            pub fn bind(library: &'static libloading::Library) -> Result<Self, libloading::Error> {
                // SAFETY: the types are those of the vendor's header for these names. The pointers stay valid, for the
                // library is never unloaded.
                unsafe {
                    Ok(Self {
                        $($field: *library.get::<$signature>($symbol)?,)*
                        $($extra: library.get::<$kind>($name).ok().map(|symbol| *symbol),)*
                    })
                }
            }
        }
    };
}
pub(crate) use api;

/// Functions of a library that is loaded, `A`, and its file.
pub(crate) struct LoadedLibrary<A: 'static> {
    pub path: PathBuf,
    pub api: &'static A,
}

/// The libraries of one vendor that this process has loaded: one, but for people who try several.
pub(crate) struct Libraries<A: 'static>(Mutex<Vec<(PathBuf, &'static A)>>);

impl<A: Sync> Libraries<A> {
    pub const fn new() -> Self {
        Self(Mutex::new(Vec::new()))
    }

    /// The library of a connection, with what `bind` makes of its symbols; from the second call on the one of the first.
    pub fn get(
        &self,
        search: &LibrarySearch,
        connection: &Connection,
        bind: impl FnOnce(&'static Library) -> Result<A, libloading::Error>,
    ) -> Result<LoadedLibrary<A>, OpenError> {
        let mut loaded = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let candidates = search.candidates(connection);
        if let Some((path, api)) = loaded.iter().find(|(path, _)| candidates.contains(path)) {
            return Ok(LoadedLibrary { path: path.clone(), api });
        }
        let (path, library) = search.load(connection)?;
        let api = bind(library).map_err(|error| {
            let what = format!("{} is not the library of {}: {error}", path.display(), search.product);
            OpenError::new(one_line(&what), search.advice)
        })?;
        let api = Box::leak(Box::new(api));
        loaded.push((path.clone(), api));
        Ok(LoadedLibrary { path, api })
    }
}

/// A string of a library on one line; empty for null.
///
/// # Safety
/// Null, or a string that ends with a zero and stays for the length of the call.
pub(crate) unsafe fn text(pointer: *const c_char) -> String {
    if pointer.is_null() {
        return String::new();
    }
    // SAFETY: by the caller.
    one_line(&unsafe { CStr::from_ptr(pointer) }.to_string_lossy())
}

/// Messages of loaders have line breaks.
fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOWHERE: LibrarySearch = LibrarySearch {
        product: "a product",
        variable: "PALPATE_TEST_LIBRARY_OF_NOBODY",
        names: &["libpalpate_of_nobody.so.3", "libpalpate_of_nobody.so"],
        folders: &[("CARGO_MANIFEST_DIR", "lib")],
        advice: "install it",
    };

    #[test]
    fn says_where_it_was_looked_for_and_what_to_do() {
        let error = NOWHERE.load(&Connection::default()).expect_err("nobody has it");
        let folder = Path::new(&env::var_os("CARGO_MANIFEST_DIR").expect("set by cargo")).join("lib");
        for name in NOWHERE.names {
            assert!(error.what.contains(name), "{error}");
            assert!(error.what.contains(&folder.join(name).display().to_string()), "{error}");
        }
        assert_eq!(error.advice, "install it, or set PALPATE_TEST_LIBRARY_OF_NOBODY to its file");
        assert!(!error.to_string().contains('\n'));
    }

    #[test]
    fn what_is_asked_for_is_all_that_is_tried() {
        let asked = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
        let connection = Connection { library: Some(asked.clone()), ..Connection::default() };
        assert_eq!(NOWHERE.candidates(&connection), std::slice::from_ref(&asked));
        let error = NOWHERE.load(&connection).expect_err("no library");
        assert!(error.what.contains("does not load") && error.what.contains("Cargo.toml"), "{error}");
    }
}
