//! One error type for the offline part; the tick has none, it cannot fail.

use std::path::PathBuf;

/// What went wrong, in one line, with the place and the remedy where one is known.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The stiffness matrix of the free dofs is not positive definite.
    #[error("the stiffness matrix is singular: {0}")]
    Singular(String),
    /// An argument is not usable; the message names it.
    #[error("{0}")]
    Invalid(String),
    /// The store does not belong to this body, or is damaged.
    #[error("{path}: {reason}")]
    Store {
        /// The store's file.
        path: PathBuf,
        /// What is wrong and what to do.
        reason: String,
    },
    /// The operating system refused.
    #[error("{path}: {source}")]
    Io {
        /// The file concerned.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The numbers of a store do not carry an answer.
    #[error("{0}")]
    Precision(String),
    /// The memory allowed is not enough.
    #[error("{0}")]
    Memory(String),
    /// The caller asked to stop.
    #[error("interrupted")]
    Interrupted,
}

impl Error {
    /// What is wrong with a store, and what to do.
    pub fn store(path: impl Into<PathBuf>, reason: impl Into<String>) -> Self {
        Error::Store { path: path.into(), reason: reason.into() }
    }
}

/// Result with the crate's error.
pub type Result<T, E = Error> = std::result::Result<T, E>;
