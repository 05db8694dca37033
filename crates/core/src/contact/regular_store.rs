//! The regular compliance in a file beside the body's store: safetensors, found by content key, replaced only by rename.

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use glam::DMat3;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};

use super::regular::{CompliantBody, RegularCompliance};
use crate::Result;
use crate::files::{unwritten, write_whole};

/// Version of what is computed and of the file's layout; part of the key.
const VERSION: u32 = 1;
const FORMAT: &str = "palpate-contact";
/// Places of the symmetric block's numbers in a matrix by columns.
const UPPER: [usize; 6] = [0, 3, 6, 4, 7, 8];

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
    let blocks: Vec<f64> = computed.blocks.iter().flat_map(|b| UPPER.map(|i| b.to_cols_array()[i])).collect();
    let metadata = HashMap::from([
        ("format".to_string(), FORMAT.to_string()),
        ("key".to_string(), key.to_string()),
        ("checksum".to_string(), checksum(&blocks, &computed.widths)),
    ]);
    let count = computed.widths.len();
    let failed = |e| unwritten(path, e);
    let view = |shape, numbers| TensorView::new(Dtype::F64, shape, bytemuck::cast_slice(numbers)).map_err(failed);
    let views = [("blocks", view(vec![count, 6], &blocks)?), ("widths", view(vec![count], &computed.widths)?)];
    write_whole(path, |partial| safetensors::serialize_to_file(views, Some(metadata), partial).map_err(failed))
}

/// None for a file that is not there, of another key, damaged, or of another surface.
fn load(path: &Path, key: &str, fans: usize) -> Option<RegularCompliance> {
    let bytes = fs::read(path).ok()?;
    let (_, header) = SafeTensors::read_metadata(&bytes).ok()?;
    let metadata = header.metadata().clone()?;
    let tensors = SafeTensors::deserialize(&bytes).ok()?;
    let numbers = |name: &str, count: usize| -> Option<Vec<f64>> {
        let tensor = tensors.tensor(name).ok()?;
        let number = |bytes: &[u8]| f64::from_le_bytes(std::array::from_fn(|i| bytes[i]));
        let found: Vec<f64> = tensor.data().chunks_exact(8).map(number).collect();
        (tensor.dtype() == Dtype::F64 && found.len() == count).then_some(found)
    };
    let (blocks, widths) = (numbers("blocks", 6 * fans)?, numbers("widths", fans)?);
    let right = metadata.get("key")? == key && metadata.get("checksum")? == &checksum(&blocks, &widths);
    let matrix = |b: &[f64]| DMat3::from_cols_array(&[b[0], b[1], b[2], b[1], b[3], b[4], b[2], b[4], b[5]]);
    right.then(|| RegularCompliance { blocks: blocks.chunks_exact(6).map(matrix).collect(), widths })
}

fn checksum(blocks: &[f64], widths: &[f64]) -> String {
    let mut hash = blake3::Hasher::new();
    hash.update(bytemuck::cast_slice(blocks)).update(bytemuck::cast_slice(widths));
    hash.finalize().to_hex().to_string()
}
