//! The regular compliance in a file beside the body's store: safetensors, found by content key, replaced only by rename.

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use safetensors::tensor::{Dtype, SafeTensors, TensorView};

use super::regular::{CompliantBody, FIELDS, FanFields, RegularCompliance};
use crate::files::{unwritten, write_whole};
use crate::header::{head_of, is_sealed, seal_file, unsealed};
use crate::{Error, Result};

/// Version of what is computed and of the file's layout; part of the key.
const VERSION: u32 = 5;
const FORMAT: &str = "palpate-contact";

impl RegularCompliance {
    /// Takes what stands beside the store of the body, for a tool of `radius`, m, on a device up to `max_stiffness`, N/m;
    /// otherwise computes it and keeps it there. A file that is damaged is computed again. Where none can be written,
    /// nothing is kept: the answer is the same.
    pub fn kept(body: CompliantBody<'_>, radius: f64, max_stiffness: f64) -> Self {
        let Some(store) = &body.green.path else { return Self::new(body, radius, max_stiffness) };
        let key = key(body, radius, max_stiffness);
        let path = store.with_extension(format!("{}.contact.palpate", &key[..16]));
        if let Some(found) = load(&path, &key, body.smooth.fans().len()) {
            return found;
        }
        let computed = Self::new(body, radius, max_stiffness);
        let _ = save(&computed, &path, &key);
        computed
    }
}

/// Hex BLAKE3 hash of everything that determines the blocks.
fn key(body: CompliantBody<'_>, radius: f64, max_stiffness: f64) -> String {
    let mut hash = blake3::Hasher::new();
    hash.update(format!("palpate contact {VERSION} {}", body.green.key).as_bytes());
    for numbers in [
        &body.moduli.youngs[..],
        &body.moduli.poissons[..],
        &[radius, max_stiffness, f64::from(u8::from(body.moves)), f64::from(u8::from(body.moduli.homogeneous))],
    ] {
        hash.update(&(numbers.len() as u64).to_le_bytes());
        hash.update(bytemuck::cast_slice(numbers));
    }
    hash.finalize().to_hex().to_string()
}

fn save(computed: &RegularCompliance, path: &Path, key: &str) -> Result<()> {
    let bytes: &[u8] = bytemuck::cast_slice(&computed.fields);
    let metadata = HashMap::from([
        ("format".to_string(), FORMAT.to_string()),
        ("key".to_string(), key.to_string()),
        ("checksum".to_string(), checksum(bytes)),
        unsealed(),
    ]);
    let failed = |e| unwritten(path, e);
    let shape = vec![computed.fields.len(), FIELDS];
    let views = [("fields", TensorView::new(Dtype::F64, shape, bytes).map_err(failed)?)];
    write_whole(path, |partial| {
        safetensors::serialize_to_file(views, Some(metadata), partial).map_err(failed)?;
        seal_file(partial).map_err(|source| Error::Io { path: path.to_owned(), source })
    })
}

/// None for a file that is not there, of another key, damaged, or of another surface.
fn load(path: &Path, key: &str, fans: usize) -> Option<RegularCompliance> {
    let bytes = fs::read(path).ok()?;
    let (_, header) = SafeTensors::read_metadata(&bytes).ok()?;
    let metadata = header.metadata().clone()?;
    let tensors = SafeTensors::deserialize(&bytes).ok()?;
    let tensor = tensors.tensor("fields").ok()?;
    let number = |bytes: &[u8]| f64::from_le_bytes(std::array::from_fn(|i| bytes[i]));
    let entry = |bytes: &[u8]| -> FanFields { std::array::from_fn(|i| number(&bytes[8 * i..8 * (i + 1)])) };
    let whole = tensor.dtype() == Dtype::F64 && tensor.shape() == [fans, FIELDS];
    let right = whole
        && is_sealed(head_of(&bytes)?)
        && metadata.get("key")? == key
        && metadata.get("checksum")? == &checksum(tensor.data());
    right.then(|| RegularCompliance { fields: tensor.data().chunks_exact(8 * FIELDS).map(entry).collect() })
}

fn checksum(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}
