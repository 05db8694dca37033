//! Content keys: hashes of everything that determines what is computed.

/// Version of the store's layout; part of the key, so that an old file is recomputed, never misread.
pub const FORMAT_VERSION: u32 = 5;

/// Adds sections of bytes to a hash, each with its length.
pub fn add_sections<'a>(hash: &mut blake3::Hasher, sections: impl IntoIterator<Item = &'a [u8]>) {
    for bytes in sections {
        hash.update(&(bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    }
}
