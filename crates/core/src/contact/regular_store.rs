//! Files of the regular compliance beside the body's store: safetensors, found by content key, replaced only by rename.

use std::fs;
use std::path::{Path, PathBuf};

use super::regular::{CompliantBody, FIELDS, RegularCompliance};
use crate::Result;
use crate::arrays_file::ArraysKind;

/// Version of the computation and of the file's layout; part of the key.
const VERSION: u32 = 15;
const KIND: ArraysKind = ArraysKind { format: "palpate-contact", name: "file of contacts", version: VERSION };
/// Suffix of the files, after the beginning of the key.
const ENDING: &str = "contact.palpate";
/// Digits of the key in the name of a file.
const DIGITS: usize = 16;
/// Most files beside a store: each radius and elastic constant has one.
const MAX_FILES: usize = 16;

impl RegularCompliance {
    /// Reads the file beside the store of the body, for the arguments of [`Self::new`]. Computes and
    /// writes it if it is missing or damaged. The result is the same if it cannot be written.
    pub fn load_or_compute(body: CompliantBody<'_>, radii: [f64; 2], max_stiffness: f64) -> Self {
        let Some(store) = &body.green.path else { return Self::new(body, radii, max_stiffness) };
        let key = key(body, radii, max_stiffness);
        let path = store.with_extension(format!("{}.{ENDING}", &key[..DIGITS]));
        if let Some(found) = load(&path, &key, body.smooth.fans().len()) {
            return found;
        }
        let computed = Self::new(body, radii, max_stiffness);
        if save(&computed, &path, &key).is_ok() {
            remove_oldest(store);
        }
        computed
    }
}

/// Removes all such files of a store.
pub fn remove_compliance_files(store: &Path) {
    files_of(store).into_iter().for_each(remove);
}

/// Removes the oldest files beyond the limit.
fn remove_oldest(store: &Path) {
    let mut files = files_of(store);
    let written = |file: &PathBuf| fs::metadata(file).and_then(|metadata| metadata.modified()).ok();
    files.sort_by_cached_key(written);
    files.truncate(files.len().saturating_sub(MAX_FILES));
    files.into_iter().for_each(remove);
}

/// Removes a file; another process may have removed it already.
fn remove(file: PathBuf) {
    drop(fs::remove_file(file));
}

/// Files that belong to a store. The files of `organ.left.palpate` begin like those of `organ.palpate`.
fn files_of(store: &Path) -> Vec<PathBuf> {
    let folder = store.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let stem = store.file_stem().unwrap_or_default().to_string_lossy();
    let is_ours = |name: &str| {
        let key = name.strip_prefix(&*stem).and_then(|rest| rest.strip_prefix('.'));
        let key = key.and_then(|rest| rest.strip_suffix(ENDING)).and_then(|rest| rest.strip_suffix('.'));
        key.is_some_and(|key| key.len() == DIGITS && key.bytes().all(|digit| digit.is_ascii_hexdigit()))
    };
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.filter(|entry| entry.file_name().to_str().is_some_and(is_ours)).map(|entry| entry.path()).collect()
}

/// Hex BLAKE3 hash of everything that determines the blocks.
fn key(body: CompliantBody<'_>, radii: [f64; 2], max_stiffness: f64) -> String {
    let mut hash = blake3::Hasher::new();
    hash.update(format!("palpate contact {VERSION} {}", body.green.key).as_bytes());
    for numbers in [
        &body.moduli.youngs[..],
        &body.moduli.poissons[..],
        body.moduli.strain_terms.as_flattened(),
        &radii,
        &[max_stiffness, f64::from(u8::from(body.moves)), f64::from(u8::from(body.moduli.homogeneous))],
    ] {
        hash.update(&(numbers.len() as u64).to_le_bytes());
        hash.update(bytemuck::cast_slice(numbers));
    }
    hash.finalize().to_hex().to_string()
}

fn save(computed: &RegularCompliance, path: &Path, key: &str) -> Result<()> {
    let shape = vec![computed.fields.len(), FIELDS];
    KIND.write(path, &[("key", key)], &[("fields", shape, computed.fields.as_flattened())])
}

/// None for a file that is missing, damaged, or of another key or surface.
fn load(path: &Path, key: &str, fans: usize) -> Option<RegularCompliance> {
    let mut file = KIND.read(path).ok()?;
    let (shape, numbers) = file.take("fields").ok()?;
    let right = shape == [fans, FIELDS] && file.text("key") == key;
    right.then(|| RegularCompliance { fields: numbers.as_chunks().0.to_vec() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_of_a_store_are_its_own_and_bounded() {
        let folder = std::env::temp_dir().join(format!("palpate-{}-kept", std::process::id()));
        fs::create_dir_all(&folder).expect("a writable folder");
        let key = |k: usize| format!("{k:016x}");
        let of = |stem: &str, k: usize| folder.join(format!("{stem}.{}.contact.palpate", key(k)));
        for k in 0..MAX_FILES + 3 {
            fs::write(of("organ", k), b"").expect("a writable folder");
            fs::write(of("organ.left", k), b"").expect("a writable folder");
            // The clock of a file system may be coarse.
            std::thread::sleep(std::time::Duration::from_millis(12));
        }
        let store = folder.join("organ.palpate");
        remove_oldest(&store);
        let left: Vec<bool> = (0..MAX_FILES + 3).map(|k| of("organ", k).exists()).collect();
        assert_eq!(left, (0..MAX_FILES + 3).map(|k| k >= 3).collect::<Vec<_>>());
        remove_compliance_files(&store);
        assert!(files_of(&store).is_empty());
        assert_eq!(files_of(&folder.join("organ.left.palpate")).len(), MAX_FILES + 3);
        fs::remove_dir_all(&folder).expect("the folder");
    }
}
