//! A modal basis in a file: safetensors, checked by content key and checksums, replaced only by rename.

use std::path::Path;

use crate::Result;
use crate::arrays_file::ArraysKind;
use crate::green::add_sections;

/// Version of the file's layout; part of the key.
pub const BASIS_VERSION: u32 = 3;
const KIND: ArraysKind = ArraysKind { format: "palpate-modes", name: "file of modes", version: BASIS_VERSION };

/// Modes of a body.
#[derive(Clone, Debug, PartialEq)]
pub struct Basis {
    /// Hash of everything that determines the modes.
    pub key: String,
    /// What it was made from, in JSON, for people.
    pub description: String,
    /// `omega^2`, ascending (m), 1/s^2.
    pub eigenvalues: Vec<f64>,
    /// Mass-normalised shapes, dof by dof (3n x m), 1/sqrt(kg).
    pub shapes: Vec<f64>,
}

/// Hex BLAKE3 hash of the parts that determine a basis, in order.
pub fn basis_key(parts: &[&[u8]]) -> String {
    let mut hash = blake3::Hasher::new();
    hash.update(format!("palpate modes {BASIS_VERSION}").as_bytes());
    add_sections(&mut hash, parts.iter().copied());
    hash.finalize().to_hex().to_string()
}

impl Basis {
    /// Writes the file beside `path` and renames it into place.
    ///
    /// # Errors
    /// The operating system's, with nothing left behind.
    pub fn save(&self, path: &Path) -> Result<()> {
        let modes = self.eigenvalues.len();
        let rows = self.shapes.len() / modes.max(1);
        let arrays =
            [("eigenvalues", vec![modes], &self.eigenvalues[..]), ("shapes", vec![rows, modes], &self.shapes[..])];
        KIND.write(path, &[("key", &self.key), ("description", &self.description)], &arrays)
    }

    /// Reads and verifies a file.
    ///
    /// # Errors
    /// [`crate::Error::Store`] that says what is wrong, or the operating system's error.
    pub fn load(path: &Path) -> Result<Self> {
        let mut file = KIND.read(path)?;
        let (_, eigenvalues) = file.take("eigenvalues")?;
        let (_, shapes) = file.take("shapes")?;
        Ok(Self { key: file.text("key"), description: file.text("description"), eigenvalues, shapes })
    }
}
