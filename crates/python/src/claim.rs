//! One writer of a store at a time.

use std::path::PathBuf;
use std::sync::Arc;

use palpate_core::Error;
use palpate_core::green::Claim;
use pyo3::prelude::*;

use crate::errors::Answer;

/// The right to write a store, until it is released.
#[pyclass(frozen, module = "palpate._native")]
pub struct StoreClaim {
    claim: Arc<Claim>,
}

#[pymethods]
impl StoreClaim {
    /// Claims the store at `path`; `None` while somebody else writes it.
    #[staticmethod]
    fn take(path: PathBuf) -> Answer<Option<Self>> {
        let claim = Claim::take(&path)?;
        Ok(claim.map(|claim| Self { claim: Arc::new(claim) }))
    }

    /// Lets others write the store, also where an object that wrote it lives on.
    fn release(&self) {
        self.claim.release();
    }
}

/// A claim that Python has made, or a new one.
pub(crate) fn claimed(claim: Option<&StoreClaim>, path: PathBuf) -> Answer<Arc<Claim>> {
    if let Some(claim) = claim {
        return Ok(Arc::clone(&claim.claim));
    }
    let busy = || Error::store(&path, "is being computed by another process: wait for it to end");
    Ok(Arc::new(Claim::take(&path)?.ok_or_else(busy)?))
}
