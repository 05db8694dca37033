//! A file of arrays: safetensors whose bytes have the checksum that the scene names.

use std::path::{Path, PathBuf};

use bytemuck::AnyBitPattern;
use palpate_core::{Error, Result, files};
use safetensors::tensor::{Dtype, SafeTensors};

use super::description::ArrayFile;

/// Hex BLAKE3 hash.
pub fn checksum(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// Path of a file of the scene.
///
/// # Errors
/// A name that leads out of the folder.
pub fn file_of(folder: &Path, name: &str) -> Result<PathBuf> {
    let plain = Path::new(name).file_name().is_some_and(|last| last == name);
    if plain {
        Ok(folder.join(name))
    } else {
        Err(Error::store(folder, format!("names the file '{name}' outside of itself")))
    }
}

/// The bytes of a file, verified.
pub struct Arrays {
    path: PathBuf,
    bytes: Vec<u8>,
}

impl Arrays {
    /// Reads a file of a folder.
    ///
    /// # Errors
    /// The operating system's, or another checksum.
    pub fn read(folder: &Path, file: &ArrayFile) -> Result<Self> {
        let path = file_of(folder, &file.file)?;
        let bytes = files::read(&path).map_err(|source| Error::Io { path: path.clone(), source })?;
        if checksum(&bytes) != file.checksum {
            return Err(Error::store(
                &path,
                "is damaged, or of another scene: its checksum differs; pack the scene again",
            ));
        }
        Ok(Self { path, bytes })
    }

    /// Numbers of an array with that many columns; none where there is no such array.
    ///
    /// # Errors
    /// Another type or width.
    pub fn optional<T: AnyBitPattern>(&self, name: &str, dtype: Dtype, columns: usize) -> Result<Option<Vec<T>>> {
        let wrong = |what: &str| Error::store(&self.path, format!("{what} ('{name}'); pack the scene again"));
        let tensors = SafeTensors::deserialize(&self.bytes).map_err(|_| wrong("is no file of arrays"))?;
        let Ok(tensor) = tensors.tensor(name) else { return Ok(None) };
        let width: usize = tensor.shape().iter().skip(1).product();
        if tensor.dtype() != dtype || (columns > 0 && width != columns) {
            return Err(wrong("holds an array of another type or shape"));
        }
        let each = tensor.data().chunks_exact(size_of::<T>());
        Ok(Some(each.map(bytemuck::pod_read_unaligned).collect()))
    }

    /// The same of an array that must be there.
    ///
    /// # Errors
    /// No such array.
    pub fn numbers<T: AnyBitPattern>(&self, name: &str, dtype: Dtype, columns: usize) -> Result<Vec<T>> {
        let missing = || Error::store(&self.path, format!("has no array '{name}'; pack the scene again"));
        self.optional(name, dtype, columns)?.ok_or_else(missing)
    }

    /// Columns of an array.
    ///
    /// # Errors
    /// No such array.
    #[cfg(feature = "offline")]
    pub fn width(&self, name: &str) -> Result<usize> {
        let missing = |_| Error::store(&self.path, format!("has no array '{name}'; pack the scene again"));
        let tensors = SafeTensors::deserialize(&self.bytes).map_err(missing)?;
        Ok(tensors.tensor(name).map_err(missing)?.shape().iter().skip(1).product())
    }
}
