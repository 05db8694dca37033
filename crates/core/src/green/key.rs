//! The content key: a hash of everything that determines a Green's function.

#[cfg(feature = "offline")]
use super::precision::Precision;

/// Version of the store's layout; part of the key, so that an old file is recomputed, never misread.
pub const FORMAT_VERSION: u32 = 5;

/// Hex BLAKE3 hash of element, precision, format version and sections of bytes, each with its length.
#[cfg(feature = "offline")]
#[derive(Clone)]
pub struct ContentKey(blake3::Hasher);

#[cfg(feature = "offline")]
impl ContentKey {
    /// No section yet. `precision`: as asked for; `None` where the body decides.
    pub fn new(element: &str, precision: Option<Precision>) -> Self {
        let mut hash = blake3::Hasher::new();
        let precision = precision.map_or("chosen", Precision::name);
        hash.update(format!("palpate green {FORMAT_VERSION} {element} {precision}").as_bytes());
        Self(hash)
    }

    /// Adds a section.
    pub fn section(&mut self, bytes: &[u8]) {
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
    }

    /// The key.
    pub fn finish(self) -> String {
        self.0.finalize().to_hex().to_string()
    }
}
