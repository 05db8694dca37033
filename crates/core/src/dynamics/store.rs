//! A modal basis in a file: safetensors, checked by content key and checksums, replaced only by rename.

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use safetensors::tensor::{Dtype, SafeTensors, TensorView};

use crate::files::{unwritten, write_whole};
use crate::header::{head_of, is_sealed, seal_file, unsealed};
use crate::{Error, Result};

/// Version of the file's layout; part of the key.
pub const BASIS_VERSION: u32 = 2;
const FORMAT: &str = "palpate-modes";

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
    for part in parts {
        hash.update(&(part.len() as u64).to_le_bytes());
        hash.update(part);
    }
    hash.finalize().to_hex().to_string()
}

impl Basis {
    /// Writes the file beside `path` and renames it into place.
    ///
    /// # Errors
    /// The operating system's, with nothing left behind.
    pub fn save(&self, path: &Path) -> Result<()> {
        write_whole(path, |partial| self.write(partial, path))
    }

    fn write(&self, partial: &Path, path: &Path) -> Result<()> {
        let metadata = HashMap::from([
            ("format".to_string(), FORMAT.to_string()),
            ("version".to_string(), BASIS_VERSION.to_string()),
            ("key".to_string(), self.key.clone()),
            ("description".to_string(), self.description.clone()),
            ("checksum".to_string(), self.checksum()),
            unsealed(),
        ]);
        let failed = |e| unwritten(path, e);
        let modes = self.eigenvalues.len();
        let rows = self.shapes.len() / modes.max(1);
        let view = |shape: Vec<usize>, data| TensorView::new(Dtype::F64, shape, data).map_err(failed);
        let views = [
            ("eigenvalues", view(vec![modes], bytemuck::cast_slice(&self.eigenvalues))?),
            ("shapes", view(vec![rows, modes], bytemuck::cast_slice(&self.shapes))?),
        ];
        safetensors::serialize_to_file(views, Some(metadata), partial).map_err(failed)?;
        seal_file(partial).map_err(|source| Error::Io { path: path.to_owned(), source })
    }

    /// Reads and verifies a file.
    ///
    /// # Errors
    /// [`Error::Store`] that says what is wrong, or the operating system's error.
    pub fn load(path: &Path) -> Result<Self> {
        let bytes = fs::read(path).map_err(|source| Error::Io { path: path.to_owned(), source })?;
        let broken = |e| refused(path, format!("is not a file of modes, or is damaged or cut short ({e})"));
        let (_, header) = SafeTensors::read_metadata(&bytes).map_err(broken)?;
        let metadata = header.metadata().clone().unwrap_or_default();
        let field = |name: &str| metadata.get(name).map_or("", String::as_str);
        if field("format") != FORMAT {
            return Err(refused(path, "is not a file of modes"));
        }
        if field("version") != BASIS_VERSION.to_string() {
            let version = field("version");
            return Err(refused(path, format!("has format version {version}, this program reads {BASIS_VERSION}")));
        }
        if !head_of(&bytes).is_some_and(is_sealed) {
            return Err(refused(path, "is damaged: the checksum of its header differs; compute it again"));
        }
        let tensors = SafeTensors::deserialize(&bytes).map_err(broken)?;
        let numbers = |name: &str| -> Result<Vec<f64>> {
            let tensor = tensors.tensor(name).map_err(broken)?;
            if tensor.dtype() != Dtype::F64 {
                return Err(refused(path, format!("is damaged: the type of '{name}' is wrong")));
            }
            let number = |bytes: &[u8]| f64::from_le_bytes(std::array::from_fn(|i| bytes[i]));
            Ok(tensor.data().chunks_exact(8).map(number).collect())
        };
        let basis = Self {
            key: field("key").to_string(),
            description: field("description").to_string(),
            eigenvalues: numbers("eigenvalues")?,
            shapes: numbers("shapes")?,
        };
        if basis.checksum() != field("checksum") {
            return Err(refused(path, "is damaged: its checksum differs; compute it again"));
        }
        Ok(basis)
    }

    fn checksum(&self) -> String {
        basis_key(&[
            self.key.as_bytes(),
            self.description.as_bytes(),
            bytemuck::cast_slice(&self.eigenvalues),
            bytemuck::cast_slice(&self.shapes),
        ])
    }
}

fn refused(path: &Path, reason: impl Into<String>) -> Error {
    Error::Store { path: path.to_owned(), reason: reason.into() }
}
