//! Files of texts and arrays of numbers: safetensors under checksums of header and arrays, read whole, replaced only by rename.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use safetensors::tensor::{Dtype, SafeTensors};

use crate::files::{read, write_whole};
use crate::header::{Header, head_of, is_sealed};
use crate::{Error, Result};

/// A kind of files.
pub(crate) struct ArraysKind {
    /// Marks the files of this kind.
    pub format: &'static str,
    /// What people call one, such as "file of modes".
    pub name: &'static str,
    /// Of the layout.
    pub version: u32,
}

/// Name, shape and numbers.
pub(crate) type NamedArray<'a> = (&'a str, Vec<usize>, &'a [f64]);

/// A file that has been verified.
pub(crate) struct ArraysFile {
    path: PathBuf,
    texts: HashMap<String, String>,
    arrays: BTreeMap<String, (Vec<usize>, Vec<f64>)>,
}

impl ArraysKind {
    /// Writes the file beside `path` and renames it into place.
    ///
    /// # Errors
    /// The operating system's, with nothing left behind.
    pub fn write(&self, path: &Path, texts: &[(&str, &str)], arrays: &[NamedArray<'_>]) -> Result<()> {
        let by_name = BTreeMap::from_iter(arrays.iter().map(|&(name, _, numbers)| (name, numbers)));
        let (version, sum) = (self.version.to_string(), sum(by_name.into_values()));
        let own = [("format", self.format), ("version", version.as_str()), ("checksum", sum.as_str())];
        let mut header = Header::new(own.iter().chain(texts).map(|&(name, text)| (name, text.to_string())));
        for (name, shape, numbers) in arrays {
            header.tensor(name, Dtype::F64, shape, size_of_val(*numbers));
        }
        let header = header.bytes();
        let numbers = arrays.iter().map(|(_, _, numbers)| bytemuck::cast_slice(numbers));
        write_whole(path, std::iter::once(&header[..]).chain(numbers))
    }

    /// Reads and verifies a file.
    ///
    /// # Errors
    /// [`Error::Store`] that says what is wrong, or the operating system's error.
    pub fn read(&self, path: &Path) -> Result<ArraysFile> {
        let Self { format, name, version } = self;
        let bytes = read(path).map_err(|source| Error::Io { path: path.to_owned(), source })?;
        let broken = |e| Error::store(path, format!("is not a {name}, or is damaged or cut short ({e})"));
        let (_, header) = SafeTensors::read_metadata(&bytes).map_err(broken)?;
        let texts = header.metadata().clone().unwrap_or_default();
        let text = |name: &str| texts.get(name).map_or("", String::as_str);
        if text("format") != *format {
            return Err(Error::store(path, format!("is not a {name}")));
        }
        if text("version") != version.to_string() {
            let found = text("version");
            return Err(Error::store(path, format!("has format version {found}, this program reads {version}")));
        }
        if !head_of(&bytes).is_some_and(is_sealed) {
            return Err(Error::store(path, "is damaged: the checksum of its header differs; compute it again"));
        }
        let mut arrays = BTreeMap::new();
        for (name, tensor) in SafeTensors::deserialize(&bytes).map_err(broken)?.tensors() {
            if tensor.dtype() != Dtype::F64 {
                return Err(Error::store(path, format!("is damaged: the type of '{name}' is wrong")));
            }
            let numbers: Vec<f64> = tensor.data().chunks_exact(8).map(bytemuck::pod_read_unaligned).collect();
            arrays.insert(name, (tensor.shape().to_vec(), numbers));
        }
        if sum(arrays.values().map(|(_, numbers)| &numbers[..])) != text("checksum") {
            return Err(Error::store(path, "is damaged: its checksum differs; compute it again"));
        }
        Ok(ArraysFile { path: path.to_owned(), texts, arrays })
    }
}

impl ArraysFile {
    /// A text; empty where there is none.
    pub fn text(&self, name: &str) -> String {
        self.texts.get(name).cloned().unwrap_or_default()
    }

    /// Takes an array: its shape and its numbers.
    ///
    /// # Errors
    /// No such array.
    pub fn take(&mut self, name: &str) -> Result<(Vec<usize>, Vec<f64>)> {
        let missing = || Error::store(&self.path, format!("is damaged: '{name}' is missing"));
        self.arrays.remove(name).ok_or_else(missing)
    }
}

/// One sum of arrays in the order of their names.
fn sum<'a>(arrays: impl Iterator<Item = &'a [f64]>) -> String {
    let mut hash = blake3::Hasher::new();
    for numbers in arrays {
        hash.update(bytemuck::cast_slice(numbers));
    }
    hash.finalize().to_hex().to_string()
}
